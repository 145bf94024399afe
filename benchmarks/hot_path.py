"""A whole filter update against NumPy, the way repositories write it, and the filters of other libraries.

    python -m benchmarks.hot_path [--seconds 20]

A: step, ten ranges, effective sample size, moments, systematic resampling; no walls, for none of the others has them.
B: the same with 500 walls. All variants walk the same round with the same observations, each with random numbers of its
own; the error of each is shown, for a fast filter that loses the person is worth nothing.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from importlib.util import find_spec
from itertools import cycle
from typing import Any

import numpy as np

from benchmarks.naive_filter import NaiveFilter
from benchmarks.numpy_filter import (
    NumpyFilter,
    brute_walls,
    likelihood_of_levels,
    likelihood_of_ranges,
    raster_walls,
    start_of,
)
from benchmarks.peer_filters import PEER_FILTERS
from benchmarks.report import Table, Target, ratio
from benchmarks.timing import race
from benchmarks.world import MAP_STEP, RANGE_SIGMA, Moment, World, made_up
from wayfuse.core.philox import track_key
from wayfuse.core.types import Array
from wayfuse.filters.cloud import Cloud
from wayfuse.maps.walls import WallIndex
from wayfuse.models.track_batch import BatchModel, Seen, TrackBatch
from wayfuse.radio.level_table import LevelTable

__all__ = ["OurFilter", "batch_of", "measure", "model_of"]

Update = Callable[[Moment], Any]
SIZES = (500, 1000, 4000)
GOALS_A = {"NumPy": 10.0, "particles": 15.0, "pfilter": 20.0, "stonesoup": 60.0}


def model_of(world: World, *, walls: bool) -> BatchModel:
    """The models of the benchmarks as wayfuse has them."""
    levels = LevelTable.of((0.0, 0.0), MAP_STEP, world.mean, world.sigma)
    index = WallIndex.build(world.walls) if walls else None
    return BatchModel(anchors=world.anchors, range_sigma=RANGE_SIGMA, walls=index, levels=levels)


def batch_of(cloud: Array, tracks: int = 1) -> TrackBatch:
    """So many tracks that begin with the same cloud (4, n)."""
    one = Cloud.on_floors(*cloud.astype(np.float32), np.zeros(cloud.shape[1], np.int32))
    return TrackBatch.of([one] * tracks, [track_key(0, str(u)) for u in range(tracks)])


class OurFilter:
    """One track, ticked with ranges or with readings ("levels"); what it takes is written into arrays of its own."""

    def __init__(self, model: BatchModel, batch: TrackBatch, kind: str):
        self.model, self.batch, self.kind = model, batch, kind
        self.track, self.step = np.zeros(1, np.int64), np.empty((1, 2), np.float32)
        self.ranges = np.empty((1, len(model.anchors)), np.float32)
        self.seen = Seen(ranges=self.ranges)
        self.resampled = 0

    def update(self, moment: Moment) -> Array:
        """One step and one observation; the mean place (2,)."""
        seen = self.seen
        if self.kind == "ranges":
            self.ranges[0] = moment.ranges
        else:
            seen = Seen(scans=moment.scan[None])
        self.step[0, 0], self.step[0, 1] = moment[0], moment[1]
        out = self.model.tick(self.batch, self.track, self.step, seen)[0]
        self.resampled += int(out[7])
        return out[:2]


def measure(seconds: float) -> tuple[list[Table], list[Target]]:
    """Tables of A and B, and their goals."""
    world, targets = made_up(), []
    rows_a: list[tuple[str | float, ...]] = []
    rows_b: list[tuple[str | float, ...]] = []
    for n in SIZES:
        cloud = start_of(world, n)
        ranges, levels = likelihood_of_ranges(world), likelihood_of_levels(world)
        raster, brute = raster_walls(world), brute_walls(world)
        free, bounded = model_of(world, walls=False), model_of(world, walls=True)
        a: dict[str, Update] = {
            "wayfuse": OurFilter(free, batch_of(cloud), "ranges").update,
            "NumPy": NumpyFilter(cloud, ranges).update,
            **{name: PEER_FILTERS[name](world, cloud) for name in PEER_FILTERS if find_spec(name)},
        }
        b: dict[str, Update] = {
            "wayfuse, ranges": OurFilter(bounded, batch_of(cloud), "ranges").update,
            "ranges, NumPy raster walls": NumpyFilter(cloud, ranges, raster).update,
            "wayfuse, levels": OurFilter(bounded, batch_of(cloud), "levels").update,
            "levels, NumPy raster walls": NumpyFilter(cloud, levels, raster).update,
        }
        if n == 1000:
            b["ranges, NumPy exact walls"] = NumpyFilter(cloud, ranges, brute).update
            b["ranges, loop over particles, shapely"] = NaiveFilter(cloud, world, walls=True).update
        share = seconds / len(SIZES)
        ratios_a = _rows(n, "A", a, world, share * 0.5, rows_a)
        ratios_b = _rows(n, "B", b, world, share * 0.5, rows_b)
        if n == 1000:
            targets += [
                Target(f"A, {name}, N = 1000", goal, ratios_a.get(name)) for name, goal in GOALS_A.items()
            ]
            targets += [
                Target("B, ranges, NumPy raster walls", 8.0, ratios_b["ranges, NumPy raster walls"]),
                Target("B, ranges, NumPy exact walls", 250.0, ratios_b["ranges, NumPy exact walls"]),
                Target(
                    "B, 30 access points, NumPy raster walls", 15.0, ratios_b["levels, NumPy raster walls"]
                ),
            ]
    columns = ("N", "variant", "us", "ratio", "mean error m", "resampled")
    note = (
        "One track through `BatchModel.tick`, checks of arguments included. Resampled: share of updates; the others "
        "that do not say are asked for the same threshold, half of N."
    )
    return [
        Table("A: step, ten ranges, resampling, moments; no walls", note, columns, tuple(rows_a)),
        Table(
            "B: the same with 500 walls",
            "Levels: 30 access points whose mean and deviation are read bilinearly. The raster of 0.1 m is not exact: "
            "it fattens walls. Exact walls: every move against every wall.",
            columns,
            tuple(rows_b),
        ),
    ], targets


def _rows(
    n: int,
    name: str,
    variants: dict[str, Update],
    world: World,
    seconds: float,
    rows: list[tuple[str | float, ...]],
) -> dict[str, float]:
    """Race variants on the round of the world; rows are added, the ratios of the minima returned."""
    errors: dict[str, list[float]] = {v: [] for v in variants}

    def walked(variant: str, update: Update) -> Callable[[], None]:
        moments = cycle(world.moments)

        def run() -> None:
            moment = next(moments)
            mean = np.ravel(update(moment))
            errors[variant].append(float(np.hypot(mean[0] - moment.place[0], mean[1] - moment.place[1])))

        return run

    taken = race({v: walked(v, update) for v, update in variants.items()}, seconds=seconds, least_turns=3)
    ratios = {}
    for variant, t in taken.items():
        base = variant if variant.startswith("wayfuse") else "wayfuse"
        if name == "B" and base == "wayfuse":
            base = f"wayfuse, {variant.partition(',')[0]}"
        ours = taken[base]
        ratios[variant] = t.least / ours.least
        owner = getattr(variants[variant], "__self__", None)
        share = f"{owner.resampled / len(errors[variant]):.0%}" if hasattr(owner, "resampled") else ""
        shown = "" if base == variant else f"{ratio(t.least, ours.least)} ({ratio(t.median, ours.median)})"
        cell = f"{t.least * 1e6:,.1f} ({t.median * 1e6:,.1f})"
        rows.append((str(n), variant, cell, shown, f"{np.mean(errors[variant]):.2f}", share))
    return ratios


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seconds", type=float, default=20.0)
    tables, targets = measure(parser.parse_args().seconds)
    for table in tables:
        print(table.title)
        for row in table.rows:
            print("  ", *(f"{c!s:<40}" if i == 1 else f"{c!s:<22}" for i, c in enumerate(row)))
    for t in targets:
        print(t.name, t.goal, t.got, t.verdict)


if __name__ == "__main__":
    main()
