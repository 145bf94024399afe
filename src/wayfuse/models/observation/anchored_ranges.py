r"""Ranges to anchors whose places are known, at particles on any floor: Gaussian about the distance, with a late tail.

.. math:: p(d \mid x) = \prod_j \Big[(1 - \epsilon) \mathcal{N}(d_j; r_j, \sigma_j^2)
   + \epsilon \frac{1}{\mu} e^{-(d_j - r_j) / \mu} [d_j > r_j]\Big]^{\gamma m_j}

r_j is the distance in space from the anchor to the phone at particle x. A wall or a body between delays the signal and
never hastens it: the tail is one-sided. With :math:`\epsilon = 0` and :math:`\gamma = 1` this is Eq. 10-12 of li2015
[1]_, whose exponents m_j are those of `models.observation.ranges`.

They sum to 1, so a range says the less the more anchors answer at its moment, and a lone one says all. Where ranges
come one by one as well as together, `AnchoredRanges.table` has exponents without a sum: 1 up to the distance ``near``,
and near/d beyond. It also has the phone's line (r_j is offset + slope * distance, `radio.range_line`), and looks at no
deviation that a record states: phones state the scatter of a burst, and walls make the errors. And it takes into
account that an anchor is heard at all, which is rarer by a factor of ``slab`` through each slab of concrete: ranges of
some metres and more hardly differ from floor to floor.

References
----------
.. [1] Li, Burbano, Zhao, Carrera, Braun, Fine-grained Indoor Tracking by Fusing Inertial Sensor and Physical Layer
   Information in WLANs, University of Bern, INF-15-004, 2015.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.errors import ConfigError
from wayfuse.core.types import Array
from wayfuse.filters.cloud import Cloud
from wayfuse.maps.site import Site
from wayfuse.models._kernels import late_log_density
from wayfuse.models.observation.ranges import Exponents, range_exponents
from wayfuse.radio.ap_places import ApPlaces
from wayfuse.sensors.records import Range

__all__ = ["AnchoredRanges"]

_FLOOR = (
    1e-9  # 1/m, density of a range that nothing explains: no particle ever has none, where there is a tail
)
_NEAREST = 0.1  # m; a range may come out as zero or less, which has no inverse


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class AnchoredRanges:
    """Likelihood of the ranges of one moment, for a `Cloud`.

    Parameters
    ----------
    places : of the anchors. offsets : (n_floors, 2) m, a place on floor k plus ``offsets[k]`` is in the frame of the
    first. elevations : (n_floors,) m. sigma : m, standard deviation of a range without a wall between; where a record
    states its own, the two add up in squares. late : epsilon, share of ranges that come late. lateness : mu, m.
    exponents : how ranges are weighed against each other. gain : gamma, tempering, for the errors of ranges of one
    place are alike from moment to moment. phone_height : m above the floor. near : m, of `table`. slab : of `table`,
    how often an anchor one floor away is heard, of how often one on the same floor is.
    """

    places: ApPlaces
    offsets: Array
    elevations: Array
    sigma: float = 1.0
    late: float = 0.0
    lateness: float = 3.0
    exponents: Exponents = Exponents.ONE
    gain: float = 1.0
    phone_height: float = 1.2
    near: float = math.inf
    slab: float = 1.0

    def __post_init__(self) -> None:
        if not (min(self.sigma, self.lateness, self.gain, self.near) > 0.0 and 0.0 <= self.late < 1.0):
            raise ConfigError(
                "sigma, lateness, gain and near must be positive, late a share below 1",
                where="AnchoredRanges",
            )
        if not 0.0 < self.slab <= 1.0:
            raise ConfigError("slab must be a share above 0", where="AnchoredRanges")
        if len(self.offsets) != len(self.elevations):
            raise ConfigError("offsets and elevations of different floors", where="AnchoredRanges")
        if len(self.places) and int(self.places.floor.max()) >= len(self.elevations):
            raise ConfigError("an anchor is on a floor that the site does not have", where="AnchoredRanges")

    @classmethod
    def build(cls, site: Site, places: ApPlaces, **parameters: float | Exponents) -> AnchoredRanges:
        """For the floors of a site; ``parameters`` as of the class."""
        offsets = np.array([site.shift(k, 0) for k in range(len(site.floors))])
        elevations = np.array([floor.elevation for floor in site.floors])
        return cls(places=places, offsets=offsets, elevations=elevations, **parameters)  # type: ignore[arg-type]

    def log_likelihood(self, cloud: Cloud, ranges: Sequence[Range], out: Array) -> bool:
        """Add log p(d | x) to ``out`` (N,); False, and nothing added, where no anchor is known."""
        rows = self.places.rows(np.array([r.anchor for r in ranges], np.uint64))
        known = [(r, int(row)) for r, row in zip(ranges, rows, strict=True) if row >= 0]
        if not known:
            return False
        m = range_exponents(np.array([r.distance for r, _ in known]), self.exponents)
        places = self._places(cloud)
        for (r, row), weight in zip(known, m, strict=True):
            sigma = float(np.hypot(self.sigma, r.sigma)) if np.isfinite(r.sigma) else self.sigma
            out += self.gain * weight * self._log_density(r.distance - self._distance(row, *places), sigma)
        return True

    def table(
        self,
        cloud: Cloud,
        rows: NDArray[np.int64],
        measured: Array,
        gains: Array,
        offsets: Array,
        slopes: Array,
    ) -> Array:
        """Log-likelihood (k, N) of the ranges of a moment under each of k lines, at each particle.

        Parameters
        ----------
        rows : (n,) of ``places``, the anchors. measured : (n,) m. gains : (n,), tempering beside ``gain``.
        offsets, slopes : (k,) m and 1, of lines measured = offset + slope * distance.
        """
        places = self._places(cloud)
        exponents = self.gain * gains * np.minimum(1.0, self.near / np.maximum(measured, _NEAREST))
        out = np.zeros((len(offsets), cloud.n))
        for row, z, exponent in zip(rows.tolist(), measured.tolist(), exponents.tolist(), strict=True):
            late_by = (z - offsets)[:, None] - np.outer(slopes, self._distance(row, *places))
            out += exponent * self._log_density(late_by, self.sigma)
        if len(self.elevations) > 1:
            slabs = np.abs(self.places.floor[rows][:, None] - cloud.floor)
            out += self.gain * math.log(self.slab) * (gains @ slabs)
        return out

    def _places(self, cloud: Cloud) -> tuple[Array, Array, Array]:
        """x, y, z (N,) m of the phones of particles, in the frame of the first floor."""
        x = cloud.x + self.offsets[cloud.floor, 0]
        y = cloud.y + self.offsets[cloud.floor, 1]
        return x, y, self.elevations[cloud.floor] + self.phone_height

    def _distance(self, row: int, x: Array, y: Array, z: Array) -> Array:
        """(N,) m in space from an anchor; one of unknown height is level with a phone on its floor."""
        floor, height = int(self.places.floor[row]), float(self.places.height[row])
        dx = x - (self.places.x[row] + self.offsets[floor, 0])
        dy = y - (self.places.y[row] + self.offsets[floor, 1])
        dz = z - (self.elevations[floor] + (height if np.isfinite(height) else self.phone_height))
        return np.asarray(np.sqrt(dx * dx + dy * dy + dz * dz))

    def _log_density(self, excess: Array, sigma: float) -> Array:
        """Log density of ranges longer by ``excess`` (m) than supposed, up to a constant where there is no tail."""
        if self.late == 0.0:
            return np.asarray(-0.5 * (excess / sigma) ** 2)
        flat = np.ascontiguousarray(excess, dtype=np.float64).ravel()
        density = np.empty_like(flat)
        late_log_density(flat, sigma, self.late, self.lateness, _FLOOR, density)
        return density.reshape(excess.shape)
