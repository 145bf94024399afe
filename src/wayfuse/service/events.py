"""The stream of changes: a ring of the last events that every client reads at its own pace.

The identifier of an event is the ``seq`` of the entry of the log that caused it. After a crash the log gives the same
events the same identifiers, so a client that resumes, even with a server that was killed, misses none and gets none
twice, as long as the ring holds them.
"""

from __future__ import annotations

import asyncio
from bisect import bisect_right
from collections.abc import AsyncIterator, Collection
from operator import attrgetter
from typing import NamedTuple

__all__ = ["Event", "Hub"]


class Event(NamedTuple):
    """A change of a track, as JSON: the feature of its latest position, or a zone that it entered or left."""

    id: int
    site: str
    track: str
    data: bytes
    kind: str = "position"  # or "zone"


class Hub:
    """The ring; used from one event loop.

    Parameters
    ----------
    size : events kept. last : the identifier before the first event to come.
    """

    def __init__(self, size: int, last: int = 0) -> None:
        self._size = size
        self._ring: list[Event] = []
        self._dropped = last  # identifier of the last event that is no longer here
        self._last = last
        self._fresh = asyncio.Event()
        self._closed = False
        self.n_clients = 0

    @property
    def last(self) -> int:
        """Identifier of the newest event."""
        return self._last

    def publish(self, events: list[Event], last: int) -> None:
        """Add events, in the order of their identifiers; ``last`` : up to where the log has been read."""
        self._ring += events
        self._last = max(self._last, last)
        if len(self._ring) > 2 * self._size:
            self._dropped = self._ring[-self._size - 1].id
            del self._ring[: -self._size]
        self._wake()

    def forget(self, tracks: Collection[str]) -> None:
        """Take the places out of what was said of tracks."""
        self._ring = [e._replace(data=b"{}", track="") if e.track in tracks else e for e in self._ring]

    def close(self) -> None:
        """End all streams."""
        self._closed = True
        self._wake()

    def _wake(self) -> None:
        fresh, self._fresh = self._fresh, asyncio.Event()
        fresh.set()

    def holds_after(self, last: int) -> bool:
        """Whether all events after an identifier are still here."""
        return self._dropped <= last <= self._last

    def held_after(self, last: int) -> list[Event]:
        """Events after an identifier that are here already."""
        return self._ring[bisect_right(self._ring, last, key=attrgetter("id")) :]

    async def after(self, last: int, beat: float) -> AsyncIterator[list[Event]]:
        """Events after an identifier, as they come, in lists; an empty list after each ``beat`` s of silence.

        A client so slow that the ring has moved on is told by the end of the stream, and resumes.
        """
        self.n_clients += 1
        try:
            while not self._closed and last >= self._dropped:
                if events := self.held_after(last):
                    last = events[-1].id
                    yield events
                    continue
                fresh = self._fresh
                try:
                    async with asyncio.timeout(beat):
                        await fresh.wait()
                except TimeoutError:
                    yield []
        finally:
            self.n_clients -= 1
