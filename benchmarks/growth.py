"""How the cost of an update grows: particles, walls, access points, reference places, tracks; and memory.

python -m benchmarks.growth [--seconds 20]
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from itertools import cycle

import numpy as np

from benchmarks.hot_path import batch_of, model_of
from benchmarks.numpy_filter import start_of
from benchmarks.report import Table, Target
from benchmarks.timing import Taken, race
from benchmarks.world import World, made_up
from wayfuse.maps.walls import WallIndex
from wayfuse.models.track_batch import Seen
from wayfuse.radio.ap_sequence import from_positions
from wayfuse.radio.gaussian_process import fit
from wayfuse.radio.survey import Survey

__all__ = ["measure"]

PARTICLES = (100, 250, 500, 1000, 2000, 4000, 16_000, 100_000)
WALLS = (50, 500, 5_000, 20_000)
APS = (5, 10, 15, 16, 17, 30, 32, 33, 100, 300)
PLACES = (100, 1_000, 10_000, 100_000)
TRACKS = (1, 10, 100, 1_000, 4_000)
Run = Callable[[], object]


def ticked(world: World, n: int, tracks: int, *, walls: bool, kind: str = "ranges") -> Run:
    """One tick of so many tracks of n particles."""
    model, batch = model_of(world, walls=walls), batch_of(start_of(world, n), tracks)
    moments, rows = cycle(world.moments), np.arange(tracks)

    def run() -> object:
        m = next(moments)
        if kind == "ranges":
            seen = Seen(ranges=np.tile(m.ranges, (tracks, 1)))
        else:
            seen = Seen(scans=np.tile(m.scan, (tracks, 1)))
        return model.tick(batch, rows, np.tile(m[:2], (tracks, 1)), seen)

    return run


def measure(seconds: float) -> tuple[list[Table], list[Target]]:
    """A table per knob, one of memory, and the goal of the batch."""
    share = seconds / 6.0
    world = made_up()
    particles = race({str(n): ticked(world, n, 1, walls=True) for n in PARTICLES}, seconds=share)
    walls = race({f"{w:,}": ticked(made_up(w), 1000, 1, walls=True) for w in WALLS}, seconds=share)
    ranges = race({str(a): ticked(made_up(0, a), 1000, 1, walls=False) for a in APS}, seconds=share)
    levels = race(
        {str(a): ticked(made_up(0, 1, a), 1000, 1, walls=False, kind="levels") for a in APS}, seconds=share
    )
    places = race({f"{m:,}": similarity(m) for m in PLACES}, seconds=share)
    tracks = race({str(u): ticked(world, 1000, u, walls=True) for u in TRACKS}, seconds=share, least_turns=8)
    each = {u: Taken(t.least / int(u), t.median / int(u), t.turns) for u, t in tracks.items()}
    tables = [
        _table("Growth with particles", "Ranges and 500 walls, one track.", "N", particles, int),
        _table("Growth with walls", "On the same floor, N = 1000, ranges.", "walls", walls),
        _table("Growth with anchors", "Ranges, no walls, N = 1000.", "anchors", ranges),
        _table(
            "Growth with access points", "Levels, no walls, N = 1000; padded to 16.", "access points", levels
        ),
        _table("Growth with reference places", "Rank similarity of 30 access points.", "places", places),
        _table("Growth with tracks", "Ranges and 500 walls, N = 1000; per track.", "tracks", each),
        memory(),
    ]
    penalty = each["1000"].least / each["1"].least
    goals = [
        Target("1,000 tracks in a batch, time of a track against one alone", 1.05, penalty, less=True),
        Target(
            "tracks per core: 2 steps with ranges and walls a second",
            8000.0,
            0.5 / each["1000"].median,
            "tracks",
        ),
    ]
    return tables, goals


def similarity(places: int) -> Run:
    """The similarity of a scan with about so many places."""
    rng = np.random.default_rng(0)
    side = np.sqrt(places)
    ap_xy = rng.uniform(0.0, side, (30, 2))
    sequences = from_positions(ap_xy, (0.0, 0.0, float(np.ceil(side)), float(np.ceil(side))), 1.0)
    rssi = rng.uniform(-90.0, -40.0, 30)
    return lambda: sequences.similarity(rssi)


def memory() -> Table:
    """Bytes of what a server keeps."""
    rng = np.random.default_rng(0)
    world = made_up()
    batch = batch_of(start_of(world, 1000))
    track = batch.particles.nbytes + batch.log_weights.nbytes + batch.counters.nbytes
    index = WallIndex.build(world.walls)
    walls = sum(a.nbytes for a in index.arrays)
    levels = model_of(world, walls=False).levels.levels.nbytes
    ranks = from_positions(rng.uniform((0, 0), (80, 50), (30, 2)), (0.0, 0.0, 80.0, 50.0), 2.0)
    bits = ranks.orders.nbytes
    xy = rng.uniform((0.0, 0.0), (80.0, 50.0), (500, 2))
    survey = Survey.from_dense(rng.uniform(-90, -40, (500, 30)), xy, np.zeros(500, np.int32), ("0",))
    grid = fit(survey).grids[0]
    gp = sum(a.nbytes for a in (grid.mean, grid.sigma, grid.silence, grid.near, grid.total_silence))
    rows = (
        ("a track of 1,000 particles in a batch", f"{track / 1e3:,.1f} KB"),
        ("walls, 500 on 80 m x 50 m", f"{walls / 1e6:,.2f} MB"),
        ("levels, 30 access points, nodes 2 m apart on 80 m x 50 m", f"{levels / 1e6:,.2f} MB"),
        ("sequences, 30 access points, 1,000 places", f"{bits / 1e3:,.1f} KB"),
        (
            "survey, 500 fingerprints of 30 access points",
            f"{(survey.rssi.nbytes + survey.indices.nbytes) / 1e3:,.1f} KB",
        ),
        (f"Gaussian-process map of it, {len(grid.sigma):,} nodes", f"{gp / 1e6:,.2f} MB"),
    )
    return Table("Memory", "Arrays as they are held.", ("what", "size"), rows)


def _table(title: str, note: str, knob: str, taken: dict[str, Taken], per: type[int] | None = None) -> Table:
    columns = (knob, "us", *(("ns per particle",) if per else ()))
    rows = []
    for name, t in taken.items():
        cells = [name, f"{t.least * 1e6:,.1f} ({t.median * 1e6:,.1f})"]
        if per:
            cells.append(f"{t.least * 1e9 / per(name):.1f}")
        rows.append(tuple(cells))
    return Table(title, note, columns, tuple(rows))


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seconds", type=float, default=20.0)
    tables, goals = measure(parser.parse_args().seconds)
    for table in tables:
        print(table.title, *table.rows, sep="\n  ")
    print(*goals, sep="\n")


if __name__ == "__main__":
    main()
