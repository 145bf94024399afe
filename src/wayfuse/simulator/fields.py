"""Random fields over a floor, with a value at any place: sums of plane waves (random Fourier features).

A sum of ``F`` waves with wave vectors drawn from the spectrum of a covariance is, for large ``F``, a Gaussian
field of that covariance [1]_; it needs no grid, so a field has a value everywhere and costs nothing until
asked.

References
----------
.. [1] Rahimi, Recht, "Random features for large-scale kernel machines", NIPS 2007, Sec. 3.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wayfuse.core.types import Array, IntArray

__all__ = ["WaveField", "exponential_field", "smooth_field"]


@dataclass(frozen=True, slots=True, eq=False)
class WaveField:
    """``n`` independent fields: wave vectors (n, F, 2) rad/m, phases (n, F) rad, standard deviation."""

    vector: Array
    phase: Array
    sigma: float

    def at(self, member: IntArray, xy: Array) -> Array:
        """Values (m,) of the fields ``member`` (m,) at the places (m, 2) m."""
        v = self.vector[member]
        angle = v[:, :, 0] * xy[:, :1] + v[:, :, 1] * xy[:, 1:] + self.phase[member]
        return np.asarray(self.sigma * np.sqrt(2.0 / v.shape[1]) * np.cos(angle).sum(axis=1))


def exponential_field(
    n: int, sigma: float, distance: float, rng: np.random.Generator, n_waves: int = 64
) -> WaveField:
    """Fields of covariance ``sigma^2 exp(-d / distance)``, the shadowing model of Gudmundson (1991).

    Its spectrum in the plane is a Student t of one degree of freedom: a normal over an independent normal's
    size.
    """
    scale = np.abs(rng.normal(size=(n, n_waves, 1)))
    vector = rng.normal(size=(n, n_waves, 2)) / (distance * np.maximum(scale, 1e-3))
    return WaveField(vector, rng.uniform(0.0, 2.0 * np.pi, (n, n_waves)), sigma)


def smooth_field(
    n: int, sigma: float, distance: float, rng: np.random.Generator, n_waves: int = 64
) -> WaveField:
    """Fields of covariance ``sigma^2 exp(-d^2 / (2 distance^2))``: smooth, as of distant sources."""
    vector = rng.normal(size=(n, n_waves, 2)) / distance
    return WaveField(vector, rng.uniform(0.0, 2.0 * np.pi, (n, n_waves)), sigma)
