"""Enrolled phones: what their batches do not say of themselves. Phones are known by pseudonyms only."""

from __future__ import annotations

from typing import NamedTuple

from sqlalchemy import Engine, delete, insert, select

from wayfuse.core.errors import UsageError
from wayfuse.storage.schema import devices

__all__ = ["Device", "DeviceStore"]

PLATFORMS = ("", "android", "ios")


class Device(NamedTuple):
    """A phone. platform : ``android``, ``ios``, or empty where not stated. standardised : its app converts to Android's
    axes. ``label`` is what the operator calls it."""

    device: str
    platform: str = ""
    standardised: bool = False
    label: str = ""
    enrolled: float = 0.0


class DeviceStore:
    """Phones of a database."""

    def __init__(self, engine: Engine) -> None:
        self._engine = engine

    def enrol(self, device: Device) -> None:
        """Keep a phone, or what is new about it.

        Raises
        ------
        UsageError : unknown platform.
        """
        if device.platform not in PLATFORMS:
            raise UsageError(
                f"unknown platform {device.platform!r}", where="platform", remedy="use android or ios"
            )
        with self._engine.begin() as connection:
            connection.execute(delete(devices).where(devices.c.device == device.device))
            connection.execute(insert(devices).values(**device._asdict()))

    def get(self, device: str) -> Device | None:
        """A phone by its pseudonym."""
        with self._engine.connect() as connection:
            row = connection.execute(select(devices).where(devices.c.device == device)).first()
        return None if row is None else Device(*row)

    def all(self) -> list[Device]:
        """All phones, in the order of their enrolment."""
        with self._engine.connect() as connection:
            rows = connection.execute(select(devices).order_by(devices.c.enrolled, devices.c.device))
            return [Device(*row) for row in rows]

    def remove(self, device: str) -> bool:
        """Forget a phone; whether it was known."""
        with self._engine.begin() as connection:
            return bool(connection.execute(delete(devices).where(devices.c.device == device)).rowcount)
