"""The parts of a filter step against NumPy, filterpy's resampling and scipy's Kendall tau.

    python -m benchmarks.filter_step [--seconds 12]

Noise and step, the mixture of 40 neighbours, resampling and summary of one cloud; the k-NN query of a walk survey
against a dense matrix; the rank similarity of a scan with a thousand places.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from importlib.util import find_spec

import numpy as np

from benchmarks.report import Table, Target, ratio
from benchmarks.timing import race
from wayfuse.core.philox import Noise
from wayfuse.core.types import Array, Array32
from wayfuse.filters._batch_kernels import resample_block, weigh_block
from wayfuse.filters._kernels import geometric_median, normalise
from wayfuse.filters.cloud import Cloud
from wayfuse.filters.resampling import systematic
from wayfuse.models._kernels import mixture_log_likelihood
from wayfuse.models.motion.pdr import PdrMotion, StepInput
from wayfuse.radio.ap_sequence import from_positions
from wayfuse.radio.sparse_knn import SparseKnn
from wayfuse.radio.survey import Fingerprint, Survey

__all__ = ["measure"]

N = 1000
RANK = "rank similarity, loop of scipy kendalltau"
SIGNS = "rank similarity, precomputed signs"
Pair = tuple[Callable[[], object], Callable[[], object]]


def measure(seconds: float) -> tuple[list[Table], list[Target]]:
    """One table of parts, and the goal of the rank similarity."""
    groups = {**cloud_parts(N), "k-NN query of 90 in 4,000 x 1,000": query_parts(), **rank_parts()}
    if find_spec("filterpy"):
        groups["systematic resampling, filterpy"] = filterpy_parts(N)
    rows = []
    found = {}
    for name, (plain, ours) in groups.items():
        t = race({"other": plain, "wayfuse": ours}, seconds=seconds / len(groups), least_turns=3)
        a, b = t["other"], t["wayfuse"]
        found[name] = a.least / b.least
        cells = (f"{x.least * 1e6:,.1f} ({x.median * 1e6:,.1f})" for x in (a, b))
        rows.append((name, *cells, f"{ratio(a.least, b.least)} ({ratio(a.median, b.median)})"))
    note = f"us, N = {N} particles. The other is well vectorised NumPy where it is not named."
    goals = [
        Target("rank similarity, 30 access points x 1,000 places, scipy loop", 100_000.0, found[RANK]),
        Target("rank similarity, the same, sign matrix in NumPy", 8.0, found[SIGNS]),
    ]
    return [Table("Parts of an update", note, ("part", "other", "wayfuse", "ratio"), tuple(rows))], goals


def rank_parts() -> dict[str, Pair]:
    """A scan of 30 access points with 1,000 places: a loop of `scipy.stats.kendalltau`, a product of sign matrices."""
    from scipy.stats import kendalltau

    rng = np.random.default_rng(2)
    ap_xy = rng.uniform((0.0, 0.0), (80.0, 50.0), (30, 2))
    sequences = from_positions(ap_xy, (0.0, 0.0, 80.0, 50.0), 2.0)
    far = np.hypot(*(sequences.places[:, None] - ap_xy).transpose(2, 0, 1))
    rssi = rng.uniform(-90.0, -40.0, 30)
    i, j = np.triu_indices(30, 1)
    signs = np.sign(far[:, i] - far[:, j]).astype(np.float32)

    def looped() -> object:
        return [kendalltau(-rssi, sequence).statistic for sequence in far]

    def product() -> object:
        return 0.5 + 0.5 * (signs @ np.sign(rssi[j] - rssi[i]).astype(np.float32)) / len(i)

    def ours() -> object:
        return sequences.similarity(rssi)

    np.testing.assert_allclose(product(), ours(), atol=1e-6)
    return {RANK: (looped, ours), SIGNS: (product, ours)}


def filterpy_parts(n: int) -> Pair:
    """filterpy's systematic resampling against weights, summary, resampling and copying of four columns together."""
    from filterpy.monte_carlo import systematic_resample

    rng = np.random.default_rng(3)
    logs = rng.normal(0.0, 1.0, n).astype(np.float32)
    block, out = rng.normal(0.0, 1.0, (2, 4, n)).astype(np.float32)
    weights, marks, summary = np.empty(n, np.float32), np.empty(n + 1, np.int32), np.empty(8)
    spare = logs.copy()
    p = np.exp(logs.astype(float))
    p /= p.sum()

    def ours() -> None:
        spare[:] = logs
        weigh_block(block[0], block[1], spare, weights, summary)
        resample_block(weights, 0.3, block, marks, out, spare)

    return lambda: systematic_resample(p), ours


