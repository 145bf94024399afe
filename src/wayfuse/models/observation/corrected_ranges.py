"""Ranges that are long, brought to distances before they are looked at (`radio.range_correction`)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from wayfuse.core.types import Array
from wayfuse.filters.cloud import Cloud
from wayfuse.models.observation.anchored_ranges import AnchoredRanges
from wayfuse.radio.range_correction import AS_MEASURED, RangeLine
from wayfuse.sensors.records import Range

__all__ = ["CorrectedRanges"]


@dataclass(frozen=True, slots=True)
class CorrectedRanges:
    """The likelihood of ranges on a line; exponents are of the corrected distances.

    states_sigma : whether the standard deviations that records state are looked at. A phone states the scatter of one
    burst, decimetres; the errors of ranges are metres and last.
    """

    ranging: AnchoredRanges
    line: RangeLine = AS_MEASURED
    states_sigma: bool = False

    def log_likelihood(self, cloud: Cloud, ranges: Sequence[Range], out: Array) -> bool:
        """Add log p(d | x) to ``out`` (N,); False, and nothing added, where no anchor is known."""
        distances = self.line.distance([r.distance for r in ranges]).tolist()
        on_line = [r._replace(distance=d) for r, d in zip(ranges, distances, strict=True)]
        if not self.states_sigma:
            on_line = [r._replace(sigma=float("nan")) for r in on_line]
        return self.ranging.log_likelihood(cloud, on_line, out)
