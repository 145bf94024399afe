"""First clouds by places of access points: told, drawn from a sequence, or anywhere on the floor that is heard best."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.philox import Noise
from wayfuse.core.types import Array
from wayfuse.filters.cloud import Cloud
from wayfuse.maps.walkable import Walkable
from wayfuse.models.initial import KnownStart
from wayfuse.models.observation.placed_aps import SequenceLikelihood
from wayfuse.radio.ap_hearing import hear, loudest_floor
from wayfuse.radio.ap_places import ApPlaces
from wayfuse.radio.survey import Fingerprint

__all__ = ["AnywhereOnFloor", "SequenceStart", "ToldStart"]


@dataclass(frozen=True, slots=True, kw_only=True)
class ToldStart:
    """A place that is told.

    Parameters
    ----------
    about : the place, and how far from it somebody may be. has_compass : False = the heading is unknown whatever the
    phone says.
    """

    about: KnownStart
    has_compass: bool = True

    def at(self, x: float, y: float, floor: int) -> ToldStart:
        """The same about another place: x, y (m), floor index."""
        return replace(self, about=replace(self.about, x=x, y=y, floor=floor))

    def draw(self, noise: Noise, seen: object, n: int, *, heading_known: bool) -> Cloud:  # noqa: ARG002
        """n particles about the place; what was seen does not matter."""
        return replace(self.about, heading_known=heading_known and self.has_compass).draw(noise, n)


@dataclass(frozen=True, slots=True, kw_only=True)
class SequenceStart:
    """Drawn from the mixture of a scan on the floor that is heard best. bias_sigma : rad, of the phone's heading."""

    observation: SequenceLikelihood
    bias_sigma: float

    def draw(self, noise: Noise, seen: object, n: int, *, heading_known: bool) -> Cloud | None:
        """n particles; None where the scan holds too few access points of known places."""
        if not isinstance(seen, Fingerprint):
            return None
        of = self.observation
        heard = hear(of.places, seen)
        floor = loudest_floor(of.places, heard, len(of.extents))
        near = of.neighbours(heard, floor)
        if near is None:
            return None
        weight = np.exp(near.log_weight - near.log_weight.max())
        chosen = np.searchsorted(np.cumsum(weight) / weight.sum(), noise.uniforms(n)[0])
        place = near.xy[np.minimum(chosen, len(weight) - 1)]
        x0, y0, x1, y1 = of.extents[floor]
        xy = place + of.precision**-0.5 * noise.normals(n)[:2].T
        return _cloud(
            noise, np.clip(xy, (x0, y0), (x1, y1)), floor, self.bias_sigma, heading_known=heading_known
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class AnywhereOnFloor:
    """Uniform over the walkable space of the floor that is heard best, the heading unknown. walkable : per floor."""

    places: ApPlaces
    walkable: tuple[Walkable, ...]

    def draw(self, noise: Noise, seen: object, n: int, *, heading_known: bool) -> Cloud | None:  # noqa: ARG002
        """n particles; None where the scan holds no access point of known place."""
        if not isinstance(seen, Fingerprint):
            return None
        heard = hear(self.places, seen)
        if not len(heard.row):
            return None
        floor = loudest_floor(self.places, heard, len(self.walkable))
        centres, u = self.walkable[floor].centres(), noise.uniforms(n)
        if not len(centres):
            return None
        cell = np.minimum((u[0] * len(centres)).astype(np.int64), len(centres) - 1)
        xy = centres[cell] + (u[1:3].T - 0.5) * self.walkable[floor].cell
        return _cloud(noise, xy, floor, 0.0, heading_known=False)


def _cloud(
    noise: Noise, xy: NDArray[np.floating] | Array, floor: int, bias_sigma: float, *, heading_known: bool
) -> Cloud:
    """Particles at places (n, 2) m with headings from their prior."""
    about = KnownStart(
        x=0.0,
        y=0.0,
        floor=floor,
        sigma=0.0,
        bias_sigma=bias_sigma,
        scale_sigma=0.0,
        heading_known=heading_known,
    )
    x, y = xy.T.astype(np.float32)
    return about.draw(noise, len(xy))._replace(x=x, y=y)
