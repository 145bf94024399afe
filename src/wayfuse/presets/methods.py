"""The methods by name: one place that says what ``--method NAME`` and a row of docs/results.md mean."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Any

from wayfuse.maps.site import Site
from wayfuse.presets import baselines, fused
from wayfuse.radio.survey import Survey
from wayfuse.tracking.dead_reckoning import Start
from wayfuse.tracking.tracker import Tracker

__all__ = ["CONFIGS", "FIXES", "build_from_start", "build_method"]

# the particle filters that need a survey; those that need a start instead are built by `build_from_start`
CONFIGS: Mapping[str, fused.Config] = MappingProxyType(
    {
        "fused": fused.Config(),
        "fused-no-map": fused.Config(map_constraint="none"),
        "fused-barriers": fused.Config(map_constraint="barriers"),
        "fused-no-barometer": fused.Config(use_pressure=False),
        "fused-no-offset": fused.Config(device_offset=False),
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


def build_from_start(
    name: str, site: Site, start: Start, *, n_particles: int = 1000, lag: float = 0.0
) -> Tracker[Any]:
    """The tracker of a method that needs a start instead of a survey: ``fused-no-wifi`` or ``pdr``."""
    if name == "pdr":
        return baselines.dead_reckoning(site, start, lag=lag)
    if name != "fused-no-wifi":
        raise KeyError(name)
    return fused.build_from_start(site, start, fused.Config(n_particles=n_particles), lag=lag)
