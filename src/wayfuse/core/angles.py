"""Angles: headings in (-pi, pi], counter-clockwise from building +x; azimuths clockwise from north at the edges.

>>> round(float(wrap(3 * np.pi / 2)), 4)
-1.5708
>>> round(float(heading_from_azimuth(0.0)), 4)
1.5708
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from wayfuse.core.types import Array

__all__ = ["azimuth_from_heading", "heading_from_azimuth", "wrap"]


def wrap(angle: ArrayLike) -> Array:
    """Wrap angles (rad, any shape) into (-pi, pi]."""
    a = np.asarray(angle, dtype=np.float64)
    return np.asarray(np.pi - np.mod(np.pi - a, 2.0 * np.pi))


def heading_from_azimuth(azimuth: ArrayLike) -> Array:
    """Heading (rad, counter-clockwise from east) of an azimuth (rad, clockwise from north)."""
    return wrap(0.5 * np.pi - np.asarray(azimuth, dtype=np.float64))


def azimuth_from_heading(heading: ArrayLike) -> Array:
    """Azimuth in (-pi, pi] (rad, clockwise from north) of a heading (rad, counter-clockwise from east)."""
    return heading_from_azimuth(heading)
