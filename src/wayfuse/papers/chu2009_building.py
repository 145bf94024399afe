"""chu2009, chapter 5: the building of three floors, and recovery from a lost track, which the thesis lacks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.types import Array, BoolArray
from wayfuse.evaluation.results_bars import Bar, at_least, at_most, within
from wayfuse.evaluation.results_folds import Mapper
from wayfuse.inertial.vertical import Behaviour, VerticalEvent
from wayfuse.maps.site import Site
from wayfuse.models.motion.pdr import StepInput
from wayfuse.papers.reproduction import Curve, Reproduction, Table, mean_interval
from wayfuse.presets.chu2009_sepf import Config, Said, Second, nnss, pf_mcl, sepf
from wayfuse.radio.interpolated_map import InterpolatedMap, fit
from wayfuse.radio.survey import Fingerprint, Survey
from wayfuse.simulator.building import Building
from wayfuse.simulator.chu2009_building import (
    FLOOR_HEIGHT,
    BuildingModel,
    Radio,
    Walk,
    draw_radio,
    engineering_building,
    walk,
)
from wayfuse.simulator.house_site import site_of
from wayfuse.simulator.passages import RISER

__all__ = ["PICTURE", "Experiment", "reproduce_building", "seconds_of", "survey_of"]

PICTURE = "chu2009-recovery.png"
PRINTED = {"NNSS": 7.33, "PF_MCL": 4.92, "PFMM": 3.01}  # m, chapter 5
_TOLERANCE = 0.25
_METHODS = (*PRINTED, "PFMM without speed filter", "PFMM with recovery")
_RECOVERING = ("PFMM", "PFMM with recovery", "PF_MCL")
_SCENARIOS = ("put on a wrong floor", "carried in silence over stairs or by lift")
_LOST = 20.0  # m: never nearer in the last minute
_BACK = 5.0  # m and on the right floor, so many seconds on end, is back on the track
_BACK_FOR = 5
_WATCHED = 120  # s after the event
_SILENCE = 90  # s
_KIDNAPPED_AT = 150  # s
_WITHIN = (30, 60, 120)  # s


class _Run(NamedTuple):
    """One seed: error (methods,) m, floor (methods,) share of seconds, lost (methods,), back (scenarios, methods) s."""

    error: Array
    floor: Array
    lost: BoolArray
    back: Array


@lru_cache(maxsize=1)
def _plan() -> tuple[Building, Site]:
    # the same for all seeds
    building = engineering_building()
    return building, site_of(building)


class Experiment:
    """Every method on one walk, and on two walks that lose it; travels to the worker processes."""

    def __init__(self, seconds: int = 300) -> None:
        self.model = BuildingModel(seconds=seconds)

    def __call__(self, seed: int) -> _Run:
        """Run one seed; it has a stream of its own, apart from those by which the open parameters were chosen."""
        model, c = self.model, Config()
        building, site = _plan()
        rng = np.random.default_rng([2009, 61, seed])
        radio = draw_radio(building, model, rng)
        radio_map = fit(
            survey_of(radio), sigma=float(np.hypot(model.noise, model.drift)), missing=radio.limit - 3.0
        )
        walked = walk(radio, rng)
        seconds = seconds_of(walked, radio_map)
        tracks = (
            nnss(radio_map, seconds),
            pf_mcl(site, radio_map, seconds, c, seed),
            sepf(site, radio_map, seconds, c, seed),
            sepf(site, radio_map, seconds, replace(c, speed=None), seed),
            sepf(site, radio_map, seconds, replace(c, recovery=True), seed),
        )
        error = [np.hypot(*(said.xy - walked.xy).T) for said in tracks]
        level = (
            np.abs(walked.z - FLOOR_HEIGHT * walked.floor) < 0.1
        )  # on stairs and in a lift no floor is right
        return _Run(
            np.array([e.mean() for e in error]),
            np.array([np.mean(said.floor[level] == walked.floor[level]) for said in tracks]),
            np.array([e[-60:].min() > _LOST for e in error]),
            np.array(
                [self._put_away(site, radio, radio_map, seed), self._carried(site, radio, radio_map, seed)]
            ),
        )

    def _put_away(self, site: Site, radio: Radio, radio_map: InterpolatedMap, seed: int) -> list[float]:
        rng = np.random.default_rng([2009, 52, seed])
        walked = walk(radio, rng)
        at = min(_KIDNAPPED_AT, self.model.seconds // 2)
        other = np.flatnonzero(radio.survey_floor != walked.floor[at])
        row = int(rng.choice(other))
        where = {at: (*radio.survey_xy[row].tolist(), int(radio.survey_floor[row]))}
        return _returns(site, radio_map, walked, seconds_of(walked, radio_map), seed, at, where)

    def _carried(self, site: Site, radio: Radio, radio_map: InterpolatedMap, seed: int) -> list[float]:
        rng = np.random.default_rng([2009, 53, seed])
        last = self.model.seconds - _SILENCE - 10
        changes: NDArray[np.int64] = np.empty(0, np.int64)
        while not len(changes):
            walked = walk(radio, rng)
            changes = np.flatnonzero(np.diff(walked.floor[: last + 30]))
        start = int(np.clip(changes[0] - 30, 20, last))
        silent = np.zeros(len(walked.xy), np.bool_)
        silent[start : start + _SILENCE] = True
        seconds = seconds_of(walked, radio_map, silent)
        return _returns(site, radio_map, walked, seconds, seed, start + _SILENCE, {})


def _returns(
    site: Site,
    radio_map: InterpolatedMap,
    walked: Walk,
    seconds: Sequence[Second],
    seed: int,
    at: int,
    where: dict[int, tuple[float, float, int]],
) -> list[float]:
    """Seconds from ``at`` until each of `_RECOVERING` is back on the track; infinite where it is not."""
    c = Config()
    tracks = (
        sepf(site, radio_map, seconds, c, seed, where),
        sepf(site, radio_map, seconds, replace(c, recovery=True), seed, where),
        pf_mcl(site, radio_map, seconds, c, seed, where),
    )
    return [_back_after(said, walked, at) for said in tracks]


def _back_after(said: Said, walked: Walk, at: int) -> float:
    good = (np.hypot(*(said.xy - walked.xy).T) <= _BACK) & (said.floor == walked.floor)
    runs = np.convolve(good[at:].astype(np.int64), np.ones(_BACK_FOR, np.int64), "valid")
    first = np.flatnonzero(runs == _BACK_FOR)
    return float(first[0]) if len(first) else np.inf


def survey_of(radio: Radio) -> Survey:
    """The samples of all training places."""
    p, n, a = radio.samples.shape
    xy, floor = np.repeat(radio.survey_xy, n, axis=0), np.repeat(radio.survey_floor, n)
    names = tuple(storey.name for storey in radio.building.storeys)
    return Survey.from_dense(radio.samples.reshape(p * n, a), xy, floor, names)


def seconds_of(walked: Walk, radio_map: InterpolatedMap, silent: BoolArray | None = None) -> list[Second]:
    """What a filter is given: H(t), S(t), E(t) and scans; nothing in the silent seconds (t,)."""
    vertical = {**_climbs(walked), **_rides(walked)}
    riding = np.cumsum(np.abs(walked.rides)) > np.cumsum(walked.stops != 0)
    on_floor = ~(walked.on_stairs | riding | (walked.stops != 0))
    out = []
    for t, (dx, dy) in enumerate(walked.moved.tolist()):
        step = StepInput(float(np.hypot(dx, dy)), float(np.arctan2(dy, dx))) if on_floor[t] else None
        heard = np.flatnonzero(np.isfinite(walked.levels[t]))
        levels = walked.levels[t, heard].astype(np.float32)
        scan = Fingerprint(radio_map.bssid[heard], levels, np.zeros(len(heard), np.int32))
        out.append(Second(step, vertical.get(t, ()), scan))
    if silent is None:
        return out
    nothing = Second(None, (), None)
    return [nothing if gone else second for second, gone in zip(out, silent, strict=True)]


def _climbs(walked: Walk) -> dict[int, tuple[VerticalEvent, ...]]:
    """S(t): the stairs counted so far, at each second of a climb; the last report ends it."""
    edges = np.flatnonzero(np.diff(walked.on_stairs.astype(np.int64), prepend=0, append=0))
    out: dict[int, tuple[VerticalEvent, ...]] = {}
    for start, stop in edges.reshape(-1, 2).tolist():
        counted = np.cumsum(walked.stairs[start:stop])
        for k in np.flatnonzero(counted).tolist():
            n, t, is_over = int(counted[k]), start + k, start + k == stop - 1
            sigma = max(0.3, RISER * float(np.sqrt(abs(n))))
            ended = float(t) if is_over else np.nan
            out[t] = (
                VerticalEvent(
                    float(t), float(start), Behaviour.STAIRS, n * RISER, sigma, abs(n), is_over, ended, False
                ),
            )
    return out


def _rides(walked: Walk) -> dict[int, tuple[VerticalEvent, ...]]:
    """E(t): up or down as a ride begins, the number of floors as it ends."""
    out: dict[int, tuple[VerticalEvent, ...]] = {}
    began = 0
    for t in np.flatnonzero(walked.rides | walked.stops).tolist():
        if walked.rides[t]:
            began, rise = t, 0.3 * float(walked.rides[t])
        else:
            rise = FLOOR_HEIGHT * float(walked.stops[t])
        is_over = bool(walked.stops[t])
        ended = float(t) if is_over else np.nan
        out[t] = (VerticalEvent(float(t), float(began), Behaviour.LIFT, rise, 0.5, 0, is_over, ended, False),)
    return out


def reproduce_building(
    seeds: Sequence[int], mapper: Mapper, experiment: Experiment | None = None
) -> Reproduction:
    """Chapter 5 and recovery, with each seed."""
    runs = list(mapper(experiment or Experiment(), seeds, "chu2009, building"))
    error, floor = np.array([run.error for run in runs]), np.array([run.floor for run in runs])
    back = np.array([run.back for run in runs])  # seed, scenario, method
    lost = np.sum([run.lost for run in runs], axis=0)
    said = tuple(
        f"chapter 5, {method}: {n} of {len(runs)} runs ended lost"
        for method, n in zip(_METHODS, lost, strict=True)
        if n
    )
    tables = (_errors(error, floor), *(_recovery(back[:, s], name) for s, name in enumerate(_SCENARIOS)))
    return Reproduction("chu2009", tuple(seeds), tables, _bars(error, back), said, _curves(back))


def _errors(error: Array, floor: Array) -> Table:
    rows = [
        (
            method,
            f"{PRINTED[method]:.2f}" if method in PRINTED else "",
            mean_interval(error[:, m]),
            float(error[:, m].mean() / error[:, 0].mean()),
            f"{100.0 * floor[:, m].mean():.1f} %",
        )
        for m, method in enumerate(_METHODS)
    ]
    return Table(
        "Chapter 5: the building of three floors",
        ("method", "thesis (m)", "mean error (m)", "over NNSS", "right floor"),
        tuple(rows),
        "Horizontal error. The noise, the attenuation of walls and the errors of the sensors were chosen with the "
        "three figures of the thesis in view (F), on other seeds.",
    )


def _recovery(back: Array, scenario: str) -> Table:
    rows = []
    for m, method in enumerate(_RECOVERING):
        shares = [f"{100.0 * np.mean(back[:, m] <= limit):.0f} %" for limit in _WITHIN]
        middle = float(np.quantile(back[:, m], 0.5, method="higher"))
        rows.append((method, *shares, f"{middle:.0f}" if np.isfinite(middle) else "never"))
    columns = ("method", *(f"back within {limit} s" for limit in _WITHIN), "median (s)")
    note = f"Back: within {_BACK:g} m on the right floor for {_BACK_FOR} s on end."
    return Table(f"Recovery: {scenario}", columns, tuple(rows), note)


def _bars(error: Array, back: Array) -> tuple[Bar, ...]:
    mean = error.mean(axis=0)
    printed = np.array(list(PRINTED.values()))
    bars = []
    for a, b in ((1, 0), (2, 0), (2, 1)):
        what, ratio = f"{_METHODS[a]} over {_METHODS[b]}", float(mean[a] / mean[b])
        paper = float(printed[a] / printed[b])
        low, high = (round(paper * (1.0 + sign * _TOLERANCE), 3) for sign in (-1.0, 1.0))
        bars.append(at_most(f"chapter 5, {what}", 1.0, ratio, "of", strict=True))
        bars.append(within(f"chapter 5, {what}, 25 %", low, high, ratio, "of"))
    for s, scenario in enumerate(_SCENARIOS):
        share = float(np.mean(back[:, s, 1] <= _WITHIN[1]))
        bars.append(at_least(f"PFMM with recovery, {scenario}: back within 60 s", 0.9, share, "%"))
    cost = float(mean[4] / mean[2])
    return (*bars, at_most("chapter 5, PFMM with recovery over PFMM", 1.05, cost, "of"))


def _curves(back: Array) -> tuple[Curve, ...]:
    at = np.arange(float(_WATCHED + 1))
    return tuple(
        Curve(
            PICTURE,
            scenario,
            method,
            tuple(at.tolist()),
            tuple(np.mean(back[:, s, m, None] <= at, axis=0).tolist()),
        )
        for s, scenario in enumerate(_SCENARIOS)
        for m, method in enumerate(_RECOVERING)
    )
