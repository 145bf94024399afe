"""Fitting Gaussian-process radio maps: one kernel and one factor for all access points, against scikit-learn.

    python -m benchmarks.gaussian_process [--points 500] [--aps 300]

scikit-learn fits every access point alone, with the same sum of two Matern-3/2 kernels and noise, or with a squared
exponential and noise as X"""

from __future__ import annotations

import argparse
import time
import warnings
from importlib.util import find_spec
from typing import Any

import numpy as np

from benchmarks.report import Table, Target, ratio
from wayfuse.core.types import Array
from wayfuse.radio import gaussian_process
from wayfuse.radio.gp_regression import Kernel, factorise, fit_kernel
from wayfuse.radio.survey import Survey

__all__ = ["made_up_field", "measure"]

HELD_OUT = 200
SIZES = ((30, 500, 4), (300, 500, 12))  # access points, places, access points that are fitted alone


def made_up_field(points: int, aps: int, seed: int = 0) -> tuple[Array, Array, Array]:
    """Places (n, 2), readings (n, aps) dBm with 3 dB noise, true strengths (n, aps)."""
    rng = np.random.default_rng(seed)
    xy = rng.uniform((0, 0), (60, 40), (points, 2))
    ap_xy = rng.uniform((0, 0), (60, 40), (aps, 2))
    distance = np.hypot(*(xy[:, None] - ap_xy[None]).transpose(2, 0, 1))
    apart = np.hypot(*(xy[:, None] - xy[None]).transpose(2, 0, 1))
    truth = -38.0 - 28.0 * np.log10(np.hypot(distance, 2.0))
    for a in range(aps):
        strength, width = rng.uniform(4.0, 8.0), rng.uniform(5.0, 12.0)
        lower = np.linalg.cholesky(np.exp(-apart / width) + 1e-9 * np.eye(points))
        truth[:, a] += strength * (lower @ rng.normal(size=points))
    return xy, truth + rng.normal(0, 3.0, truth.shape), truth


def density(mean: Array, sigma: Array, seen: Array) -> float:
    """Negative log predictive density of readings, nats each."""
    z = (seen - mean) / sigma
    return float(np.mean(0.5 * z * z + np.log(sigma) + 0.5 * np.log(2.0 * np.pi)))


def fit_shared(xy: Array, residual: Array) -> tuple[Any, Array, Kernel]:
    """Kernel, factor and weights for all access points at once."""
    kernel = fit_kernel([(xy, residual)])
    factor = factorise(xy, kernel)
    return factor, factor.solve(residual), kernel


def fit_alone(xy: Array, residual: Array, *, same: bool) -> list[Any]:
    """A regressor of scikit-learn for each access point; ``same``: with the kernel of wayfuse."""
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, Matern, WhiteKernel

    if same:
        far = ConstantKernel(36.0) * Matern(8.0, (2.0, 40.0), nu=1.5)
        near = ConstantKernel(9.0) * Matern(1.5, (0.5, 5.0), nu=1.5)
        kernel = far + near + WhiteKernel(9.0)
    else:
        kernel = ConstantKernel(36.0) * RBF(8.0, (0.5, 40.0)) + WhiteKernel(9.0)
    fits = []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # a length at its bound
        for a in range(residual.shape[1]):
            fits.append(GaussianProcessRegressor(kernel).fit(xy, residual[:, a]))  # noqa: PERF401
    return fits


def _timed(run: Any, *arguments: Any, **options: Any) -> tuple[float, Any]:
    start = time.process_time()
    result = run(*arguments, **options)
    return time.process_time() - start, result


