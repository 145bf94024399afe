r"""Place from the ranges of one moment, without memory: what a range filter has to beat.

The weighted centroid of the anchors needs no start and is near enough to start from. Squared ranges are linear in
(x, y, R) with R = x² + y²:

.. math:: x_j x + y_j y - R / 2 = (x_j^2 + y_j^2 - d_j^2) / 2

Weighted least squares takes R for a third unknown; constrained weighted least squares [2]_ keeps R = x² + y², by
Levenberg-Marquardt from the weighted centroid, the WC-CWLS of [1]_: the nearest minimum, which with few anchors and
bad ranges is not always the least. The error of d² is 2 d times that of d, so weights are 1/d² where errors are equal
and 1/d⁴ where they grow with range, as those of powers do.

All functions take the ranges of k moments at once, (k, n) m, NaN where an anchor was not heard.

References
----------
.. [1] Li, Braun, Dimitrova, A passive WiFi source localization system based on fine-grained power-based trilateration,
   WoWMoM 2015.
.. [2] Cheung, So, Ma, Chan, A constrained least squares approach to mobile positioning: algorithms and optimality,
   EURASIP J. Appl. Signal Process. 2006, doi:10.1155/ASP/2006/20858.
"""

from __future__ import annotations

import numpy as np

from wayfuse.core.errors import ConfigError
from wayfuse.core.types import Array

__all__ = ["constrained_least_squares", "weighted_centroid", "weighted_least_squares"]

_NEAREST = 1.0  # m, the least range a weight is made of: the error of a range does not vanish with it
_N_ITERATIONS = 30
_DAMPING = 0.1  # Levenberg-Marquardt, relative, at first
_FLAT = 1e-9  # relative singular value or determinant below which the anchors do not tell a place


def _weights(anchors: Array, ranges: Array, power: float) -> tuple[Array, Array]:
    """Ranges with zeros for what was not heard, and weights (k, n), 1 for the nearest anchor of each row."""
    if ranges.ndim != 2 or anchors.shape != (ranges.shape[1], 2):
        raise ConfigError(
            f"anchors {anchors.shape} and ranges {ranges.shape} do not go together",
            remedy="give anchors (n, 2) and ranges (k, n)",
        )
    heard = np.isfinite(ranges)
    d = np.maximum(np.where(heard, ranges, np.inf), _NEAREST)
    nearest = d.min(axis=1, keepdims=True, initial=np.inf)
    ratio = np.where(heard, np.where(np.isfinite(nearest), nearest, 1.0) / d, 0.0)
    return np.where(heard, ranges, 0.0), np.where(heard, ratio**power, 0.0)


def weighted_centroid(anchors: Array, ranges: Array, power: float = 1.0) -> Array:
    """Mean of the anchors (n, 2) m weighted by 1/d^power: (k, 2) m; NaN where no anchor was heard."""
    _, w = _weights(anchors, ranges, power)
    total = w.sum(axis=1, keepdims=True)
    return np.asarray(np.where(total > 0.0, w @ anchors / np.maximum(total, 1e-300), np.nan))


def weighted_least_squares(anchors: Array, ranges: Array, power: float = 4.0) -> Array:
    """Linear least squares with R free, weights 1/d^power: (k, 2) m; NaN with fewer than 3 anchors, or in a row."""
    d, w = _weights(anchors, ranges, power)
    spread = max(float(np.abs(anchors - anchors.mean(axis=0)).max()), 1e-9)  # unknowns of one size
    placed = (anchors - anchors.mean(axis=0)) / spread
    root = np.sqrt(w)
    a = root[..., None] * np.column_stack([placed, np.ones(len(anchors))])
    b = root * 0.5 * ((placed**2).sum(axis=1) - (d / spread) ** 2)
    solved = (np.linalg.pinv(a, rcond=_FLAT) @ b[..., None])[:, :2, 0]
    is_sound = np.linalg.matrix_rank(a, rtol=_FLAT) == 3
    return np.asarray(np.where(is_sound[:, None], anchors.mean(axis=0) + spread * solved, np.nan))


def constrained_least_squares(
    anchors: Array, ranges: Array, power: float = 4.0, start: Array | None = None
) -> Array:
    """Least squares of the squared ranges with R = x² + y², weights 1/d^power: (k, 2) m; NaN with fewer than 3 anchors.

    Parameters
    ----------
    start : (k, 2) m; the weighted centroid where not given.
    """
    d, w = _weights(anchors, ranges, power)
    xy = weighted_centroid(anchors, ranges) if start is None else start.astype(np.float64)
    xy = np.where((np.isfinite(ranges).sum(axis=1) >= 3)[:, None], xy, np.nan)
    damping = np.full(len(xy), _DAMPING)
    cost = _cost(anchors, d, w, xy)
    for _ in range(_N_ITERATIONS):
        tried = xy + _step(anchors, d, w, xy, damping)
        cost_there = _cost(anchors, d, w, tried)
        better = cost_there < cost
        xy = np.where(better[:, None], tried, xy)
        cost = np.where(better, cost_there, cost)
        damping = np.where(better, damping / 3.0, damping * 5.0)
    return np.asarray(xy)


def _cost(anchors: Array, d: Array, w: Array, xy: Array) -> Array:
    """Weighted sum of squares (k,) at places (k, 2) m."""
    residual = d**2 - ((xy[:, None] - anchors) ** 2).sum(axis=-1)
    return np.asarray((w * residual**2).sum(axis=1))


def _step(anchors: Array, d: Array, w: Array, xy: Array, damping: Array) -> Array:
    """Damped Gauss-Newton steps (k, 2) m; none where the anchors tell nothing."""
    apart = xy[:, None] - anchors  # (k, n, 2)
    residual = d**2 - (apart**2).sum(axis=-1)
    gx, gy = 2.0 * apart[..., 0], 2.0 * apart[..., 1]
    a, b, c = ((w * p * q).sum(axis=1) for p, q in ((gx, gx), (gx, gy), (gy, gy)))
    e, f = (w * gx * residual).sum(axis=1), (w * gy * residual).sum(axis=1)
    a, c = (1.0 + damping) * a, (1.0 + damping) * c
    determinant = a * c - b * b
    safe = np.where(determinant > _FLAT * a * c, determinant, np.inf)
    return np.column_stack([(c * e - b * f) / safe, (a * f - b * e) / safe])
