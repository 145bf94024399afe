"""Limits of requests: how often, and how many bytes."""

from __future__ import annotations

import asyncio
from collections import OrderedDict
from collections.abc import Callable

from fastapi import Request

from wayfuse.service.problems import Problem

__all__ = ["RateLimit", "read_body"]

_READ_S = 30.0  # to send a whole body


class RateLimit:
    """Token buckets by key: ``rate`` per second, ``burst`` at once; ``clock`` gives seconds that only rise."""

    def __init__(self, rate: float, burst: int, clock: Callable[[], float], keys: int = 10_000) -> None:
        self._rate, self._burst, self._clock, self._keys = rate, float(burst), clock, keys
        self._buckets: OrderedDict[str, tuple[float, float]] = OrderedDict()  # least recently used first

    def wait(self, key: str) -> float:
        """Take one; s until there is one to take, 0.0 where there was."""
        if self._rate <= 0.0:
            return 0.0
        now = self._clock()
        level, then = self._buckets.pop(key, (self._burst, now))
        level = min(self._burst, level + (now - then) * self._rate)
        wait = 0.0 if level >= 1.0 else (1.0 - level) / self._rate
        self._buckets[key] = (level - 1.0 if wait == 0.0 else level, now)
        while len(self._buckets) > self._keys:
            self._buckets.popitem(last=False)
        return wait


async def read_body(request: Request, limit: int) -> bytes:
    """The body of a request.

    Raises
    ------
    Problem : it is longer than ``limit`` bytes, packed, or comes too slowly.
    """
    if request.headers.get("content-encoding", "identity") != "identity":
        raise Problem(415, "the body is packed", "send it as it is")
    too_long = Problem(413, f"the body is longer than {limit} bytes", "send smaller bodies")
    declared = request.headers.get("content-length", "0")
    if not declared.isdecimal() or len(declared) > 12 or int(declared) > limit:
        raise too_long
    parts, n = [], 0
    try:
        async with asyncio.timeout(_READ_S):
            async for part in request.stream():
                n += len(part)
                if n > limit:
                    raise too_long
                parts.append(part)
    except TimeoutError:
        raise Problem(408, "the body came too slowly", "send it again") from None
    return b"".join(parts)
