"""How much faster is the exact wall index than testing every wall, in NumPy and compiled?

    python benchmarks/walls.py [--site SITE] [--moves 1000] [--rounds 12]

Without a site the map is a made-up arcade of shops. Variants take turns, each on the same few clouds of
moves in a row (a filter, too, asks again and again about one neighbourhood). Thread CPU time is taken;
minimum and median are printed with their ratio to the index. All variants must agree on every move.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from wayfuse.core.jit import kernel
from wayfuse.core.types import Array, BoolArray
from wayfuse.maps._kernels import brute_one
from wayfuse.maps.walls import WallIndex

STEP = 0.7  # m, a step
BLOCK = 5  # clouds in a row before the next variant has its turn
CHUNK = 128  # moves at a time, so that NumPy's intermediate arrays stay in the cache


def arcade(columns: int = 20, rows: int = 10) -> Array:
    """Walls (w, 4) m of shops 8 m by 6 m along alleys of 4 m."""
    walls = []
    for i in range(columns):
        for j in range(rows):
            x0, y0 = i * 8.0 + (i // 2) * 4.0, j * 6.0 + (j // 2) * 4.0
            x1, y1 = x0 + 8.0, y0 + 6.0
            walls += [[x0, y0, x1, y0], [x1, y0, x1, y1], [x0, y1, x1, y1], [x0, y0, x0, y1]]
    return np.unique(np.array(walls), axis=0)


def moves_of(rng: np.random.Generator, walls: Array, n: int, spread: bool) -> Array:
    """(4, n) m: steps of a cloud spread over the floor, or gathered within 5 m around one place."""
    low, high = walls[:, :2].min(axis=0), walls[:, 2:].max(axis=0)
    start = rng.uniform(low, high, (n, 2)) if spread else rng.normal(0.5 * (low + high), 5.0, (n, 2))
    angle, length = rng.uniform(0.0, 2.0 * np.pi, n), rng.normal(STEP, 0.1, n)
    return np.vstack([start.T, start.T + length * [np.cos(angle), np.sin(angle)]])


def _in_order(x0: Array, y0: Array, x1: Array, y1: Array) -> tuple[Array, Array, Array, Array]:
    swap = (x0 > x1) | ((x0 == x1) & (y0 > y1))
    return np.where(swap, x1, x0), np.where(swap, y1, y0), np.where(swap, x0, x1), np.where(swap, y0, y1)


def brute_numpy(walls: Array, moves: Array) -> BoolArray:
    """Every move against every wall, in vectorised NumPy."""
    ax, ay, bx, by = walls.T
    out = np.zeros(moves.shape[1], np.bool_)
    for i in range(0, moves.shape[1], CHUNK):
        px, py, qx, qy = _in_order(*moves[:, i : i + CHUNK, None])
        boxes = (px <= bx) & (ax <= qx)
        boxes &= (np.minimum(py, qy) <= np.maximum(ay, by)) & (np.minimum(ay, by) <= np.maximum(py, qy))
        wx, wy, mx, my = bx - ax, by - ay, qx - px, qy - py
        sides = (wx * (py - ay) - wy * (px - ax) > 0) != (wx * (qy - ay) - wy * (qx - ax) > 0)
        ends = (mx * (ay - py) - my * (ax - px) > 0) != (mx * (by - py) - my * (bx - px) > 0)
        out[i : i + CHUNK] = (boxes & sides & ends).any(axis=1)
    return out


@kernel
def _brute(x0: Array, y0: Array, x1: Array, y1: Array, walls: Array, out: BoolArray) -> None:
    for i in range(len(x0)):
        out[i] = brute_one(x0[i], y0[i], x1[i], y1[i], walls)


def brute_numba(walls: Array, moves: Array) -> BoolArray:
    """Every move against every wall until one is crossed, compiled."""
    out = np.empty(moves.shape[1], np.bool_)
    _brute(moves[0], moves[1], moves[2], moves[3], walls, out)
    return out


def measure(variants: dict[str, Callable[[Array], BoolArray]], inputs: list[Array]) -> dict[str, list[float]]:
    """Thread CPU seconds of each call, variants in turn on each input."""
    first = [run(inputs[0]) for run in variants.values()]  # compiles
    assert all(np.array_equal(first[0], other) for other in first[1:])
    times: dict[str, list[float]] = {name: [] for name in variants}
    for i in range(0, len(inputs), BLOCK):
        answers = []
        for name, run in variants.items():
            for moves in inputs[i : i + BLOCK]:
                start = time.thread_time_ns()
                answers.append(run(moves))
                times[name].append((time.thread_time_ns() - start) * 1e-9)
        rows = [np.concatenate(answers[k : k + BLOCK]) for k in range(0, len(answers), BLOCK)]
        assert all(np.array_equal(rows[0], other) for other in rows[1:])
    return times


def report(title: str, times: dict[str, list[float]], n: int) -> None:
    base = times["index"]
    print(title)
    for name, values in times.items():
        low, middle = min(values), statistics.median(values)
        ratio, ratio_middle = low / min(base), middle / statistics.median(base)
        micro = f"{low * 1e6:9.1f} us min {middle * 1e6:9.1f} us median ({low / n * 1e9:7.1f} ns a move)"
        print(f"  {name:<12}{micro}   {ratio:7.1f} x min {ratio_middle:7.1f} x median")


def floors_of(site: Path | None) -> dict[str, Array]:
    if site is None:
        return {"made-up arcade": arcade()}
    from wayfuse.maps.site import Site

    loaded = Site.load(site)
    return {f"{loaded.name} {floor.name}": floor.walls for floor in loaded.floors}


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--site", type=Path, help="a site folder (default: a made-up arcade)")
    parser.add_argument("--moves", type=int, default=1000)
    parser.add_argument("--rounds", type=int, default=12, help=f"turns of {BLOCK} clouds each")
    options = parser.parse_args()
    rng = np.random.default_rng(0)
    for name, walls in floors_of(options.site).items():
        start = time.thread_time()
        index = WallIndex.build(walls)
        size = sum(table.nbytes for table in index.arrays) / 1e6
        print(f"{name}: {len(walls)} walls, built in {time.thread_time() - start:.2f} s, {size:.1f} MB")
        variants: dict[str, Callable[[Array], BoolArray]] = {
            "index": lambda moves, index=index: index.crosses(*moves),
            "numba brute": lambda moves, walls=index.arrays.walls: brute_numba(walls, moves),
            "numpy brute": lambda moves, walls=index.arrays.walls: brute_numpy(walls, moves),
        }
        for spread in (True, False):
            inputs = [
                moves_of(rng, index.arrays.walls, options.moves, spread)
                for _ in range(BLOCK * options.rounds)
            ]
            crossing = np.mean([index.crosses(*moves).mean() for moves in inputs])
            kind = "spread over the floor" if spread else "gathered within 5 m"
            title = f" {options.moves} moves of {STEP} m, {kind}, {100 * crossing:.0f} % cross"
            report(title, measure(variants, inputs), options.moves)


if __name__ == "__main__":
    main()
