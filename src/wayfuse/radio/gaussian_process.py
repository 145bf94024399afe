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

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.types import Array, Array32, BoolArray, IdArray
from wayfuse.radio.censoring import log_silence
from wayfuse.radio.gp_fit import FloorField, fit_fields
from wayfuse.radio.gp_regression import Kernel
from wayfuse.radio.radio_map import (
    check_queries,
    locate_one,
    parts_error,
    query_vector,
    require,
    require_readings,
)
from wayfuse.radio.survey import Fingerprint, Fix, Survey

__all__ = ["FloorGrid", "GaussianProcessMap", "Noise", "fit"]

_MARGIN = 5.0  # m that the grid reaches beyond the survey
_UNKNOWN_SIGMA = 6.0  # dB, of an access point that a floor heard too rarely for a field of its own
_UNKNOWN_BELOW = 10.0  # dB below the limit of hearing: the mean of such an access point
_BLOCK = 4096  # grid nodes predicted at a time


@dataclass(frozen=True, slots=True)
class Noise:
    """How a query differs from the field.

    session_sigma : dB, difference between sessions, per access point. dof : degrees of freedom of Student-t.
    dropout : probability that a scan misses an audible access point. exponent : of the whole likelihood, in
    (0, 1], for errors of access points go together.

    A survey of one session cannot show how sessions differ: leaving out its own places asks for no
    session_sigma at all. The defaults are the best of a grid search on HCXY and SYL (six tables of
    SODIndoorLoc, training and test sessions); CETC331 took no part in it.
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
class FloorGrid:
    """Field of one floor on grid nodes (r rows along y, c columns along x, node = row * c + column).

    origin (2,) m of node 0; step m; shape (r, c); mean (r * c, m) dBm; sigma (r * c, m) dB of a query
    reading; silence (r * c, m) log probability of not hearing; near (r * c,): close to a surveyed place.
    """

    origin: Array
    step: float
    shape: tuple[int, int]
    mean: Array32
    sigma: Array32
    silence: Array32
    near: BoolArray
    total_silence: Array = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "total_silence", self.silence.sum(axis=1, dtype=np.float64))

    def nodes(self) -> Array:
        """(r * c, 2) m: the places of the nodes."""
        row, column = np.divmod(np.arange(self.shape[0] * self.shape[1]), self.shape[1])
        return self.origin + self.step * np.column_stack([column, row])

    def corners(self, xy: NDArray[np.floating]) -> tuple[NDArray[np.int64], Array]:
        """Nodes (N, 4) around places (N, 2), bilinear weights (N, 4); places outside move to the edge."""
        rows, columns = self.shape
        at = np.clip((np.asarray(xy, np.float64) - self.origin) / self.step, 0.0, [columns - 1, rows - 1])
        low = np.minimum(at.astype(np.int64), [max(columns - 2, 0), max(rows - 2, 0)])
        u, v = (at - low).T
        right, up = np.minimum(low[:, 0] + 1, columns - 1), np.minimum(low[:, 1] + 1, rows - 1)
        x, y = (low[:, 0], right, low[:, 0], right), (low[:, 1], low[:, 1], up, up)
        node = np.stack([j * columns + i for i, j in zip(x, y, strict=True)], axis=1)
        return node, np.stack([(1 - u) * (1 - v), u * (1 - v), (1 - u) * v, u * v], axis=1)


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
        grid = self.grids[floor]
        if grid is None:
            low = np.full((len(xy), len(self.bssid)), self.limit - _UNKNOWN_BELOW)
            return low, np.full_like(low, _UNKNOWN_SIGMA)
        node, weight = grid.corners(xy)
        mean = np.einsum("nk,nkm->nm", weight, grid.mean[node])
        sigma = np.einsum("nk,nkm->nm", weight, grid.sigma[node])
        return mean, sigma

    def _log_node(self, grid: FloorGrid, z: Array, heard: NDArray[np.int64]) -> Array:
        """Tempered log-likelihood of readings z (h,) of columns ``heard`` at the nodes near a place."""
        nodes = np.flatnonzero(grid.near)
        at = np.ix_(nodes, heard)
        log_p = _log_student(z, grid.mean[at], grid.sigma[at], self.noise.dof)
        silent = grid.total_silence[nodes] - grid.silence[at].sum(axis=1, dtype=np.float64)
        return np.asarray(self.noise.exponent * (log_p + silent))

    def locate_all(self, rssi: NDArray[np.floating]) -> tuple[Array, NDArray[np.int32]]:
        """xy (q, 2) m and floor (q,) of queries (q, m) dBm: the posterior mean on the most probable floor."""
        queries = check_queries(rssi, len(self.bssid)).astype(np.float64)
        places = [None if g is None else g.nodes()[g.near] for g in self.grids]
        xy, floor = np.zeros((len(queries), 2)), np.zeros(len(queries), np.int32)
        for q, query in enumerate(queries):
            heard = np.flatnonzero(np.isfinite(query))
            best = -np.inf
            for level, grid in enumerate(self.grids):
                if grid is None:
                    continue
                log_p = self._log_node(grid, query[heard], heard)
                top = float(log_p.max())
                weight = np.exp(log_p - top)
                evidence = top + float(np.log(weight.sum() * grid.step**2))
                if evidence > best:
                    best, floor[q] = evidence, level
                    xy[q] = weight @ places[level] / weight.sum()
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
        from wayfuse.radio._grid_kernels import field_log_likelihood

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
                mean, sigma = np.full((1, len(z)), self.limit - _UNKNOWN_BELOW), np.array([[_UNKNOWN_SIGMA]])
                out[here] = _log_student(z, mean, sigma, self.noise.dof)[0]
                continue
            node, weight = grid.corners(places[here])
            part = np.empty(len(here))
            tables = (grid.mean, grid.sigma, grid.silence, grid.total_silence)
            field_log_likelihood(node, weight, *tables, heard, z, self.noise.dof, part)
            out[here] = part
        return self.noise.exponent * out

    def parts(self) -> tuple[str, Mapping[str, Any], Mapping[str, NDArray[Any]]]:
        """Kind, parameters and arrays for `wayfuse.radio.archive.save`."""
        n = self.noise
        noise = {"session_sigma": n.session_sigma, "dof": n.dof, "dropout": n.dropout, "exponent": n.exponent}
        header: dict[str, Any] = {"floors": list(self.floors), "kernel": list(self.kernel), "noise": noise}
        arrays: dict[str, NDArray[Any]] = {"bssid": self.bssid}
        steps: list[float | None] = []
        for level, grid in enumerate(self.grids):
            steps.append(None if grid is None else grid.step)
            if grid is not None:
                arrays[f"shape_{level}"] = np.array(grid.shape, np.int64)
                for name in _GRID_ARRAYS:
                    arrays[f"{name}_{level}"] = getattr(grid, name)
        return "gaussian_process", {**header, "steps": steps, "limit": self.limit}, arrays

    @classmethod
    def from_parts(cls, header: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]]) -> GaussianProcessMap:
        """The map of what `parts` gave; `ValueError` where they do not fit."""
        m = len(arrays["bssid"])
        grids: list[FloorGrid | None] = []
        for level, step in enumerate(header["steps"]):
            if step is None:
                grids.append(None)
                continue
            rows, columns = arrays[f"shape_{level}"].tolist()
            tables = {name: arrays[f"{name}_{level}"] for name in _GRID_ARRAYS}
            shapes = dict.fromkeys(_GRID_ARRAYS, (rows * columns, m)) | {
                "origin": (2,),
                "near": (rows * columns,),
            }
            if fault := parts_error(tables, shapes, "ffffb"):
                raise ValueError(fault)
            grids.append(FloorGrid(step=float(step), shape=(rows, columns), **tables))
        floors, kernel, noise = tuple(header["floors"]), Kernel(*header["kernel"]), Noise(**header["noise"])
        return cls(arrays["bssid"], floors, tuple(grids), kernel, noise, float(header["limit"]))


_GRID_ARRAYS = ("origin", "mean", "sigma", "silence", "near")


def _log_student(z: Array, mean: NDArray[np.floating], sigma: NDArray[np.floating], dof: float) -> Array:
    """(N,) log density of independent Student-t readings z (h,) around mean (N, h), constants dropped."""
    r = (z - mean) / sigma
    return np.asarray(
        (-0.5 * (dof + 1.0) * np.log1p(r * r / dof) - np.log(sigma)).sum(axis=1, dtype=np.float64)
    )


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
    grids = tuple(
        None if f is None else _grid(f, len(survey.bssid), fitted, noise, threshold, step, reach, max_nodes)
        for f in fields
    )
    return GaussianProcessMap(survey.bssid, survey.floors, grids, fitted, noise, threshold)


_LIMIT_QUANTILE = 0.2  # weak readings are a lucky sample: hearing begins to fail well above the weakest


def _grid(
    floor: FloorField,
    n_columns: int,
    kernel: Kernel,
    noise: Noise,
    limit: float,
    step: float,
    reach: float,
    max_nodes: int,
) -> FloorGrid:
    """Mean, spread and silence of all access points on the grid of a floor."""
    low, high = floor.xy.min(axis=0) - _MARGIN, floor.xy.max(axis=0) + _MARGIN
    spacing = max(step, float(np.sqrt(np.prod(high - low) / max_nodes)))
    columns, rows = (np.ceil((high - low) / spacing).astype(int) + 1).tolist()
    row, column = np.divmod(np.arange(rows * columns), columns)
    nodes = low + spacing * np.column_stack([column, row])
    mean = np.full((len(nodes), n_columns), limit - _UNKNOWN_BELOW, np.float32)
    sigma = np.full((len(nodes), n_columns), _UNKNOWN_SIGMA, np.float32)
    near = np.zeros(len(nodes), np.bool_)
    for start in range(0, len(nodes), _BLOCK):
        part = slice(start, start + _BLOCK)
        value, spread = floor.predict(nodes[part])
        mean[part, floor.columns] = value
        whole = np.sqrt(spread**2 + kernel.noise**2 + noise.session_sigma**2)
        sigma[part, floor.columns] = whole[:, None]
        squared = ((nodes[part, None] - floor.xy[None]) ** 2).sum(axis=-1)
        near[part] = squared.min(axis=1) <= max(reach, spacing) ** 2
    silence = log_silence(mean, sigma, limit, noise.dropout).astype(np.float32)
    return FloorGrid(low, spacing, (rows, columns), mean, sigma, silence, near)
