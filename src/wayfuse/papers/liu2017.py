"""liu2017: the table of Section IV and the sweeps of Figures 5 to 7, paper against ours."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from wayfuse.core.types import Array
from wayfuse.evaluation.results_bars import Bar, at_least, at_most, within
from wayfuse.evaluation.results_folds import Mapper
from wayfuse.formats.datasets import data_root
from wayfuse.papers.liu2017_real import real_tables
from wayfuse.papers.reproduction import Reproduction, Table, mean_interval
from wayfuse.presets.liu2017 import (
    Config,
    Motion,
    Pose,
    dead_reckoning,
    fingerprint_neighbours,
    fused,
    sequence_neighbours,
    wifi_alone,
)
from wayfuse.simulator.liu2017_world import Office, Survey, Walk, World, office, survey, walk

__all__ = ["SEEDS", "Runs", "reproduce"]

SEEDS = 20
_PAPER = {"wifi": 5.22, "imu": 27.5, "fused": 2.67, "fingerprints": 2.35}  # m, Sec. IV-B and IV-E
_LOST_M, _LOST_S = 10.0, 60.0  # a run is lost whose last minute is further off than this on average
_PRINTED = Config(bandwidth_divides=True)
_STEP_LENGTHS = (0.5, 0.6, 0.7, 0.8, 0.9)  # m, Fig. 6(b)
_COUNTS = (10, 30, 100, 1000, 3000)  # Fig. 6(a)
_BANDWIDTHS = (0.001, 0.003, 0.01, 0.03, 0.1, 1.0)  # Fig. 6(a)
_DISTANCE_SIGMAS = (0.1, 0.2, 0.4, 0.8, 1.2)  # Fig. 5(c)
_TURN_SIGMAS = (0.001, 0.01, 0.1, 0.3)  # Fig. 5(c)
_NEIGHBOURS = (1, 4, 16, 32)  # Fig. 6(c)
_EVERY = (1, 2, 4, 8)  # Fig. 7: 1/2, 1/4, 1/8, 1/16 Hz
_FAST = World(speed_factor=1.3)  # 1.01 m/s, Sec. IV-F; at 1.00 m/s a lap would be 27 scans, see its page
_OTHER_PHONE = World(device_sigma=3.0)  # ours: nothing is printed of how the phones differ


@dataclass(frozen=True, slots=True)
class _Scene:
    """One simulated walk with what belongs to it."""

    world: World
    place: Office
    walked: Walk
    surveyed: Survey
    seed: int

    @property
    def motion(self) -> Motion:
        return Motion(self.walked.step_count, self.walked.orientation)

    @property
    def start(self) -> Pose:
        x, y = self.walked.truth[0]
        return Pose(float(x), float(y), float(self.walked.heading[0]))

    def errors(self, estimates: Array) -> Array:
        """(T,) m."""
        return np.asarray(np.linalg.norm(estimates - self.walked.truth, axis=1))

    def by_sequences(self, config: Config) -> Array:
        extent = (0.0, 0.0, *self.world.size)
        scans = sequence_neighbours(self.place.ap_xy, extent, self.walked.rssi, config)
        return self.errors(fused(self.motion, self.start, scans, self.seed, config))

    def by_fingerprints(self, config: Config) -> Array:
        surveyed = self.surveyed
        scans = fingerprint_neighbours(surveyed.xy, surveyed.rssi, self.walked.rssi, config)
        return self.errors(fused(self.motion, self.start, scans, self.seed, config))

    def by_wifi(self, config: Config) -> Array:
        extent = (0.0, 0.0, *self.world.size)
        scans = sequence_neighbours(self.place.ap_xy, extent, self.walked.rssi, config)
        return self.errors(wifi_alone(self.start, scans, self.seed, config))

    def by_steps(self, config: Config) -> Array:
        return self.errors(dead_reckoning(self.motion, self.start, config))


def _scene(world: World, seed: int) -> _Scene:
    rng = np.random.default_rng([2017, seed])
    place = office(world, rng)
    walked = walk(world, place, rng)
    return _Scene(world, place, walked, survey(world, place, rng), seed)


@dataclass(frozen=True, slots=True)
class Runs:
    """All runs of one seed. sweeps : run those of Figures 5 to 7 too."""

    sweeps: bool = True

    def __call__(self, seed: int) -> dict[str, tuple[float, bool]]:
        """Mean error (m) of each run by its name, and whether it was lost at the end."""
        scene = _scene(World(), seed)
        errors = _main(scene)
        if self.sweeps:
            errors |= _sweeps(scene)
        return {name: (float(e.mean()), _is_lost(e, scene.world.period)) for name, e in errors.items()}


def _is_lost(errors: Array, period: float) -> bool:
    return bool(errors[-int(_LOST_S / period) :].mean() > _LOST_M)


def _main(scene: _Scene) -> dict[str, Array]:
    multiplies = Config()
    found = {"imu": scene.by_steps(multiplies)}
    for suffix, config in (("", multiplies), (" printed", _PRINTED)):
        found["wifi" + suffix] = scene.by_wifi(config)
        found["fused" + suffix] = scene.by_sequences(config)
        found["fingerprints" + suffix] = scene.by_fingerprints(config)
    return found


def _sweeps(scene: _Scene) -> dict[str, Array]:
    base = Config()
    configs = {f"s {s}": replace(base, step_length=s) for s in _STEP_LENGTHS}
    configs |= {f"N {n}": replace(base, n_particles=n) for n in _COUNTS}
    configs |= {f"lambda {v}": replace(base, bandwidth=v) for v in _BANDWIDTHS}
    configs |= {f"sigma_d {v}": replace(base, distance_sigma=v) for v in _DISTANCE_SIGMAS}
    configs |= {f"sigma_theta {v}": replace(base, turn_sigma=v) for v in _TURN_SIGMAS}
    configs |= {f"{cell} m, k {k}": replace(base, cell=cell, k=k) for cell in (2.0, 1.0) for k in _NEIGHBOURS}
    configs |= {f"every {n}": replace(base, scan_every=n) for n in _EVERY}
    found = {name: scene.by_sequences(config) for name, config in configs.items()}
    for k in _NEIGHBOURS:
        found[f"fingerprints, k {k}"] = scene.by_fingerprints(replace(base, k=k))
    for name, world in (("fast", _FAST), ("other phone", _OTHER_PHONE)):
        found[name] = _scene(world, scene.seed).by_sequences(base)
    return found


def reproduce(seeds: Sequence[int], mapper: Mapper) -> Reproduction:
    """Run the experiments of Section IV with each seed, and those on real data where present."""
    runs = list(mapper(Runs(), list(seeds), "liu2017"))
    errors = {name: np.array([run[name][0] for run in runs]) for name in runs[0]}
    lost = {name: sum(run[name][1] for run in runs) for name in runs[0]}
    tables = (_main_table(errors), *_sweep_tables(errors), *real_tables(data_root(), mapper))
    lines = tuple(f"{name}: {n} of {len(runs)} runs" for name, n in lost.items() if n)
    return Reproduction("liu2017", tuple(seeds), tables, _bars(errors), lines)


_Errors = Mapping[str, Array]


def _main_table(errors: _Errors) -> Table:
    labels = {
        "wifi": "Wi-Fi alone (F)",
        "imu": "IMU alone (F)",
        "fused": "fused (T?)",
        "fingerprints": "fingerprints (T?)",
    }
    rows = []
    for name, label in labels.items():
        printed = errors["imu" if name == "imu" else f"{name} printed"]
        rows.append((label, _PAPER[name], mean_interval(errors[name]), mean_interval(printed)))
    note = (
        "Mean error, m. F: the random walk of Wi-Fi alone and the distortion of the compass were fitted to these rows. "
        "T?: these follow, but the kind of distortion, the grid of access points and the surveyed places were chosen "
        "with them in view."
    )
    return Table(
        "Section IV",
        ("row", "paper", "lambda multiplies", "lambda divides (Eq. 3 as printed)"),
        tuple(rows),
        note,
    )


def _sweep(title: str, errors: _Errors, first: str, names: Mapping[str, str], note: str) -> Table:
    """One row per setting: our words, the paper's figure or words, ours."""
    rows = tuple((name, said, mean_interval(errors[name])) for name, said in names.items())
    return Table(title, (first, "paper", "ours"), rows, note)


