"""The methods by name: one place that says what ``--method NAME`` and a row of docs/results.md mean."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Any

from wayfuse.maps.site import Site
from wayfuse.presets import baselines, fused
from wayfuse.radio.survey import Survey
from wayfuse.tracking.tracker import Tracker

__all__ = ["CONFIGS", "FIXES", "build_method"]

# the particle filters; dead reckoning is not here, for it needs a start instead of a survey
CONFIGS: Mapping[str, fused.Config] = MappingProxyType(
    {
        "fused": fused.Config(),
        "fused-no-map": fused.Config(map_constraint="none"),
        "fused-barriers": fused.Config(map_constraint="barriers"),
        "fused-no-steps": fused.Config(use_steps=False),
        "fused-2.4ghz": fused.Config(bands=fused.BAND_2_4),
        "fused-5ghz": fused.Config(bands=fused.BAND_5),
        "random-walk": baselines.RANDOM_WALK,
    }
)
FIXES = MappingProxyType({"wknn": baselines.wknn, "nnss": baselines.nnss})


def build_method(
    name: str, site: Site, survey: Survey, *, n_particles: int = 1000, lag: float = 0.0
) -> Tracker[Any]:
    """The tracker of a method of `CONFIGS` or `FIXES`; KeyError for another name."""
    if name in FIXES:
        return FIXES[name](site, survey, lag=lag)
    return fused.build(site, survey, replace(CONFIGS[name], n_particles=n_particles), lag=lag)
