"""The walkable mask stops particles: the middle and the end of each move are looked up.

Coarser than `barriers`: it lets a particle jump over what is thinner than half a step. On the public floor plans that
is a virtue: they show shops without doors, and some of the surveyors' own lines cross a drawn barrier, which an exact
test forbids for good (rows ``fused`` and ``fused-barriers`` of docs/results.md). For plans
with doors and true walls use `Barriers`.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.errors import ConfigError
from wayfuse.core.types import Array
from wayfuse.filters.cloud import Cloud
from wayfuse.maps.walkable import Walkable
from wayfuse.models._kernels import block_on_mask

__all__ = ["WalkableMask"]


@dataclass(frozen=True, slots=True)
class WalkableMask:
    """One mask per floor; a particle whose step leaves it stays where it was and loses log-weight.

    Parameters
    ----------
    masks : walkable mask of each floor, bottom up. penalty : nats lost per blocked move.
    """

    masks: tuple[Walkable, ...]
    penalty: float = 1.2
    _packed: NDArray[np.uint8] = field(init=False, repr=False, compare=False)
    _start: NDArray[np.int64] = field(init=False, repr=False, compare=False)
    _nx: NDArray[np.int64] = field(init=False, repr=False, compare=False)
    _ny: NDArray[np.int64] = field(init=False, repr=False, compare=False)
    _x0: Array = field(init=False, repr=False, compare=False)
    _y0: Array = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        if not self.masks or len({m.cell for m in self.masks}) != 1:
            raise ConfigError("the masks of all floors must have one cell size", where="WalkableMask")
        if not self.penalty >= 0.0:
            raise ConfigError(f"penalty must not be negative, got {self.penalty}", where="WalkableMask")
        sizes = [m.mask.size for m in self.masks]
        for name, value in {
            "_packed": np.concatenate([m.mask.ravel() for m in self.masks]),
            "_start": np.cumsum([0, *sizes[:-1]]).astype(np.int64),
            "_nx": np.array([m.mask.shape[1] for m in self.masks], np.int64),
            "_ny": np.array([m.mask.shape[0] for m in self.masks], np.int64),
            "_x0": np.array([m.origin[0] for m in self.masks], np.float64),
            "_y0": np.array([m.origin[1] for m in self.masks], np.float64),
        }.items():
            object.__setattr__(self, name, value)

    def restrict(self, before: Cloud, after: Cloud, log_weights: Array) -> tuple[Cloud, int]:
        """Undo the moves that leave the mask of the particle's floor."""
        x, y = after.x.copy(), after.y.copy()
        n = block_on_mask(
            before.x,
            before.y,
            x,
            y,
            before.floor,
            self._packed,
            self._start,
            self._nx,
            self._ny,
            self._x0,
            self._y0,
            self.masks[0].cell,
            self.penalty,
            log_weights,
        )
        return after._replace(x=x, y=y), n
