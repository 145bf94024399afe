"""What a phone's sensors said, in the columns of a recording: no more precise than the file that is written of it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from wayfuse.core.types import Array
from wayfuse.sensors.recording import Recording, Series
from wayfuse.simulator.barometer import PressureSamples
from wayfuse.simulator.imu import ImuSamples

__all__ = ["sensed"]


def sensed(
    name: str, imu: ImuSamples, t: Array, decimals: Mapping[str, int], air: PressureSamples | None = None
) -> Recording:
    """A recording of the motion sensors and the barometer alone, with the reader's w of the orientation.

    Parameters
    ----------
    t : (n,) s, the motion sensors' times on the recording's clock.
    decimals : of each column's values; ``"time"`` of the times of ``air`` (pressure), where there is a barometer.
    """
    x, y, z = np.round(imu.orientation[:, 1:], decimals["orientation"]).T
    w = np.sqrt(np.maximum(0.0, 1 - x * x - y * y - z * z))
    pressure = Series.empty(1)
    if air is not None:
        pressure = Series(np.round(air.t, decimals["time"]), np.round(air.hpa[:, None], decimals["pressure"]))
    return Recording(
        name=name,
        acceleration=Series(t, np.round(imu.acceleration, decimals["acceleration"])),
        rotation_rate=Series(t, np.round(imu.rotation_rate, decimals["rotation_rate"])),
        magnetic_field=Series(t, np.round(imu.magnetic_field, decimals["magnetic_field"])),
        orientation=Series(t, np.column_stack([w, x, y, z])),
        pressure=pressure,
    )