def cloud_parts(n: int) -> dict[str, Pair]:
    """Plain and compiled forms of each part of a filter step, by name."""
    rng = np.random.default_rng(0)
    x, y = (rng.normal(50, 8, n).astype(np.float32) for _ in range(2))
    bias = rng.normal(0, 0.2, n).astype(np.float32)
    scale = rng.normal(1, 0.1, n).astype(np.float32)
    floor = np.zeros(n, np.int32)
    cloud = Cloud.on_floors(x, y, bias, scale, floor)
    noise, plain_rng, motion = Noise.of(0, "bench"), np.random.Generator(np.random.SFC64(0)), PdrMotion()
    px, py = (rng.normal(50, 6, 40).astype(np.float32) for _ in range(2))
    w = np.full(40, 1 / 40, np.float32)
    logs = rng.normal(0, 1, n)
    weights, out = np.empty(n), np.zeros(n)

    def plain_step() -> object:
        z = plain_rng.standard_normal((4, n), dtype=np.float32)
        b, s = bias + 0.02 * z[2], np.maximum(scale + 0.01 * z[3], 0.4)
        d, h = 0.7 * s * (1 + 0.15 * z[0]), 0.3 + b + 0.08 * z[1]
        return x + d * np.cos(h), y + d * np.sin(h), b, s

    def plain_mixture() -> object:
        squared = (x[:, None] - px) ** 2 + (y[:, None] - py) ** 2
        return 0.9 * np.log(np.exp(squared * np.float32(-0.5 / 16)) @ w + np.float32(0.05))

    def our_mixture() -> object:
        out[:] = 0
        return mixture_log_likelihood(x, y, floor, px, py, np.zeros(40, np.int32), w, 4.0, 0.05, 0.9, out)

    def plain_resample() -> object:
        p = np.exp(logs - logs.max())
        p /= p.sum()
        return np.searchsorted(np.cumsum(p), (np.arange(n) + plain_rng.random()) / n)

    def our_resample() -> object:
        normalise(logs, weights)
        return systematic(noise, weights, n)

    even = np.full(n, 1 / n)
    return {
        "step with noise": (plain_step, lambda: motion.propagate(noise, cloud, StepInput(0.7, 0.3))),
        "mixture of 40": (plain_mixture, our_mixture),
        "weights and resample": (plain_resample, our_resample),
        "geometric median": (
            lambda: _plain_median(x, y),
            lambda: geometric_median(x, y, floor, even, 0, 8, 0.5),
        ),
    }


def _plain_median(x: Array32, y: Array32) -> tuple[float, float]:
    mx, my = float(x.mean()), float(y.mean())
    for _ in range(8):
        w = 1.0 / np.sqrt((x - mx) ** 2 + (y - my) ** 2 + 0.25)
        mx, my = float(np.sum(w * x) / w.sum()), float(np.sum(w * y) / w.sum())
    return mx, my


def query_parts() -> Pair:
    """A query of 90 access points on 4000 fingerprints x 1000 access points, 80 heard in each."""
    rng = np.random.default_rng(1)
    rssi = np.full((4000, 1000), np.nan, np.float32)
    for row in rssi:
        row[rng.choice(1000, 80, replace=False)] = rng.uniform(-95, -40, 80)
    survey = Survey.from_dense(rssi, rng.uniform(0, 100, (4000, 2)), np.zeros(4000, np.int32), ("F",))
    knn = SparseKnn(survey, idf=False)
    heard = rng.choice(1000, 90, replace=False)
    values = rng.uniform(-95, -40, 90).astype(np.float32)
    query = Fingerprint(survey.bssid[heard], values, np.zeros(90, np.int32))
    dense: Array = np.nan_to_num(np.clip((rssi + 100) / 70, 0, None) ** 1.6)
    sums = dense.sum(axis=1)

    def plain() -> object:
        v = np.zeros(1000, np.float32)
        v[heard] = np.clip((values + 100) / 70, 0, None) ** 1.6
        distance = 1 - 2 * np.minimum(dense, v).sum(axis=1) / (sums + v.sum())
        return np.argpartition(distance, 40)[:40]

    return plain, lambda: knn.neighbours(query)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seconds", type=float, default=12.0)
    tables, goals = measure(parser.parse_args().seconds)
    for row in tables[0].rows:
        print(*(f"{c!s:<44}" if i == 0 else f"{c!s:<24}" for i, c in enumerate(row)))
    print(*goals, sep="\n")


if __name__ == "__main__":
    main()
