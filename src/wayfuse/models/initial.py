"""The first cloud: places from the first scan or a start that is told, headings and step scales from their priors."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.errors import ConfigError
from wayfuse.core.philox import Noise
from wayfuse.core.types import Array, Array32, BoolArray
from wayfuse.filters.cloud import Cloud
from wayfuse.maps.walkable import Walkable
from wayfuse.models.observation.fingerprint import FingerprintLikelihood
from wayfuse.radio.sparse_knn import Neighbours

__all__ = ["Anywhere", "FirstCloud", "KnownStart"]

_SPARE = 4  # places drawn per particle; a quarter to a third of a floor is walkable, near the survey more


@dataclass(frozen=True, slots=True, kw_only=True)
class FirstCloud:
    """Draws particles where a scan says; used at the start and for fresh particles later.

    Parameters
    ----------
    observation : the model whose mixture is drawn from. walkable : mask per floor, empty = no map.
    bias_sigma : rad, heading bias of the phone in a hand. scale_sigma : spread of the step scale about 1.
    heading_unknown : draw the bias over the whole circle (no absolute heading).
    """

    observation: FingerprintLikelihood
    walkable: tuple[Walkable, ...] = ()
    bias_sigma: float = 0.25
    scale_sigma: float = 0.1

    def __post_init__(self) -> None:
        if self.bias_sigma < 0.0 or self.scale_sigma < 0.0:
            raise ConfigError("bias_sigma and scale_sigma must not be negative", where="FirstCloud")

    def draw(self, noise: Noise, near: Neighbours, n: int, *, heading_known: bool = True) -> Cloud:
        """n particles for the neighbours of a scan; without an absolute heading the bias is uniform."""
        spare = _SPARE if self.walkable else 1
        x, y, floor = self.observation.draw_places(noise, near, spare * n)
        if self.walkable:
            # the first n that are walkable; where there are fewer, the rest is made up of others (no plan is perfect)
            good = self._is_walkable(x, y, floor)
            chosen = np.flatnonzero(good)[:n]
            if len(chosen) < n:
                chosen = np.concatenate([chosen, np.flatnonzero(~good)[: n - len(chosen)]])
            x, y, floor = x[chosen], y[chosen], floor[chosen]
        bias, scale = _gait(noise, n, self.bias_sigma, self.scale_sigma, heading_known=heading_known)
        return Cloud.on_floors(x, y, bias, scale, floor)

    def _is_walkable(self, x: Array32, y: Array32, floor: NDArray[np.int32]) -> BoolArray:
        inside = np.zeros(len(x), dtype=bool)
        for f in np.unique(floor):
            rows = floor == f
            inside[rows] = self.walkable[f].contains(x[rows], y[rows])
        return inside


@dataclass(frozen=True, slots=True, kw_only=True)
class KnownStart:
    """Draws particles around a place that is told: a door, a desk, the first waypoint.

    Parameters
    ----------
    x, y : m, frame of the floor. floor : index. sigma : m. heading_known : whether the phone has an absolute heading.
    """

    x: float = 0.0
    y: float = 0.0
    floor: int = 0
    sigma: float = 1.0
    bias_sigma: float = 0.25
    scale_sigma: float = 0.1
    heading_known: bool = True

    def __post_init__(self) -> None:
        if not (self.sigma >= 0.0 and self.bias_sigma >= 0.0 and self.scale_sigma >= 0.0):
            raise ConfigError("sigma, bias_sigma and scale_sigma must not be negative", where="KnownStart")

    def draw(self, noise: Noise, n: int) -> Cloud:
        """n particles around the place."""
        z = noise.normals(n)
        x = (np.float32(self.x) + np.float32(self.sigma) * z[0]).astype(np.float32)
        y = (np.float32(self.y) + np.float32(self.sigma) * z[1]).astype(np.float32)
        bias, scale = _gait(noise, n, self.bias_sigma, self.scale_sigma, heading_known=self.heading_known)
        return Cloud.on_floors(x, y, bias, scale, np.full(n, self.floor, np.int32))


@dataclass(frozen=True, slots=True, kw_only=True)
class Anywhere:
    """Draws particles uniformly over the walkable space of all floors: nothing is known but the building.

    Parameters
    ----------
    walkable : mask per floor. bias_sigma, scale_sigma : as of `FirstCloud`.
    """

    walkable: tuple[Walkable, ...]
    bias_sigma: float = 0.25
    scale_sigma: float = 0.1
    _centres: Array = field(init=False, repr=False)
    _floor: NDArray[np.int32] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        centres = [floor.centres() for floor in self.walkable]
        if not sum(len(c) for c in centres):
            raise ConfigError("no floor has walkable space", where="Anywhere", remedy="check the plan")
        object.__setattr__(self, "_centres", np.concatenate(centres))
        object.__setattr__(self, "_floor", np.repeat(np.arange(len(centres)), [len(c) for c in centres]))

    def draw(self, noise: Noise, n: int, *, heading_known: bool = True) -> Cloud:
        """n particles, each in a cell of its own drawing."""
        u = noise.uniforms(n)
        cell = np.minimum((u[0] * len(self._floor)).astype(np.int64), len(self._floor) - 1)
        floor = self._floor[cell].astype(np.int32)
        edge = np.array([walkable.cell for walkable in self.walkable])[floor]
        jitter = (u[0] * len(self._floor)) % 1.0  # what the cell leaves of the first uniform is uniform too
        x = self._centres[cell, 0] + edge * (jitter - 0.5)
        y = self._centres[cell, 1] + edge * (u[1] - 0.5)
        bias, scale = _gait(noise, n, self.bias_sigma, self.scale_sigma, heading_known=heading_known)
        return Cloud.on_floors(x.astype(np.float32), y.astype(np.float32), bias, scale, floor)


def _gait(
    noise: Noise, n: int, bias_sigma: float, scale_sigma: float, *, heading_known: bool
) -> tuple[Array32, Array32]:
    """Heading biases and step scales (n,) from their priors."""
    z = noise.normals(n)
    if heading_known:
        bias = np.float32(bias_sigma) * z[0]
    else:
        bias = ((noise.uniforms(n)[0] * 2.0 - 1.0) * np.pi).astype(np.float32)
    scale = np.maximum(np.float32(1.0) + np.float32(scale_sigma) * z[1], np.float32(0.4))
    return bias, scale
