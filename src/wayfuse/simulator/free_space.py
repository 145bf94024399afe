"""What free space takes from a wave: the reference that levels in a building are told against."""

from __future__ import annotations

import numpy as np

__all__ = ["LIGHT", "first_metre_db"]

LIGHT = 299_792_458.0  # m/s


def first_metre_db(carrier: float) -> float:
    """Loss (dB) of the first metre between antennas that radiate alike in all directions (Friis); carrier : Hz."""
    return 20.0 * float(np.log10(4.0 * np.pi * carrier / LIGHT))
