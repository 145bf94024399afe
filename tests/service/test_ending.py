"""Tasks of the server end when they are told to, also when they are busy with an error at that moment."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from types import SimpleNamespace
from typing import Any

import aiomqtt
import pytest

from wayfuse.service import mqtt
from wayfuse.service.app import _end


def test_a_connection_that_breaks_while_it_is_ended_ends_all_the_same(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    n_connected = 0

    @asynccontextmanager
    async def breaks_at_its_end(*_: Any) -> AsyncIterator[None]:
        nonlocal n_connected
        n_connected += 1
        try:
            yield None
        finally:
            raise aiomqtt.MqttError("gone")

    async def talk(*_: Any) -> None:
        await asyncio.sleep(3600.0)

    monkeypatch.setattr(mqtt, "_client", breaks_at_its_end)
    monkeypatch.setattr(mqtt, "_talk", talk)
    server: Any = SimpleNamespace(
        is_ending=False, settings=SimpleNamespace(mqtt="mqtt://localhost", mqtt_prefix="wayfuse")
    )

    async def run() -> bool:
        task = asyncio.create_task(mqtt.keep_connected(server))
        await asyncio.sleep(0.05)
        server.is_ending = True
        await asyncio.wait_for(_end([task]), 20.0)
        return task.done()

    assert asyncio.run(run())
    assert n_connected == 1


def test_who_misses_the_first_word_hears_the_second(caplog: pytest.LogCaptureFixture) -> None:
    async def deaf_once() -> None:
        try:
            await asyncio.sleep(3600.0)
        except asyncio.CancelledError:
            await asyncio.sleep(3600.0)

    async def broken() -> None:
        raise OSError("no disk")

    async def run() -> None:
        tasks = [asyncio.create_task(deaf_once()), asyncio.create_task(broken())]
        await asyncio.sleep(0.01)
        await asyncio.wait_for(_end(tasks), 10.0)
        assert tasks[0].cancelled()

    asyncio.run(run())
    assert "no disk" in caplog.text
