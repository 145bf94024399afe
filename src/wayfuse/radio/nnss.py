"""Nearest neighbour in signal space (NNSS): the one surveyed place whose mean fingerprint is nearest.

The baseline that particle filters on fingerprints are compared with [1]_, [2]_: the readings of each place
are averaged, a query gets the place of the smallest Euclidean distance in dBm. There is no interpolation:
the answer is always a surveyed place.

References
----------
.. [1] P. Bahl, V. Padmanabhan, RADAR, INFOCOM 2000, 10.1109/INFCOM.2000.832252.
.. [2] chu2009, the comparison method NNSS.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.types import Array, IdArray
from wayfuse.radio import knn
from wayfuse.radio.radio_map import group_positions, require_readings
from wayfuse.radio.representation import Representation
from wayfuse.radio.survey import Fingerprint, Fix, Survey

__all__ = ["NnssMap", "fit", "position_means"]


@dataclass(frozen=True, slots=True, eq=False)
class NnssMap:
    """Fitted NNSS map: a 1-NN map over the mean fingerprints of the places."""

    neighbour: knn.KnnMap

    @property
    def bssid(self) -> IdArray:
        """(m,) access points, ascending."""
        return self.neighbour.bssid

    @property
    def floors(self) -> tuple[str, ...]:
        """Names of the floors."""
        return self.neighbour.floors

    def locate_all(self, rssi: NDArray[np.floating]) -> tuple[Array, NDArray[np.int32]]:
        """xy (q, 2) m and floor (q,) of queries (q, m) dBm, NaN where unheard."""
        return self.neighbour.locate_all(rssi)

    def locate(self, fingerprint: Fingerprint) -> Fix:
        """Place of a fingerprint; `RadioMapError` where it holds no known access point."""
        return self.neighbour.locate(fingerprint)

    def log_likelihood(
        self, fingerprint: Fingerprint, xy: NDArray[np.floating], floor: NDArray[np.integer]
    ) -> Array:
        """(N,) log of a Gaussian of ``bandwidth`` m on the nearest place; 0 where nothing is known."""
        return self.neighbour.log_likelihood(fingerprint, xy, floor)

    def parts(self) -> tuple[str, Mapping[str, Any], Mapping[str, NDArray[Any]]]:
        """Kind, parameters and arrays for `wayfuse.radio.map_file.save`."""
        _, header, arrays = self.neighbour.parts()
        return "nnss", header, arrays

    @classmethod
    def from_parts(cls, survey: Survey, header: Mapping[str, Any]) -> NnssMap:
        """The map of what `parts` gave."""
        return cls(knn.KnnMap.from_parts(survey, header))


def position_means(survey: Survey) -> Survey:
    """The survey with one row per place: the mean (dBm) of the readings of each access point heard there."""
    positions = group_positions(survey)
    shape = (len(positions.xy), len(survey.bssid))
    rows = np.repeat(positions.row_position, np.diff(survey.indptr))
    total, count = np.zeros(shape), np.zeros(shape)
    np.add.at(total, (rows, survey.indices), survey.rssi.astype(np.float64))
    np.add.at(count, (rows, survey.indices), 1.0)
    mean = np.divide(total, count, out=np.full(shape, np.nan), where=count > 0)
    return Survey.from_dense(
        mean,
        positions.xy,
        positions.floor,
        survey.floors,
        bssid=survey.bssid,
        frequency=survey.frequency,
    )


def fit(survey: Survey, *, missing: float = -100.0, bandwidth: float = 3.0) -> NnssMap:
    """Fit an NNSS map.

    Parameters
    ----------
    survey : rows of equal place and floor are averaged. missing : dBm that stands for "not heard".
    bandwidth : m, of the likelihood around the nearest place.

    Raises
    ------
    ConfigError : a parameter is out of range. RadioMapError : the survey has no readings.
    """
    require_readings(survey)
    raw = Representation("raw", missing)
    means = position_means(survey)
    return NnssMap(knn.fit(means, k=1, metric="euclidean", representation=raw, bandwidth=bandwidth))
