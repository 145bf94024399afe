r"""Gaussian-process field of each access point on its own, as Ferris et al. [1]_ and he2014 use it in a filter.

Every access point has a constant mean and a squared-exponential covariance whose parameters are those of the highest
marginal likelihood:

.. math:: k(x, x') = \sigma_f^2 \exp\left(-\frac{|x - x'|^2}{2 l^2}\right), \quad
          p(z \mid x) = \prod_a \mathcal{N}\left(z_a; \mu_a(x), \sigma_a^2(x) + \sigma_{n, a}^2\right)

Mean and spread are kept on a grid and interpolated. For a room where every access point is heard at every place;
`wayfuse.radio.gaussian_process` is the map for buildings, with silence, sessions and heavy tails.

References
----------
.. [1] B. Ferris, D. Haehnel, D. Fox, Gaussian processes for signal strength-based location estimation, RSS 2006.
.. [2] C. Rasmussen, C. Williams, Gaussian Processes for Machine Learning, MIT Press 2006: Eq. 2.25-2.26 (prediction),
   2.30 (marginal likelihood), 5.9 (its gradient).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.errors import RadioMapError
from wayfuse.core.types import Array

__all__ = ["GpField", "SquaredExponential", "fit_gp_field", "fit_squared_exponential", "log_evidence"]


class SquaredExponential(NamedTuple):
    """Parameters of one access point: signal sd (dB), length (m), noise sd (dB)."""

    signal: float = 6.0
    length: float = 8.0
    noise: float = 1.0


_BOUNDS = ((0.5, 100.0), (0.5, 200.0))  # of signal (dB) and length (m)
_MOST_NOISE = 20.0  # dB


@dataclass(frozen=True, slots=True, eq=False)
class GpField:
    """Fields on a grid of (r, c) nodes: origin (2,) m, step m, mean (r, c, a) dBm, sigma (r, c, a) dB of a reading."""

    origin: Array
    step: float
    mean: Array
    sigma: Array

    def select(self, aps: Sequence[int]) -> GpField:
        """The field of some of the access points."""
        chosen = list(aps)
        return GpField(self.origin, self.step, self.mean[..., chosen], self.sigma[..., chosen])

    def predict(self, xy: NDArray[np.floating]) -> tuple[Array, Array]:
        """Mean (N, a) dBm and sd (N, a) dB of a reading at places (N, 2) m; beyond the grid those of its edge."""
        rows, columns = self.mean.shape[:2]
        at = np.clip((xy - self.origin) / self.step, 0.0, [columns - 1, rows - 1])
        low = np.minimum(at.astype(np.int64), [columns - 2, rows - 2])
        u, v = (at - low).T
        node = low[:, 1] * columns + low[:, 0]
        corners = np.stack([node, node + 1, node + columns, node + columns + 1])
        weight = np.stack([(1 - u) * (1 - v), u * (1 - v), (1 - u) * v, u * v])[..., None]
        flat = (self.mean.reshape(rows * columns, -1), self.sigma.reshape(rows * columns, -1))
        mean, sigma = ((weight * table[corners]).sum(axis=0) for table in flat)
        return mean, sigma

    def log_likelihood(self, z: Array, xy: NDArray[np.floating]) -> Array:
        """(N,) log density of readings z (a,) dBm at places (N, 2) m, constants dropped."""
        mean, sigma = self.predict(xy)
        r = (z - mean) / sigma
        return np.asarray((-0.5 * r * r - np.log(sigma)).sum(axis=1))


def _squared(a: Array, b: Array) -> Array:
    return np.asarray(((a[:, None] - b[None]) ** 2).sum(axis=-1))


def log_evidence(squared: Array, residual: Array, kernel: SquaredExponential) -> tuple[float, Array]:
    """Log marginal likelihood (constant dropped) of residuals (n,) dB and its gradient (3,) by the log parameters.

    squared : (n, n) m², squared distances of the places. `numpy.linalg.LinAlgError` where the covariance is singular.
    """
    from scipy.linalg import cho_solve, cholesky

    signal = kernel.signal**2 * np.exp(-0.5 * squared / kernel.length**2)
    covariance = signal + kernel.noise**2 * np.eye(len(residual))
    lower = cholesky(covariance, lower=True, check_finite=False)
    weights = cho_solve((lower, True), residual, check_finite=False)
    value = -0.5 * float(residual @ weights) - float(np.log(np.diag(lower)).sum())  # Eq. 2.30 of [2]
    inverse = cho_solve((lower, True), np.eye(len(residual)), check_finite=False)
    g = 0.5 * (np.outer(weights, weights) - inverse)  # Eq. 5.9 of [2]
    slopes = (
        2.0 * float(np.vdot(g, signal)),
        float(np.vdot(g, signal * squared)) / kernel.length**2,
        2.0 * kernel.noise**2 * float(np.trace(g)),
    )
    return value, np.array(slopes)


def fit_squared_exponential(xy: Array, residual: Array, least_noise: float = 1.0) -> SquaredExponential:
    """Parameters of the highest marginal likelihood for residuals (n,) dB at places (n, 2) m.

    least_noise : dB; a reading is a whole number of dBm at best, and the field a model.
    """
    from scipy.optimize import minimize

    squared = _squared(xy, xy)

    def cost(log_parameters: Array) -> tuple[float, Array]:
        value, gradient = log_evidence(squared, residual, SquaredExponential(*np.exp(log_parameters)))
        return -value, -gradient

    bounds = [
        (float(np.log(low)), float(np.log(high))) for low, high in (*_BOUNDS, (least_noise, _MOST_NOISE))
    ]
    found = minimize(cost, np.log(SquaredExponential()), jac=True, method="L-BFGS-B", bounds=bounds)
    return SquaredExponential(*np.exp(found.x).tolist())


def fit_gp_field(
    xy: Array,
    rssi: Array,
    extent: tuple[float, float, float, float],
    step: float = 0.5,
    least_noise: float = 1.0,
) -> GpField:
    """Fit the fields to readings rssi (n, a) dBm at places (n, 2) m, on a grid over extent (x0, y0, x1, y1) m.

    least_noise : dB, as in `fit_squared_exponential`.

    Raises
    ------
    RadioMapError : readings are missing, or too few places to fit three parameters.
    """
    if len(xy) < 4 or rssi.shape[0] != len(xy) or not np.all(np.isfinite(rssi)):
        raise RadioMapError(
            f"{len(xy)} places, readings {rssi.shape}",
            where="survey",
            remedy="give 4 places or more, each with a finite reading of every access point",
        )
    x, y = (np.arange(low, high + step, step) for low, high in (extent[::2], extent[1::2]))
    nodes = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    tables = [_field(xy, column, nodes, least_noise) for column in rssi.T]
    mean, sigma = (np.stack(t, axis=-1).reshape(len(y), len(x), -1) for t in zip(*tables, strict=True))
    return GpField(np.array(extent[:2]), step, mean, sigma)


def _field(xy: Array, rssi: Array, nodes: Array, least_noise: float) -> tuple[Array, Array]:
    # mean and sd (k,) of a reading of one access point at nodes (k, 2): Eq. 2.25, 2.26 of [2]
    from scipy.linalg import cho_solve, cholesky, solve_triangular

    level = float(rssi.mean())
    kernel = fit_squared_exponential(xy, rssi - level, least_noise)
    covariance = kernel.signal**2 * np.exp(-0.5 * _squared(xy, xy) / kernel.length**2)
    covariance[np.diag_indices(len(xy))] += kernel.noise**2
    lower = cholesky(covariance, lower=True)
    cross = kernel.signal**2 * np.exp(-0.5 * _squared(nodes, xy) / kernel.length**2)
    v = solve_triangular(lower, cross.T, lower=True)
    spread = np.maximum(kernel.signal**2 - (v * v).sum(axis=0), 0.0)
    return level + cross @ cho_solve((lower, True), rssi - level), np.sqrt(spread + kernel.noise**2)
