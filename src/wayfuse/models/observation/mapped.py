"""Any radio map as an observation of particles: its log-likelihood at their places, for scans it knows something of."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.errors import ConfigError
from wayfuse.core.types import Array, IdArray
from wayfuse.filters.cloud import Cloud
from wayfuse.radio.survey import Fingerprint

__all__ = ["MapLikelihood", "MappedLevels"]


class MappedLevels(Protocol):
    """What is needed of a radio map; every `radio.radio_map.RadioMap` has it."""

    @property
    def bssid(self) -> IdArray:
        """(m,) access points, ascending."""
        ...

    def log_likelihood(
        self, fingerprint: Fingerprint, xy: NDArray[np.floating], floor: NDArray[np.integer]
    ) -> Array:
        """(N,) log-likelihood at xy (N, 2) m, floor (N,)."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MapLikelihood:
    """Parameters: radio_map. most : access points that a scan may count for; the log-likelihood of one that heard more
    is lowered in proportion. The papers multiply over ten or so; of hundreds, many on one device, errors are alike."""

    radio_map: MappedLevels
    most: float = math.inf

    def __post_init__(self) -> None:
        if not self.most > 0.0:
            raise ConfigError(f"most must be positive, got {self.most}", where="MapLikelihood")

    def log_likelihood(self, cloud: Cloud, fingerprint: Fingerprint, out: Array) -> bool:
        """Add the log-likelihood to ``out`` (N,); False, and nothing added, where no access point is known."""
        n_known = int(np.isin(fingerprint.bssid, self.radio_map.bssid).sum())
        if n_known == 0:
            return False
        xy = np.column_stack([cloud.x, cloud.y])
        out += min(1.0, self.most / n_known) * self.radio_map.log_likelihood(fingerprint, xy, cloud.floor)
        return True