def compare(aps: int, points: int, alone: int) -> list[tuple[str, float, float, float, str]]:
    """(who, fit s, nlpd over the access points fitted alone, rmse dB, note) of each way."""
    xy, rssi, truth = made_up_field(points + HELD_OUT, aps)
    train, test = slice(0, points), slice(points, None)
    mean = rssi[train].mean(axis=0)
    residual = rssi - mean
    fit_shared(xy[:50], residual[:50, :2])  # imports
    seconds, (factor, weights, kernel) = min(
        (_timed(fit_shared, xy[train], residual[train]) for _ in range(3)), key=lambda r: r[0]
    )
    predicted, spread = factor.predict(weights, xy[test])
    sigma = np.hypot(spread, kernel.noise)[:, None]
    few = np.linspace(0, aps - 1, min(alone, aps)).astype(int)
    rows = []

    def scored(who: str, taken: float, value: Array, deviation: Array, note: str) -> None:
        nlpd = density(value, deviation, residual[test][:, few])
        rmse = float(np.sqrt(np.mean((value + mean[few] - truth[test][:, few]) ** 2)))
        rows.append((who, taken, nlpd, rmse, note))

    scored("wayfuse, all access points share", seconds, predicted[:, few], sigma, "")
    # the likeliest scale of each access point under the shared kernel: not part of the map as it is
    scale = np.sqrt((residual[train] * weights).mean(axis=0))[few]
    scored(
        "the same, deviation scaled per access point", seconds, predicted[:, few], sigma * scale, "a trial"
    )
    if find_spec("sklearn"):
        for name, same in (("scikit-learn, same kernel", True), ("scikit-learn, squared exponential", False)):
            taken, fits = _timed(fit_alone, xy[train], residual[train][:, few], same=same)
            both = [f.predict(xy[test], return_std=True) for f in fits]
            value, deviation = (np.stack(v, axis=1) for v in zip(*both, strict=True))
            scored(name, taken * aps / len(fits), value, deviation, f"scaled from {len(fits)}")
    return rows


def measure(seconds: float) -> tuple[list[Table], list[Target]]:
    """The table of fits and the goal for 300 access points; takes as long as it takes, about half a minute."""
    rows: list[tuple[str | float, ...]] = []
    targets: list[Target] = []
    for aps, points, alone in SIZES if seconds > 10.0 else SIZES[:1]:
        found = compare(aps, points, alone)
        ours = found[0]
        for who, taken, nlpd, rmse, note in found:
            shown = ratio(taken, ours[1]) if who.startswith("scikit") else ""
            rows.append(
                (str(aps), str(points), who, f"{taken:.2f}", shown, f"{nlpd:.3f}", f"{rmse:.2f}", note)
            )
        if (aps, points, alone) == SIZES[-1]:
            others = [f for f in found if f[0].startswith("scikit")]
            for who, taken, nlpd, *_ in others:
                targets.append(
                    Target(f"fit of {aps} access points x {points} places, {who}", 50.0, taken / ours[1])
                )
                name = f"held-out density less that of {who} (nats)"
                targets.append(Target(name, 0.02, ours[2] - nlpd, "", less=True))
            if not others:
                targets.append(
                    Target(f"fit of {aps} access points x {points} places, scikit-learn", 50.0, None)
                )
    xy, rssi, _ = made_up_field(500, 30)
    whole, _ = _timed(gaussian_process.fit, Survey.from_dense(rssi, xy, np.zeros(500, np.int32), ("0",)))
    note = (
        f"Process CPU seconds, one thread. nlpd and rmse at {HELD_OUT} held-out places, over the access points all "
        f"have fitted. A whole map of wayfuse (30 x 500; trends, silence, grid) takes {whole:.2f} s."
    )
    columns = ("access points", "places", "who", "fit s", "ratio", "nlpd", "rmse dB", "")
    return [Table("Gaussian-process radio maps", note, columns, tuple(rows))], targets


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--points", type=int, default=500)
    parser.add_argument("--aps", type=int, default=300)
    parser.add_argument("--alone", type=int, default=12, help="access points that are fitted alone")
    options = parser.parse_args()
    for row in compare(options.aps, options.points, options.alone):
        print(f"{row[0]:36s}{row[1]:10.2f} s  nlpd {row[2]:.3f}  rmse {row[3]:.2f} dB  {row[4]}")


if __name__ == "__main__":
    main()
