"""he2014: Table 1 (access points against error) and Figure 12 (motion model in a sparse room), in a ray-traced room."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from wayfuse.core.philox import Noise
from wayfuse.core.types import Array
from wayfuse.evaluation.results_bars import Bar, at_least, at_most, within
from wayfuse.evaluation.results_folds import Mapper
from wayfuse.models.motion.adaptive import Walked
from wayfuse.papers.reproduction import Interval, Reproduction, Table, mean_interval
from wayfuse.presets import he2014
from wayfuse.radio.gp_field import GpField, fit_gp_field
from wayfuse.simulator.he2014_world import Room, sense, strength, survey_places, true_walk

__all__ = ["SEEDS", "reproduce"]

SEEDS = 40
TABLE_1 = (14.8, 7.4, 6.5, 3.8)  # m, for 1 to 4 access points
_TOLERANCE = 0.25
_KNOWN_START_BAR = 2.0  # m
_LOST = 10.0  # m at the last epoch
_EPOCHS = (1, 5, 10, 15, 20, 27)  # of Figure 12
NONE, NEAREST, KNOWN = range(3)  # no motion model; motion model from the k-NN start; from the true start
_ROWS = ("no motion model", "motion model, k-NN start", "motion model, true start")

ROOM = Room()
CONFIG = he2014.Config()
# what the paper does not print, changed one by one; no motion model
VARIANTS = {
    "coherent sum": (replace(ROOM, coherent=True), CONFIG),
    "1 reflection": (replace(ROOM, reflections=1), CONFIG),
    "3 reflections": (replace(ROOM, reflections=3), CONFIG),
    "noise 1.5 dB": (replace(ROOM, noise_db=1.5), CONFIG),
    "noise 3 dB": (replace(ROOM, noise_db=3.0), CONFIG),
    "survey as noisy as the walk": (replace(ROOM, survey_noise_db=ROOM.noise_db), CONFIG),
    "least noise of the process 0.1 dB": (ROOM, replace(CONFIG, least_noise=0.1)),
    "k = 1": (ROOM, replace(CONFIG, k=1)),
}
EXACT = replace(ROOM, length_sigma=0.0, compass_sigma=0.0, yaw_sigma=0.0)
_Row = tuple[str | float | Interval, ...]


class _Run(NamedTuple):
    """Errors of one seed: error (ways, n_ap, epochs) m, mean over first access points; lost and runs (ways, n_ap)."""

    error: Array
    lost: Array
    runs: Array


def _sets(n: int) -> Iterator[tuple[int, ...]]:
    # every access point in turn as the first of n; all four are one set
    for first in range(4 if n < 4 else 1):
        yield tuple((first + i) % 4 for i in range(n))


def _fit(room: Room, survey: Array, least_noise: float) -> GpField:
    extent = (0.0, 0.0, *room.size[:2])
    return fit_gp_field(survey_places(room), survey, extent, least_noise=least_noise)


@lru_cache(maxsize=2)  # all seeds of a room share them
def _clean(room: Room, least_noise: float) -> tuple[Array, Array, GpField]:
    # strengths at the survey places (n, a) and on the walk (T + 1, a), and the field of a survey without noise
    survey = strength(room, survey_places(room))
    return survey, strength(room, true_walk(room).xy), _fit(room, survey, least_noise)


@dataclass(frozen=True, slots=True)
class _Worker:
    """Runs one seed in a room, for 1 to 4 access points; travels to the worker processes."""

    room: Room
    config: he2014.Config
    ways: tuple[int, ...] = (NONE,)

    def __call__(self, seed: int) -> _Run:
        room, walk, places = self.room, true_walk(self.room), survey_places(self.room)
        config = self.config
        rng = np.random.default_rng([seed, 2014])
        survey, on_walk, field = _clean(room, config.least_noise)
        sensed = sense(room, survey, on_walk, walk, rng)
        if room.survey_noise_db > 0.0:
            field = _fit(room, sensed.survey, config.least_noise)
        heading = he2014.headings(sensed.compass, sensed.yaw)
        moves = [Walked(*move) for move in zip(sensed.length.tolist(), heading.tolist(), strict=True)]
        error = np.zeros((len(self.ways), 4, len(walk.xy)))
        lost, runs = np.zeros((2, len(self.ways), 4))
        for n in range(1, 5):
            for aps in _sets(n):
                z, part = sensed.rssi[:, aps], field.select(aps)
                nearest = he2014.nearest_start(config, places, sensed.survey[:, aps], z[0])
                for w, way in enumerate(self.ways):
                    start = walk.xy[0] if way == KNOWN else nearest
                    used = [None] * len(moves) if way == NONE else moves
                    noise = Noise.of(seed, f"he2014 {way} {aps}")
                    found = he2014.track(config, part, z, start, used, noise)
                    error[w, n - 1] += np.hypot(*(found - walk.xy).T)
                    lost[w, n - 1] += np.hypot(*(found[-1] - walk.xy[-1])) > _LOST
                    runs[w, n - 1] += 1
        return _Run(error / runs[..., None], lost, runs)


def reproduce(seeds: Sequence[int], mapper: Mapper) -> Reproduction:
    """Table 1 and Figure 12 with each seed."""
    runs = list(mapper(_Worker(ROOM, CONFIG, (NONE, NEAREST, KNOWN)), seeds, "he2014"))
    error = np.array([run.error for run in runs])  # (seeds, ways, n_ap, epochs)
    mean = error[..., 1:].mean(axis=3)  # a start that is told is no achievement
    exact = np.array(
        [run.error for run in mapper(_Worker(EXACT, CONFIG, (NEAREST,)), seeds, "he2014, exact moves")]
    )
    variants = {}
    for name, (room, config) in VARIANTS.items():
        found = mapper(_Worker(room, config), seeds, f"he2014, {name}")
        variants[name] = np.array([run.error for run in found])[:, 0, :, 1:].mean(axis=2)
    tables = (_table_1(mean, exact[:, 0, :, 1:].mean(axis=2)), _figure_12(error), _open_parameters(variants))
    return Reproduction("he2014", tuple(seeds), tables, _bars(mean), _lost(runs))


def _table_1(mean: Array, exact: Array) -> Table:
    rows: list[_Row] = [("paper, no motion model", *TABLE_1)]
    rows += [(name, *(mean_interval(mean[:, w, n]) for n in range(4))) for w, name in enumerate(_ROWS)]
    rows.append(("motion model, k-NN start, exact moves", *(mean_interval(exact[:, n]) for n in range(4))))
    return Table(
        "Table 1: mean error (m) by number of access points",
        ("", "1", "2", "3", "4"),
        tuple(rows),
        "The noise of 2.2 dB was fitted to the whole row without a motion model (F); the paper prints no figures "
        "for the other rows.",
    )


def _figure_12(error: Array) -> Table:
    rows: list[_Row] = [
        (name, *(mean_interval(error[:, w, 0, epoch]) for epoch in _EPOCHS)) for w, name in enumerate(_ROWS)
    ]
    return Table(
        "Figure 12: error (m) at an epoch, one access point",
        ("", *(f"epoch {epoch}" for epoch in _EPOCHS)),
        tuple(rows),
        "The paper's text gives no figures for its curves. That the motion model helps follows for the true start (T).",
    )


def _open_parameters(variants: dict[str, Array]) -> Table:
    rows: list[_Row] = [("paper", *TABLE_1)]
    rows += [(name, *(mean_interval(v[:, n]) for n in range(4))) for name, v in variants.items()]
    return Table(
        "What the paper leaves open, changed one by one: mean error (m), no motion model",
        ("", "1", "2", "3", "4"),
        tuple(rows),
    )


def _bars(mean: Array) -> tuple[Bar, ...]:
    by_row = mean.mean(axis=0)
    bars = []
    for n, printed in enumerate(TABLE_1):
        low, high = (printed * (1.0 + sign * _TOLERANCE) for sign in (-1, 1))
        bars.append(within(f"Table 1, {n + 1} AP, 25 %", round(low, 3), round(high, 3), by_row[NONE, n], "m"))
    for n in range(3):
        gap = float(by_row[NONE, n + 1] - by_row[NONE, n])
        bars.append(
            at_most(f"Table 1, error with {n + 2} less that with {n + 1} AP", 0.0, gap, "m", strict=True)
        )
    for n in range(4):
        error = float(by_row[KNOWN, n])
        bars.append(at_most(f"true start, {n + 1} AP", _KNOWN_START_BAR, error, "m", strict=True))
    for n in range(4):
        gain = mean_interval(mean[:, NONE, n] - mean[:, NEAREST, n])
        what = f"k-NN start, {n + 1} AP: gain by the motion model"
        bars.append(
            at_least(what, 0.0, gain.value, "m", low=gain.low)
            if n >= 2
            else at_most(what, 0.0, gain.value, "m")
        )
    return tuple(bars)


def _lost(runs: Sequence[_Run]) -> tuple[str, ...]:
    lost = np.sum([run.lost for run in runs], axis=0)
    total = np.sum([run.runs for run in runs], axis=0)
    return tuple(
        f"{name}, {n + 1} AP: {lost[w, n]:.0f} of {total[w, n]:.0f} runs end more than {_LOST:g} m away"
        for w, name in enumerate(_ROWS)
        for n in range(4)
    )
