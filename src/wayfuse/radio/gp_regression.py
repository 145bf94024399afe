"""Gaussian-process regression of many outputs on the same places: one kernel, one Cholesky factor.

All access points of a floor share the training places and the kernel, a sum of two Matern-3/2 terms
(shadowing over metres, fading over about one metre) and noise. The factor of the covariance is then computed
once for all of them, and so is the predictive spread; only the right-hand sides differ. The marginal
likelihood is the product over access points and floors.

References
----------
.. [1] C. Rasmussen, C. Williams, Gaussian Processes for Machine Learning, MIT Press 2006: Eq. 2.25-2.26
   (prediction), Eq. 5.9 (gradient), Eq. 5.10-5.12 (leave-one-out).
.. [2] B. Ferris, D. Haehnel, D. Fox, Gaussian processes for signal strength-based location estimation, RSS
   2006.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from wayfuse.core.types import Array

__all__ = ["Factor", "Kernel", "factorise", "fit_kernel", "log_marginal"]

_SQRT3 = float(np.sqrt(3.0))


class Kernel(NamedTuple):
    """Shared hyper-parameters: standard deviations (dB) and lengths (m) of both terms, and the noise (dB)."""

    far_sigma: float = 6.0
    far_length: float = 8.0
    near_sigma: float = 3.0
    near_length: float = 1.5
    noise: float = 3.0


# Range of each hyper-parameter, in the order of `Kernel`
_BOUNDS = ((0.5, 20.0), (2.0, 40.0), (0.3, 15.0), (0.5, 5.0), (1.0, 12.0))
_PRIOR_SPREAD = 1.0  # standard deviation of each log parameter around the defaults: holds small surveys
_ITERATIONS = 30


def _apart(a: Array, b: Array) -> Array:
    """Distances (n, k) between places (n, 2) and (k, 2)."""
    squared = ((a[:, None] - b[None]) ** 2).sum(axis=-1)
    return np.asarray(np.sqrt(squared))


def _matern(distance: Array, length: float) -> Array:
    r = _SQRT3 * distance / length
    return np.asarray((1.0 + r) * np.exp(-r))


def _covariance(distance: Array, kernel: Kernel) -> Array:
    far = kernel.far_sigma**2 * _matern(distance, kernel.far_length)
    return np.asarray(far + kernel.near_sigma**2 * _matern(distance, kernel.near_length))


@dataclass(frozen=True, slots=True, eq=False)
class Factor:
    """Places (n, 2), kernel, and the lower Cholesky factor (n, n) of their covariance with noise."""

    xy: Array
    kernel: Kernel
    lower: Array

    def solve(self, residual: Array) -> Array:
        """Weights (n, m): the inverse covariance times residuals (n, m)."""
        from scipy.linalg import cho_solve

        return np.asarray(cho_solve((self.lower, True), residual))

    def leave_one_out(self, residual: Array) -> tuple[Array, Array]:
        """Mean (n, m) and standard deviation (n,), noise included, of each residual given the others [1]_."""
        from scipy.linalg import solve_triangular

        inverse = solve_triangular(self.lower, np.eye(len(self.xy)), lower=True)
        precision = (inverse * inverse).sum(axis=0)
        mean = residual - (inverse.T @ (inverse @ residual)) / precision[:, None]
        return mean, 1.0 / np.sqrt(precision)

    def predict(self, weights: Array, xy: Array) -> tuple[Array, Array]:
        """Mean (N, m) of the residual and standard deviation (N,) without noise at places (N, 2)."""
        from scipy.linalg import solve_triangular

        cross = _covariance(_apart(xy, self.xy), self.kernel)
        v = solve_triangular(self.lower, cross.T, lower=True)
        prior = self.kernel.far_sigma**2 + self.kernel.near_sigma**2
        return cross @ weights, np.sqrt(np.maximum(prior - (v * v).sum(axis=0), 1e-9))


def factorise(xy: Array, kernel: Kernel) -> Factor:
    """Factor of the covariance of places (n, 2) m under a kernel."""
    from scipy.linalg import cholesky

    covariance = _covariance(_apart(xy, xy), kernel)
    covariance[np.diag_indices(len(xy))] += kernel.noise**2
    lower = cholesky(covariance, lower=True, overwrite_a=True, check_finite=False)
    return Factor(xy, kernel, np.asarray(lower))


def log_marginal(distance: Array, residual: Array, kernel: Kernel) -> tuple[float, Array]:
    """Log marginal likelihood of residuals (n, m), constant dropped, and its gradient by the log parameters.

    ``distance`` (n, n) m between the places. One factor serves all m outputs.
    """
    from scipy.linalg import cho_solve, cholesky

    n, m = residual.shape
    r_far, r_near = _SQRT3 * distance / kernel.far_length, _SQRT3 * distance / kernel.near_length
    e_far, e_near = kernel.far_sigma**2 * np.exp(-r_far), kernel.near_sigma**2 * np.exp(-r_near)
    far, near = (1.0 + r_far) * e_far, (1.0 + r_near) * e_near
    covariance = far + near
    covariance[np.diag_indices(n)] += kernel.noise**2
    lower = cholesky(covariance, lower=True, overwrite_a=True, check_finite=False)
    weights = cho_solve((lower, True), residual, check_finite=False)
    value = -0.5 * float((residual * weights).sum()) - m * float(np.log(np.diag(lower)).sum())
    inverse = cho_solve((lower, True), np.eye(n), check_finite=False)
    g = 0.5 * (weights @ weights.T - m * inverse)  # Eq. 5.9, summed over outputs
    slopes = (2.0 * far, r_far * r_far * e_far, 2.0 * near, r_near * r_near * e_near)
    gradient = [float(np.vdot(g, slope)) for slope in slopes]
    return value, np.array([*gradient, 2.0 * kernel.noise**2 * float(np.trace(g))])


def fit_kernel(groups: Sequence[tuple[Array, Array]], start: Kernel | None = None) -> Kernel:
    """Kernel of the highest marginal likelihood over groups of (places (n, 2) m, residuals (n, m) dB).

    A weak log-normal prior around the defaults of `Kernel` keeps small surveys in a physical range.
    """
    from scipy.optimize import minimize

    centre = np.log(np.array(Kernel()))
    distances = [_apart(xy, xy) for xy, _ in groups]

    def cost(log_parameters: Array) -> tuple[float, Array]:
        kernel = Kernel(*np.exp(log_parameters).tolist())
        pull = (log_parameters - centre) / _PRIOR_SPREAD
        value, gradient = 0.5 * float(pull @ pull), pull / _PRIOR_SPREAD
        for distance, (_, residual) in zip(distances, groups, strict=True):
            v, g = log_marginal(distance, residual, kernel)
            value, gradient = value - v, gradient - g
        return value, gradient

    first = centre if start is None else np.log(np.array(start))
    bounds = [(float(np.log(low)), float(np.log(high))) for low, high in _BOUNDS]
    found = minimize(
        cost, first, jac=True, method="L-BFGS-B", bounds=bounds, options={"maxiter": _ITERATIONS}
    )
    return Kernel(*np.exp(found.x).tolist())
