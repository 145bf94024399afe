"""Scans of access points whose places are known, as observations of particles on any floors.

Two of them: the order in which access points are heard (liu2017) and their path loss (karlsson2015). The papers know
one floor; here a particle is weighed by the access points of its own floor. Floors have different ones, so that their
likelihoods do not compare: the best particle of each floor counts as what that floor's share of the power is.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from wayfuse.core.errors import ConfigError
from wayfuse.core.types import Array
from wayfuse.filters.cloud import Cloud
from wayfuse.radio.ap_hearing import Heard, floor_log_shares, hear, is_5ghz
from wayfuse.radio.ap_places import ApPlaces
from wayfuse.radio.ap_sequence import Neighbours, from_positions, kernel_log_likelihood
from wayfuse.radio.path_loss import PathLoss, log_likelihood
from wayfuse.radio.survey import Fingerprint

__all__ = ["PathLossLikelihood", "SequenceLikelihood"]

_LEAST = 3  # access points of a floor that say something about a place on it


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SequenceLikelihood:
    """Kernel about the k cells whose order of access points is most like that of a scan; Eq. 2 of liu2017.

    Parameters
    ----------
    places : of the access points. extents : x0, y0, x1, y1 m of each floor. cell : m. precision : 1/m² of the kernel.
    most : loudest access points of a floor that make a sequence, 0 = all that are heard. Those unheard are left out.
    power : (n,) dBm at 1 m of each access point, taken off its readings; None = equal powers, as in the paper.
    """

    places: ApPlaces
    extents: tuple[tuple[float, float, float, float], ...]
    cell: float
    k: int
    precision: float
    most: int = 0
    power: Array | None = None

    def neighbours(self, heard: Heard, floor: int) -> Neighbours | None:
        """The k cells of a floor; None where fewer than three of its access points were heard."""
        mine = heard.on(self.places, floor, self.most)
        if len(mine.row) < _LEAST:
            return None
        sequences = from_positions(self.places.xy[mine.row], self.extents[floor], self.cell)
        return sequences.neighbours(_levelled(mine, self.power), self.k)

    def log_likelihood(self, cloud: Cloud, fingerprint: Fingerprint, out: Array) -> bool:
        """Add the log-likelihood to ``out`` (N,); False, and nothing added, where too little was heard."""
        heard = hear(self.places, fingerprint)

        def of_floor(floor: int, xy: Array) -> Array | None:
            near = self.neighbours(heard, floor)
            return None if near is None else kernel_log_likelihood(near, xy, self.precision)

        return _add_by_floor(cloud, floor_log_shares(self.places, heard, len(self.extents)), of_floor, out)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PathLossLikelihood:
    """A Gaussian per access point about the path loss of its band; Eq. 1 of karlsson2015.

    Parameters
    ----------
    places : of the access points. bands : 2.4 and 5 GHz. n_floors : of the site. most : readings that a scan may
    count for; the log-likelihood of one that heard more is lowered in proportion, for errors of many are alike.
    power : (n,) dBm at 1 m of each access point, taken off its readings; None = the power of its band. offset_sigma :
    dB, how far the phone may be louder or fainter than the one the parameters are for.
    """

    places: ApPlaces
    bands: tuple[PathLoss, ...]
    n_floors: int
    most: float = math.inf
    power: Array | None = None
    offset_sigma: float = 0.0

    def __post_init__(self) -> None:
        if len(self.bands) != 2 or not self.most > 0.0:
            raise ConfigError("two bands, and most above 0", where="PathLossLikelihood")

    def log_likelihood(self, cloud: Cloud, fingerprint: Fingerprint, out: Array) -> bool:
        """Add the log-likelihood to ``out`` (N,); False, and nothing added, where too little was heard."""
        heard = hear(self.places, fingerprint)

        def of_floor(floor: int, xy: Array) -> Array | None:
            mine = heard.on(self.places, floor)
            n = len(mine.row)
            if n < _LEAST:
                return None
            upper = is_5ghz(mine.frequency)
            rssi = np.where([~upper, upper], _levelled(mine, self.power), np.nan)
            gain = min(1.0, self.most / n)
            return gain * log_likelihood(
                self.bands, self.places.xy[mine.row], rssi, xy, offset_sigma=self.offset_sigma
            )

        return _add_by_floor(cloud, floor_log_shares(self.places, heard, self.n_floors), of_floor, out)


def _levelled(heard: Heard, power: Array | None) -> Array:
    return heard.rssi if power is None else heard.rssi - power[heard.row]


def _add_by_floor(
    cloud: Cloud, log_share: Array, of_floor: Callable[[int, Array], Array | None], out: Array
) -> bool:
    """Add each floor's log-likelihood, its best particle at the floor's share; False where no floor says anything."""
    xy = np.column_stack([cloud.x, cloud.y]).astype(np.float64)
    added = np.empty(cloud.n)
    says = False
    for floor in np.unique(cloud.floor).tolist():
        rows = cloud.floor == floor
        found = of_floor(floor, xy[rows])
        says = says or found is not None
        added[rows] = log_share[floor] + (0.0 if found is None else found - found.max())
    if says:
        out += added
    return says
