"""Formats that phones and anchors send, and their names in the log and in addresses."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from wayfuse.service.adapters import (
    anchors,
    espresense,
    find3,
    find3_passive,
    getsensordata,
    intel5300,
    own,
    sensor_logger,
)
from wayfuse.service.message import Adapter

__all__ = ["ADAPTERS"]

ADAPTERS: Mapping[str, Adapter] = MappingProxyType(
    {
        "own": own.Own(),
        "sensor-logger": sensor_logger.SensorLogger(),
        "find3": find3.Find3(),
        "find3-passive": find3_passive.Find3Passive(),
        "getsensordata": getsensordata.GetSensorData(),
        "anchors": anchors.Anchors(),
        "espresense": espresense.Espresense(),
        "intel5300": intel5300.Intel5300(),
    }
)
