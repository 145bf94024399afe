r"""Indoor multipath after Saleh and Valenzuela: rays that arrive in clusters, both by Poisson processes.

.. math:: h(t) = \sum_l \sum_k \beta_{kl} e^{j \theta_{kl}} \delta(t - T_l - \tau_{kl}), \qquad
          E \beta_{kl}^2 \propto e^{-T_l / \Gamma} e^{-\tau_{kl} / \gamma}

with uniform phases and Rayleigh magnitudes. Their mean power here is 1 together, so that a level is added elsewhere; a
direct path of Rice factor K comes on top where asked for. The mean delay of the power is

.. math:: \frac{\Lambda \Gamma^2}{1 + \Lambda \Gamma} + \frac{\lambda \gamma^2}{1 + \lambda \gamma}.

References
----------
.. [1] Saleh, Valenzuela, A statistical model for indoor multipath propagation, IEEE JSAC 5(2), 1987,
   doi:10.1109/JSAC.1987.1146527.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.types import Array
from wayfuse.simulator.toml_tables import no_negative, require

__all__ = ["MultipathModel", "Taps", "draw_taps", "response"]

_WINDOW = 8.0  # decay times after which arrivals are left out: 0.03 % of the power


@dataclass(frozen=True, slots=True, kw_only=True)
class MultipathModel:
    """Arrivals and decays, ns; the four of [1] for its building."""

    cluster_ns: float = 300.0  # mean time between clusters, 1 / Lambda
    ray_ns: float = 5.0  # mean time between rays of a cluster, 1 / lambda
    cluster_decay_ns: float = 60.0  # Gamma
    ray_decay_ns: float = 20.0  # gamma
    rice_db: float = 9.0  # direct path over all others, in line of sight
    wall_rice_db: float = 6.0  # less of it for each wall

    def __post_init__(self) -> None:
        no_negative(self, but=("rice_db",))
        times = self.cluster_ns, self.ray_ns, self.cluster_decay_ns, self.ray_decay_ns
        require("cluster_ns, ray_ns and their decays", min(times) > 0.0, times, "positive times in ns")

    @property
    def mean_delay_ns(self) -> float:
        """Mean delay of the power of the echoes (ns), of clusters and of rays within them."""
        clusters, rays = self.cluster_decay_ns / self.cluster_ns, self.ray_decay_ns / self.ray_ns
        return clusters * self.cluster_decay_ns / (1.0 + clusters) + rays * self.ray_decay_ns / (1.0 + rays)


class Taps(NamedTuple):
    """Arrivals: delay (n,) ns, amplitude (n,) complex, azimuth (n,) rad."""

    delay: Array
    amplitude: NDArray[np.complex128]
    azimuth: Array


def draw_taps(model: MultipathModel, rice_db: float, azimuth: float, rng: np.random.Generator) -> Taps:
    """Draw a channel of mean power 1.

    Parameters
    ----------
    rice_db : of the direct path, which comes at delay 0 from ``azimuth`` (rad); -inf for none.
    """
    late = _WINDOW * model.cluster_decay_ns
    starts = np.concatenate([[0.0], rng.uniform(0.0, late, rng.poisson(late / model.cluster_ns))])
    delays, clusters = [], []
    for number in range(len(starts)):
        span = _WINDOW * model.ray_decay_ns
        rays = np.concatenate([[0.0], rng.uniform(0.0, span, rng.poisson(span / model.ray_ns))])
        delays.append(rays)
        clusters.append(np.full(len(rays), number))
    ray, cluster = np.concatenate(delays), np.concatenate(clusters)
    expected = (1.0 + model.cluster_decay_ns / model.cluster_ns) * (1.0 + model.ray_decay_ns / model.ray_ns)
    power = np.exp(-starts[cluster] / model.cluster_decay_ns - ray / model.ray_decay_ns) / expected
    n = len(ray)
    echo = np.sqrt(0.5 * power) * (rng.normal(size=n) + 1j * rng.normal(size=n))
    around = rng.uniform(-np.pi, np.pi, len(starts))[cluster] + rng.laplace(0.0, 0.4, n)
    ratio = 10.0 ** (0.1 * rice_db)
    direct = np.sqrt(ratio / (1.0 + ratio)) * np.exp(1j * rng.uniform(-np.pi, np.pi))
    return Taps(
        np.concatenate([[0.0], starts[cluster] + ray]),
        np.concatenate([[direct], echo / np.sqrt(1.0 + ratio)]),
        np.concatenate([[azimuth], around]),
    )


def response(taps: Taps, frequency: Array, carrier: float, n_antennas: int) -> NDArray[np.complex128]:
    """Channel (n_antennas, m) at frequencies (m,) Hz off the carrier, antennas in a row half a wavelength apart."""
    turn = np.exp(-2j * np.pi * 1e-9 * np.outer(taps.delay, carrier + frequency))
    row = np.exp(1j * np.pi * np.outer(np.arange(n_antennas), np.cos(taps.azimuth)))
    return np.asarray((row * taps.amplitude) @ turn)
