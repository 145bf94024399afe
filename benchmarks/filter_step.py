"""What the compiled parts of the filter are worth against well vectorised NumPy of the same meaning.

    python -m benchmarks.filter_step [--particles 1000] [--rounds 60]

Noise, step, mixture likelihood of 40 neighbours, resampling and summary of one cloud; and the k-NN query of a walk
survey against a dense matrix. Variants take turns; thread CPU time, minima and medians, and their ratio.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable

import numpy as np

from wayfuse.core.philox import Noise
from wayfuse.core.types import Array, Array32
from wayfuse.filters._kernels import geometric_median, normalise
from wayfuse.filters.cloud import Cloud
from wayfuse.filters.resampling import systematic
from wayfuse.models._kernels import mixture_log_likelihood
from wayfuse.models.motion.pdr import PdrMotion, StepInput
from wayfuse.radio.sparse_knn import SparseKnn
from wayfuse.radio.survey import Fingerprint, Survey


def main(arguments: list[str] | None = None) -> dict[str, float]:
    """Print the table; return the ratio of the minima by part."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--particles", type=int, default=1000)
    parser.add_argument("--rounds", type=int, default=60)
    options = parser.parse_args(arguments)
    parts = {**cloud_parts(options.particles), "k-NN query": query_parts()}
    print(f"{'part':<22}{'NumPy us':>18}{'wayfuse us':>18}{'ratio':>16}   minimum (median)")
    ratios = {}
    for name, (plain, ours) in parts.items():
        times = interleaved((plain, ours), options.rounds)
        (a, am), (b, bm) = ((min(t) * 1e6, statistics.median(t) * 1e6) for t in times)
        ratios[name] = a / b
        print(f"{name:<22}{a:>9.1f} ({am:6.1f}){b:>9.1f} ({bm:6.1f}){a / b:>8.1f} ({am / bm:4.1f})")
    return ratios


def interleaved(variants: tuple[Callable[[], object], ...], rounds: int) -> list[list[float]]:
    """Thread CPU seconds per call of each variant, in turns of ten calls."""
    times: list[list[float]] = [[] for _ in variants]
    for variant in variants:
        variant()
    for _ in range(rounds):
        for variant, taken in zip(variants, times, strict=True):
            start = time.thread_time()
            for _ in range(10):
                variant()
            taken.append((time.thread_time() - start) / 10)
    return times


def cloud_parts(n: int) -> dict[str, tuple[Callable[[], object], Callable[[], object]]]:
    """Plain and compiled forms of each part of a filter step, by name."""
    rng = np.random.default_rng(0)
    x, y = (rng.normal(50, 8, n).astype(np.float32) for _ in range(2))
    bias = rng.normal(0, 0.2, n).astype(np.float32)
    scale = rng.normal(1, 0.1, n).astype(np.float32)
    floor = np.zeros(n, np.int32)
    cloud = Cloud(x, y, bias, scale, floor)
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


def query_parts() -> tuple[Callable[[], object], Callable[[], object]]:
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


if __name__ == "__main__":
    main()
