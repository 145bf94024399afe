"""What a ray tracer says of a building, kept on rasters: mean levels, and the rays of the channel.

The tracer itself is `wayfuse.simulator.ray_tracer`; nothing here needs it. Levels are read bilinearly in dB, so that
they are steady along a walk; the rays of a place are those of the raster's nearest one.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.types import Array, IntArray
from wayfuse.simulator.multipath import Taps
from wayfuse.simulator.toml_tables import no_negative, require

__all__ = ["MATERIALS", "SILENT_DB", "ChannelRays", "Raster", "RayField", "RaysModel"]

MATERIALS = (  # of ITU-R P.2040
    "brick", "ceiling_board", "chipboard", "concrete", "floorboard", "glass", "marble", "metal", "plasterboard",
    "plywood", "wood",
)  # fmt: skip
SILENT_DB = -150.0  # gain where no ray arrives


@dataclass(frozen=True, slots=True, kw_only=True)
class RaysModel:
    """Ray tracing in the building itself; walls and slabs are flat, of one material each (ITU-R P.2040)."""

    wall_material: str = field(default="plasterboard", metadata={"one_of": MATERIALS})
    wall_m: float = 0.1  # m, thickness
    slab_material: str = field(default="concrete", metadata={"one_of": MATERIALS})
    slab_m: float = 0.2  # m
    raster_m: float = 1.0  # m between the places that levels are traced for
    interactions: int = 12  # most walls and slabs that a ray is reflected by or goes through
    samples: int = 1_000_000  # rays sent out for each antenna and storey
    channel_raster_m: float = 2.0  # m between the places that rays of the channel state are traced for
    channel_interactions: int = 2  # of such a ray

    def __post_init__(self) -> None:
        no_negative(self)
        sizes = self.wall_m, self.slab_m, self.raster_m, self.channel_raster_m
        require(
            "wall_m, slab_m, raster_m, channel_raster_m", min(sizes) > 0.0, sizes, "positive lengths in m"
        )
        require("samples", 1_000 <= self.samples <= 100_000_000, self.samples, "from 1e3 to 1e8")
        depths = self.interactions, self.channel_interactions
        require("interactions, channel_interactions", max(depths) <= 20, depths, "at most 20")


@dataclass(frozen=True, slots=True)
class Raster:
    """Places in rows and columns: the middles of squares of ``size`` m from x0, y0 (m) on."""

    x0: float
    y0: float
    size: float
    columns: int
    rows: int

    @classmethod
    def over(cls, outline: Array, size: float) -> Raster:
        """The raster that covers an outline (n, 2) m."""
        low, high = outline.min(axis=0), outline.max(axis=0)
        columns, rows = (max(1, int(np.ceil(n - 1e-9))) for n in (high - low) / size)
        return cls(float(low[0]), float(low[1]), size, columns, rows)

    @property
    def places(self) -> Array:
        """(rows x columns, 2) m, row by row."""
        x = self.x0 + self.size * (np.arange(self.columns) + 0.5)
        y = self.y0 + self.size * (np.arange(self.rows) + 0.5)
        return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)

    def position(self, xy: Array) -> tuple[Array, Array]:
        """Column and row (m,), (m,) of places (m, 2) m, broken, kept between the first and the last."""
        column = np.clip((xy[:, 0] - self.x0) / self.size - 0.5, 0.0, self.columns - 1.0)
        row = np.clip((xy[:, 1] - self.y0) / self.size - 0.5, 0.0, self.rows - 1.0)
        return column, row


@dataclass(frozen=True, slots=True, eq=False)
class ChannelRays:
    """Rays of each antenna at each place of a raster, the strongest k: (a, rows x columns, k).

    delay : ns. amplitude : complex, without the turn of the way; 0 where there is no ray. azimuth : rad, where from.
    """

    raster: Raster
    delay: NDArray[np.float32]
    amplitude: NDArray[np.complex64]
    azimuth: NDArray[np.float32]

    def taps(self, antenna: int, xy: Array) -> Taps | None:
        """The channel of mean power 1 at a place (2,) m; None where no ray arrives."""
        column, row = self.raster.position(xy[None])
        place = int(np.rint(row[0])) * self.raster.columns + int(np.rint(column[0]))
        amplitude = self.amplitude[antenna, place]
        there = amplitude != 0.0
        if not there.any():
            return None
        power = float(np.sum(np.abs(amplitude[there]) ** 2))
        return Taps(
            self.delay[antenna, place, there].astype(np.float64),
            amplitude[there].astype(np.complex128) / np.sqrt(power),
            self.azimuth[antenna, place, there].astype(np.float64),
        )


@dataclass(frozen=True, slots=True, eq=False)
class RayField:
    """Of all radios of a building: gain[floor] (r, rows, columns) dB over free space at 1 m, on rasters[floor].

    channels[floor] : of all radios; none where no channel state is asked for.
    """

    rasters: tuple[Raster, ...]
    gain: tuple[NDArray[np.float32], ...]
    channels: tuple[ChannelRays, ...] = ()

    def level(self, radio: IntArray, xy: Array, floor: int) -> Array:
        """Gain (m,) dB of radios (m,) at places (m, 2) m of a floor, bilinear."""
        raster, gain = self.rasters[floor], self.gain[floor]
        column, row = raster.position(xy)
        j = np.minimum(column.astype(np.int64), max(0, raster.columns - 2))
        i = np.minimum(row.astype(np.int64), max(0, raster.rows - 2))
        j1, i1 = np.minimum(j + 1, raster.columns - 1), np.minimum(i + 1, raster.rows - 1)
        right, up = column - j, row - i
        lower = gain[radio, i, j] * (1.0 - right) + gain[radio, i, j1] * right
        upper = gain[radio, i1, j] * (1.0 - right) + gain[radio, i1, j1] * right
        return np.asarray(lower * (1.0 - up) + upper * up, dtype=np.float64)
