"""Gaussian-process radio map: per access point a log-distance mean plus a smooth residual, per floor.

Fitting completes the survey first: where an access point was not heard, its latent strength is the
expectation given silence (`wayfuse.radio.censoring`), under the leave-one-out belief of the process itself,
repeated a few times. All access points then have the same training places, and one Cholesky factor serves
them all (`wayfuse.radio.gp_regression`). The fitted map keeps no factor, only mean and spread on a grid per
floor (float32), between which it interpolates: a likelihood of a thousand particles is a gather and a sum.

A query reading is Student-t around the mean, with the spread of the process, the survey noise and the
difference between sessions (people, doors, transmit power); silence is `log_silence`.

References
----------
.. [1] B. Ferris, D. Haehnel, D. Fox, Gaussian processes for signal strength-based location estimation, RSS
   2006; he2014 uses it in a filter.

Notes
-----
Departs from [1]_: log-distance mean, shared kernel with two lengths, censoring, heavy tails, tempering.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.types import Array, IdArray
from wayfuse.radio.gp_fit import fit_fields
from wayfuse.radio.gp_grid import FloorGrid, GridSize, grid_of, log_student
from wayfuse.radio.gp_regression import Kernel
from wayfuse.radio.radio_map import check_queries, locate_one, query_vector, require, require_readings
from wayfuse.radio.survey import Fingerprint, Fix, Survey

__all__ = ["GaussianProcessMap", "Noise", "fit"]

_UNKNOWN_SIGMA = 6.0  # dB, of an access point that a floor heard too rarely for a field of its own
_UNKNOWN_BELOW = 10.0  # dB below the limit of hearing: the mean of such an access point
_LIMIT_QUANTILE = 0.2  # weak readings are a lucky sample: hearing begins to fail well above the weakest


@dataclass(frozen=True, slots=True)
class Noise:
    """How a query differs from the field.

    session_sigma : dB, difference between sessions, per access point. dof : degrees of freedom of Student-t.
    dropout : probability that a scan misses an audible access point. exponent : of the whole likelihood, in
    (0, 1], for errors of access points go together.

    A survey of one session cannot show how sessions differ: leaving out its own places asks for no
    session_sigma at all. The defaults are the best of a grid search on HCXY and SYL (six tables of
    SODIndoorLoc, training and test sessions). CETC331 took no part in that choice, but prototypes that set
    the range of the grid had been scored on its test table.
    """

    session_sigma: float = 4.0
    dof: float = 3.0
    dropout: float = 0.4
    exponent: float = 0.7

    def __post_init__(self) -> None:
        require(self.session_sigma >= 0, f"session_sigma {self.session_sigma}", "0 dB or more")
        require(self.dof > 0, f"dof {self.dof}", "above 0")
        require(0 < self.dropout < 1, f"dropout {self.dropout}", "in (0, 1)")
        require(0 < self.exponent <= 1, f"exponent {self.exponent}", "in (0, 1]")


@dataclass(frozen=True, slots=True, eq=False)
class GaussianProcessMap:
    """Fitted map: bssid (m,), floors, one grid per floor (None: not surveyed), kernel, noise, limit (dBm)."""

    bssid: IdArray
    floors: tuple[str, ...]
    grids: tuple[FloorGrid | None, ...]
    kernel: Kernel
    noise: Noise
    limit: float

    def predict(self, xy: NDArray[np.floating], floor: int) -> tuple[Array, Array]:
        """Mean (N, m) dBm and standard deviation (N, m) dB of a reading at places (N, 2) m of one floor."""
        mean = np.full((len(xy), len(self.bssid)), self.limit - _UNKNOWN_BELOW)
        sigma = np.full_like(mean, _UNKNOWN_SIGMA)
        grid = self.grids[floor]
        if grid is not None:
            node, weight = grid.corners(xy)
            mean[:, grid.columns] = np.einsum("nk,nkm->nm", weight, grid.mean[node])
            sigma[:, grid.columns] = (weight * grid.sigma[node]).sum(axis=1)[:, None]
        return mean, sigma

    def _rest(self, z: Array, n_columns: int) -> float:
        """Log-likelihood of the access points without a field on a floor: readings z (h,), silence of the rest."""
        unknown = np.full((1, len(z)), self.limit - _UNKNOWN_BELOW)
        below = 0.5 * (1.0 + math.erf(_UNKNOWN_BELOW / _UNKNOWN_SIGMA / math.sqrt(2.0)))
        silent = math.log(self.noise.dropout + (1.0 - self.noise.dropout) * below)
        heard = log_student(z, unknown, np.array([[_UNKNOWN_SIGMA]]), self.noise.dof)
        return float(heard[0]) + (n_columns - len(z)) * silent

    def locate_all(self, rssi: NDArray[np.floating]) -> tuple[Array, NDArray[np.int32]]:
        """xy (q, 2) m and floor (q,) of queries (q, m) dBm: the posterior mean on the most probable floor."""
        queries = check_queries(rssi, len(self.bssid)).astype(np.float64)
        floors = [(level, g, g.nodes()[g.near]) for level, g in enumerate(self.grids) if g is not None]
        xy, floor = np.zeros((len(queries), 2)), np.zeros(len(queries), np.int32)
        for q, query in enumerate(queries):
            heard = np.flatnonzero(np.isfinite(query))
            z, best = query[heard], -np.inf
            for level, grid, places in floors:
                own, known = grid.split(heard)
                log_p = grid.at_near_nodes(z[known], own, self.noise.dof)
                log_p += self._rest(z[~known], len(self.bssid) - len(grid.columns))
                log_p *= self.noise.exponent
                top = float(log_p.max())
                weight = np.exp(log_p - top)
                evidence = top + float(np.log(weight.sum() * grid.step**2))
                if evidence > best:
                    best, floor[q] = evidence, level
                    xy[q] = weight @ places / weight.sum()
        return xy, floor

    def locate(self, fingerprint: Fingerprint) -> Fix:
        """Posterior mean of a fingerprint; `RadioMapError` where it holds no known access point."""
        return locate_one(self, fingerprint)

    def log_likelihood(
        self, fingerprint: Fingerprint, xy: NDArray[np.floating], floor: NDArray[np.integer]
    ) -> Array:
        """(N,) tempered log-likelihood at xy (N, 2) m, floor (N,); all 0 where nothing known is heard.

        Beyond the grid the value of its edge holds; on a floor without a survey every access point counts as
        too weak to hear.
        """
        vector = query_vector(self.bssid, fingerprint).astype(np.float64)
        heard = np.flatnonzero(np.isfinite(vector))
        out = np.zeros(len(xy))
        if not len(heard):
            return out
        levels, places, z = np.asarray(floor), np.asarray(xy, np.float64), vector[heard]
        for level in np.unique(levels):
            here = np.flatnonzero(levels == level)
            grid = self.grids[level] if 0 <= level < len(self.grids) else None
            if grid is None:
                out[here] = self._rest(z, len(self.bssid))
                continue
            own, known = grid.split(heard)
            rest = self._rest(z[~known], len(self.bssid) - len(grid.columns))
            out[here] = grid.at_places(z[known], own, places[here], self.noise.dof) + rest
        return self.noise.exponent * out

    def parts(self) -> tuple[str, Mapping[str, Any], Mapping[str, NDArray[Any]]]:
        """Kind, parameters and arrays for `wayfuse.radio.map_file.save`."""
        n = self.noise
        header = {
            "floors": list(self.floors),
            "surveyed": [grid is not None for grid in self.grids],
            "kernel": list(self.kernel),
            "noise": [n.session_sigma, n.dof, n.dropout, n.exponent],
            "limit": self.limit,
        }
        arrays: dict[str, NDArray[Any]] = {"bssid": self.bssid}
        for level, grid in enumerate(self.grids):
            if grid is not None:
                arrays |= grid.parts(level)
        return "gaussian_process", header, arrays

    @classmethod
    def from_parts(cls, header: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]]) -> GaussianProcessMap:
        """The map of what `parts` gave; `ValueError` where they do not fit."""
        bssid, floors, surveyed = arrays["bssid"], tuple(header["floors"]), header["surveyed"]
        if bssid.dtype != np.uint64 or bssid.ndim != 1 or len(surveyed) != len(floors):
            raise ValueError("bssid or floors")
        grids = tuple(
            FloorGrid.from_parts(arrays, level, len(bssid)) if there else None
            for level, there in enumerate(surveyed)
        )
        kernel, noise = Kernel(*header["kernel"]), Noise(*header["noise"])
        return cls(bssid, floors, grids, kernel, noise, float(header["limit"]))


def fit(
    survey: Survey,
    *,
    step: float = 0.5,
    reach: float = 1.0,
    max_points: int = 2000,
    max_nodes: int = 40000,
    limit: float | None = None,
    kernel: Kernel | None = None,
    noise: Noise | None = None,
) -> GaussianProcessMap:
    """Fit a Gaussian-process map.

    Parameters
    ----------
    survey : rows of equal place are averaged, dense floors thinned to ``max_points`` by averaging over cells.
    step : m, grid spacing; widened where a floor would need more than ``max_nodes`` nodes.
    reach : m, how far from a surveyed place an answer of `locate` may lie.
    limit : dBm, limit of hearing; None takes the 20 % quantile of the readings.
    kernel : None fits it by marginal likelihood. noise : None takes the defaults of `Noise`.

    Raises
    ------
    ConfigError : a parameter is out of range. RadioMapError : the survey has no readings.
    """
    require(step > 0 and reach > 0, f"step {step}, reach {reach}", "both above 0 m")
    require(max_points >= 2 and max_nodes >= 4, f"max_points {max_points}, max_nodes {max_nodes}", "larger")
    require(limit is None or limit < 0, f"limit {limit}", "dBm below 0")
    require_readings(survey)
    noise = Noise() if noise is None else noise
    threshold = float(np.quantile(survey.rssi, _LIMIT_QUANTILE)) if limit is None else float(limit)
    fields, fitted = fit_fields(survey, threshold, noise.dropout, max_points, kernel)
    spread = math.hypot(fitted.noise, noise.session_sigma)
    sizes = GridSize(step, reach, max_nodes)
    grids = tuple(None if f is None else grid_of(f, spread, threshold, noise.dropout, sizes) for f in fields)
    return GaussianProcessMap(survey.bssid, survey.floors, grids, fitted, noise, threshold)
