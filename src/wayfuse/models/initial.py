"""The first cloud: places from the first scan, headings and step scales from their priors."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.errors import ConfigError
from wayfuse.core.philox import Noise
from wayfuse.core.types import Array32, BoolArray
from wayfuse.filters.cloud import Cloud
from wayfuse.maps.walkable import Walkable
from wayfuse.models.observation.fingerprint import FingerprintLikelihood
from wayfuse.radio.sparse_knn import Neighbours

__all__ = ["FirstCloud"]

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
        z = noise.normals(n)
        if heading_known:
            bias = np.float32(self.bias_sigma) * z[0]
        else:
            bias = ((noise.uniforms(n)[0] * 2.0 - 1.0) * np.pi).astype(np.float32)
        scale = np.maximum(np.float32(1.0) + np.float32(self.scale_sigma) * z[1], np.float32(0.4))
        return Cloud.on_floors(x, y, bias, scale, floor)

    def _is_walkable(self, x: Array32, y: Array32, floor: NDArray[np.int32]) -> BoolArray:
        inside = np.zeros(len(x), dtype=bool)
        for f in np.unique(floor):
            rows = floor == f
            inside[rows] = self.walkable[f].contains(x[rows], y[rows])
        return inside
