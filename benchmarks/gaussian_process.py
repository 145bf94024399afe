"""Time of fitting Gaussian-process maps: shared kernel and factor against one process per access point.

The naive fit is this file's own: the same kernel, likelihood, gradient and optimiser, but every access point
alone. Both predict mean and standard deviation on a grid afterwards. The ratio is what sharing brings.

    python benchmarks/gaussian_process.py [--points 500] [--aps 30] [--alone 3]
"""

from __future__ import annotations

import argparse
import time

import numpy as np

from wayfuse.radio import gaussian_process
from wayfuse.radio.gp_regression import factorise, fit_kernel
from wayfuse.radio.survey import Fingerprint, Survey


def made_up_field(points: int, aps: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Places (n, 2), readings (n, aps) dBm with 3 dB noise, true strengths (n, aps)."""
    rng = np.random.default_rng(seed)
    xy = rng.uniform((0, 0), (60, 40), (points, 2))
    ap_xy = rng.uniform((0, 0), (60, 40), (aps, 2))
    distance = np.hypot(*(xy[:, None] - ap_xy[None]).transpose(2, 0, 1))
    waves = np.sin(xy @ rng.normal(0, 0.25, (2, aps)) + rng.uniform(0, 6, aps))
    truth = -38.0 - 28.0 * np.log10(np.hypot(distance, 2.0)) + 4.0 * waves
    return xy, truth + rng.normal(0, 3.0, truth.shape), truth


def fit_shared(xy: np.ndarray, residual: np.ndarray, grid: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """One kernel and one factor for all access points."""
    factor = factorise(xy, fit_kernel([(xy, residual)]))
    return factor.predict(factor.solve(residual), grid)


def fit_alone(xy: np.ndarray, residual: np.ndarray, grid: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A kernel and a factor for each access point."""
    means, sigmas = zip(
        *(fit_shared(xy, residual[:, a : a + 1], grid) for a in range(residual.shape[1])), strict=True
    )
    return np.hstack(means), np.stack(sigmas, axis=1)


def _seconds(function, *arguments) -> tuple[float, tuple[np.ndarray, np.ndarray]]:  # type: ignore[no-untyped-def]
    start = time.perf_counter()
    result = function(*arguments)
    return time.perf_counter() - start, result


def main(argv: list[str] | None = None) -> dict[str, float]:
    """Time both fits, the whole map, and the likelihood of 1000 particles; print and return the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--points", type=int, default=500)
    parser.add_argument("--aps", type=int, default=30)
    parser.add_argument("--alone", type=int, default=3, help="access points fitted alone, then scaled up")
    parser.add_argument("--nodes", type=int, default=10_000)
    options = parser.parse_args(argv)
    xy, rssi, truth = made_up_field(options.points, options.aps)
    residual, offset = rssi - rssi.mean(axis=0), rssi.mean(axis=0)
    side = int(np.sqrt(options.nodes))
    grid = np.stack(np.meshgrid(np.linspace(0, 60, side), np.linspace(0, 40, side)), axis=-1).reshape(-1, 2)
    fit_shared(xy[:50], residual[:50, :2], grid[:10])  # imports
    shared, _ = _seconds(fit_shared, xy, residual, grid)
    few = min(options.alone, options.aps)
    alone, _ = _seconds(fit_alone, xy, residual[:, :few], grid)
    alone *= options.aps / few
    at_places = fit_shared(xy, residual, xy)[0] + offset
    survey = Survey.from_dense(rssi, xy, np.zeros(len(xy), np.int32), ("0",))
    whole, fitted = _seconds(gaussian_process.fit, survey)
    query = Fingerprint(survey.bssid, rssi[0].astype(np.float32), survey.frequency)
    particles = np.random.default_rng(1).uniform((0, 0), (60, 40), (1000, 2))
    floor = np.zeros(1000, np.int32)
    times = [_seconds(fitted.log_likelihood, query, particles, floor)[0] for _ in range(50)]  # type: ignore[attr-defined]
    figures = {
        "shared_s": shared,
        "alone_s": alone,
        "ratio": alone / shared,
        "rmse_db": float(np.sqrt(np.mean((at_places - truth) ** 2))),
        "map_fit_s": whole,
        "likelihood_1000_ms": 1e3 * float(np.median(times)),
    }
    print(f"{options.aps} access points, {options.points} places, {len(grid)} grid nodes")
    print(f"shared kernel and factor       {shared:8.2f} s   rmse {figures['rmse_db']:.2f} dB")
    print(f"one process per access point   {alone:8.2f} s   (scaled from {few})")
    print(f"ratio                          {figures['ratio']:8.1f}")
    print(f"whole map, censoring and grid  {whole:8.2f} s")
    print(f"likelihood of 1000 particles   {figures['likelihood_1000_ms']:8.2f} ms")
    return figures


if __name__ == "__main__":
    main()
