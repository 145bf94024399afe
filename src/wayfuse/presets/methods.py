"""Trackers by the name of their method: what ``--method NAME`` and a row of docs/results.md mean.

`presets.catalogue` says in words what each is and needs.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from importlib import import_module
from types import MappingProxyType
from typing import Any, TypeVar

from wayfuse.core.errors import UsageError
from wayfuse.maps.site import Site
from wayfuse.presets import baselines, fused
from wayfuse.presets.catalogue import PAPERS
from wayfuse.radio.ap_places import ApPlaces
from wayfuse.radio.survey import Survey
from wayfuse.tracking.dead_reckoning import DeadReckoning, Start
from wayfuse.tracking.plain_engine import PlainEngine
from wayfuse.tracking.tracker import Tracker

__all__ = ["CONFIGS", "FIXES", "begun_at", "build_from_start", "build_method"]

T = TypeVar("T")

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
    name: str,
    site: Site,
    survey: Survey | None,
    *,
    places: ApPlaces | None = None,
    n_particles: int | None = None,
    lag: float = 0.0,
) -> Tracker[Any]:
    """The tracker of a method that needs no start; KeyError for another name.

    places : of the access points; systems that need them estimate them from the survey where None are given.
    n_particles : None = the method's own number.

    Raises
    ------
    UsageError : something that the method needs is missing.
    """
    if name in PAPERS:
        return _build_paper(name, site, survey, places, n_particles, lag)
    if name == "fused-ranges":
        config = fused.Config() if n_particles is None else fused.Config(n_particles=n_particles)
        return fused.build_from_ranges(site, _given(name, places, "--access-points"), config, lag=lag)
    given = _given(name, survey, "--radio-map")
    if name in FIXES:
        return FIXES[name](site, given, lag=lag)
    config = CONFIGS[name]
    if n_particles is not None:
        config = replace(config, n_particles=n_particles)
    return fused.build(site, given, config, places=places, lag=lag)


def build_from_start(
    name: str, site: Site, start: Start, *, n_particles: int = 1000, lag: float = 0.0
) -> Tracker[Any]:
    """The tracker of a method that needs a start instead of a survey: ``fused-no-wifi`` or ``pdr``."""
    if name == "pdr":
        return baselines.dead_reckoning(site, start, lag=lag)
    if name != "fused-no-wifi":
        raise KeyError(name)
    return fused.build_from_start(site, start, fused.Config(n_particles=n_particles), lag=lag)


def begun_at(tracker: Tracker[Any], start: Start) -> Tracker[Any]:
    """The tracker of a published system, or ``pdr``, of tracks that begin at a place that is told; nothing is refitted.

    Raises
    ------
    UsageError : the method finds its start itself.
    """
    if not isinstance(tracker.engine, PlainEngine | DeadReckoning):
        raise UsageError("this method finds its start itself", where="--start", remedy="leave it out")
    return replace(tracker, engine=tracker.engine.begun_at(start))


def _build_paper(
    name: str,
    site: Site,
    survey: Survey | None,
    places: ApPlaces | None,
    n_particles: int | None,
    lag: float,
) -> Tracker[Any]:
    """A published system, put together in presets/<name>_tracker.py."""
    module = import_module(f"wayfuse.presets.{name}_tracker")
    config = module.Config()
    if n_particles is not None:
        config = replace(config, n_particles=n_particles)
    tracker: Tracker[Any] = module.build(site, survey, places=places, config=config, lag=lag)
    return tracker


def _given(name: str, what: T | None, option: str) -> T:
    if what is None:
        raise UsageError(f"method {name} lacks an input", where=option, remedy="give it")
    return what