def _sweep_tables(errors: _Errors) -> tuple[Table, ...]:
    def words(keys: Sequence[str], said: Mapping[str, str]) -> dict[str, str]:
        return {key: said.get(key, "") for key in keys}

    best = "best"
    sigmas = [f"sigma_d {v}" for v in _DISTANCE_SIGMAS] + [f"sigma_theta {v}" for v in _TURN_SIGMAS]
    particles = [f"N {n}" for n in _COUNTS] + [f"lambda {v}" for v in _BANDWIDTHS]
    cells = [f"{c} m, k {k}" for c in (2.0, 1.0) for k in _NEIGHBOURS] + [
        f"fingerprints, k {k}" for k in _NEIGHBOURS
    ]
    said = {"2.0 m, k 4": "2.67, best", "1.0 m, k 32": "2.55, best", "fingerprints, k 4": "2.35, best"}
    field = {
        "every 1": "2.67",
        "fast": "worse",
        "other phone": "2.85",
        **{f"every {n}": "worse" for n in _EVERY[1:]},
    }
    return (
        _sweep("Figure 5(c)", errors, "noise", words(sigmas, {"sigma_d 0.4": best, "sigma_theta 0.01": best}),
               "No bar. A greater sigma_d than the paper's is better here."),
        _sweep("Figure 6(a)", errors, "particles, lambda", words(particles, {"N 1000": "as more", "lambda 0.01": best}),
               "No bar on lambda: multiplying, the best kernel is narrower than the 10 m of the paper's lambda."),
        _sweep("Figure 6(b)", errors, "step length", words([f"s {s}" for s in _STEP_LENGTHS], {"s 0.7": best}),
               "True step length 0.7 m."),
        _sweep("Figure 6(c)", errors, "cell and k", words(cells, said), "No bar."),
        _sweep("Figure 7", errors, "run", field,
               "every n: one scan in n (1/2 to 1/16 Hz); fast: 1.0 m/s; other phone: 3 dB between access points."),
    )  # fmt: skip


def _bars(errors: _Errors) -> tuple[Bar, ...]:
    m = {name: float(values.mean()) for name, values in errors.items()}
    near = {"wifi": 0.10, "imu": 0.05, "fused": 0.15, "fingerprints": 0.10}
    rows = [
        within(f"{name}, mean error", _PAPER[name] * (1.0 - p), _PAPER[name] * (1.0 + p), m[name], "m")
        for name, p in near.items()
    ]
    rates = [m[f"every {n}"] for n in _EVERY]
    others = min(m[f"s {s}"] for s in _STEP_LENGTHS if s != World().step_length)
    return (
        *rows,
        at_most("fingerprints - fused", 0.0, m["fingerprints"] - m["fused"], "m", strict=True),
        at_most("fused / Wi-Fi alone", 0.6, m["fused"] / m["wifi"], "", strict=True),
        at_least("least gain of a doubled Wi-Fi rate", 0.0, float(np.diff(rates).min()), "m"),
        at_least("gain of 100 particles on 10", 0.0, m["N 10"] - m["N 100"], "m"),
        within("3000 particles / 1000", 0.9, 1.1, m["N 3000"] / m["N 1000"], ""),
        at_least("any other step length - the true one", 0.0, others - m["s 0.7"], "m"),
    )
