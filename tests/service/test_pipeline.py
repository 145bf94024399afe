"""The thread between the network and the tracks, with a log and tracks that can fail; the ring; the buckets."""

from __future__ import annotations

import asyncio
import itertools
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from types import SimpleNamespace
from typing import Any, cast

import pytest
from service_running import wait_until
from sqlalchemy.exc import OperationalError

from wayfuse.core.errors import ConfigError
from wayfuse.service.events import Event, Hub
from wayfuse.service.limits import RateLimit
from wayfuse.service.message import Message
from wayfuse.service.pipeline import BusyError, Item, Pipeline, PipelineConfig
from wayfuse.service.routes.stream import _lines
from wayfuse.service.server import Server
from wayfuse.storage.log import Entry

AWAY = OperationalError("statement", {}, Exception("away"))


class Fake:
    """A log, live tracks and a track store in one, that remember what was asked, and fail on demand."""

    def __init__(self) -> None:
        self.logged: list[int] = []
        self.groups: list[int] = []
        self.applied: list[int] = []
        self.saved: list[tuple[int, list[Any]]] = []
        self.rounds: list[int] = []
        self.fail_append = self.fail_apply = self.fail_save = 0
        self.gate = threading.Event()
        self.gate.set()

    def append(self, entries: list[Entry]) -> None:
        """Of the log."""
        self.gate.wait(30)
        if self.fail_append:
            self.fail_append -= 1
            raise AWAY
        self.logged += [e.seq for e in entries]
        self.groups.append(len(entries))

    def apply(self, entry: Entry, _message: Message) -> None:
        """Of the tracks."""
        if self.fail_apply:
            self.fail_apply -= 1
            raise AWAY
        assert entry.seq in self.logged  # never before it is in the log
        self.applied.append(entry.seq)

    def changed(self) -> list[str]:
        """Of the tracks: two, always."""
        return ["a", "b"]

    def checkpoint(self, tracks: list[str]) -> list[str]:
        """Of the tracks."""
        return [f"{track} {len(self.applied)}" for track in tracks]

    def release(self, _before: float) -> int:
        """Of the tracks."""
        return 0

    def save(self, seq: int, kept: list[Any]) -> None:
        """Of the store."""
        if self.fail_save:
            self.fail_save -= 1
            raise AWAY
        self.saved.append((seq, list(kept)))

    def close_round(self, seq: int) -> None:
        """Of the store."""
        self.rounds.append(seq)


@contextmanager
def working(fake: Any, **config: Any) -> Iterator[Pipeline]:
    """A pipeline on the fake."""
    values = {"checkpoint_every": 1e6, "retry_every": 0.01} | config
    pipeline = Pipeline(
        fake,
        fake,
        fake,
        1,
        clock=itertools.count().__next__,  # a second passes whenever somebody looks
        publish=lambda *_: None,
        config=PipelineConfig(**values),
    )
    pipeline.start()
    yield pipeline
    pipeline.stop()


def _submit(pipeline: Pipeline, items: list[Item]) -> Future[list[int]]:
    done: Future[list[int]] = Future()
    pipeline.put(items, done)
    return done


def _item(size: int = 1) -> Item:
    return Item(Entry(0, 0.0, "s", "own", "d", "t", "{}", b"x" * size), Message("d", "", b"", ()))


def test_entries_are_logged_then_answered_then_applied_in_order() -> None:
    fake = Fake()
    with working(fake) as pipeline:
        futures = [_submit(pipeline, [_item()] * n) for n in (1, 3, 2)]
        assert [f.result(30) for f in futures] == [[1], [2, 3, 4], [5, 6]]
    assert fake.logged == fake.applied == [1, 2, 3, 4, 5, 6]
    assert fake.saved == [(6, ["a 6", "b 6"])]  # at the end
    assert fake.rounds == [6]


def test_after_a_group_of_several_more_is_waited_for() -> None:
    fake = Fake()
    fake.gate.clear()
    with working(fake, gather=60.0, enough=3) as pipeline:
        _submit(pipeline, [_item()])
        wait_until(lambda: pipeline.n_waiting == 0)  # taken, and held at the gate
        several = [_submit(pipeline, [_item()]) for _ in range(2)]
        fake.gate.set()
        assert [f.result(30) for f in several] == [[2], [3]]
        more = [_submit(pipeline, [_item()]) for _ in range(3)]
        assert [f.result(30) for f in more] == [[4], [5], [6]]  # enough: nothing more is waited for
        last = _submit(pipeline, [_item()])
        assert not last.done()
    assert last.result(0) == [7]  # nor at the end
    assert fake.groups == [1, 2, 3, 1]


def test_one_that_sends_alone_is_not_kept_waiting() -> None:
    fake = Fake()
    with working(fake, gather=60.0) as pipeline:
        assert [_submit(pipeline, [_item()]).result(30) for _ in range(5)] == [[n] for n in range(1, 6)]


def test_a_sender_that_has_gone_is_not_told() -> None:
    fake = Fake()
    fake.fail_append = 1  # of the first group
    with working(fake, group=1) as pipeline:
        for _ in range(2):  # one is refused, one accepted
            gone = Future[list[int]]()
            gone.cancel()
            pipeline.put([_item()], gone)
        assert _submit(pipeline, [_item()]).result(30) == [2]
    assert fake.applied == [1, 2]


def test_a_log_that_cannot_be_written_answers_busy_and_applies_nothing() -> None:
    fake = Fake()
    with working(fake) as pipeline:
        fake.fail_append = 1
        with pytest.raises(BusyError, match="cannot be written"):
            _submit(pipeline, [_item()]).result(30)
        assert _submit(pipeline, [_item()]).result(30) == [1]  # no gap in the numbers
    assert fake.applied == [1]


def test_a_database_that_is_away_delays_tracks_but_loses_nothing() -> None:
    fake = Fake()
    with working(fake) as pipeline:
        fake.fail_apply = 3
        _submit(pipeline, [_item()] * 2).result(30)
        wait_until(lambda: pipeline.applied == 2)
    assert fake.applied == [1, 2]


def test_a_checkpoint_that_cannot_be_written_is_written_later() -> None:
    fake = Fake()
    fake.fail_save = 1
    with working(fake, checkpoint_every=1.0) as pipeline:
        _submit(pipeline, [_item()]).result(30)
        wait_until(lambda: fake.rounds)
    assert fake.saved[:2] == [(1, ["a 1", "b 1"]), (1, [])]  # nothing that was drained is lost


def test_a_round_is_written_in_slices_between_groups() -> None:
    fake = Fake()
    with working(fake, checkpoint_every=5.0, slice=1) as pipeline:
        _submit(pipeline, [_item()]).result(30)
        wait_until(lambda: fake.rounds)
        _submit(pipeline, [_item()]).result(30)
    assert fake.saved[:2] == [(1, ["a 1"]), (1, ["b 1"])]
    assert fake.saved[-1] == (2, ["a 2", "b 2"])  # at the end all at once
    assert fake.rounds[0] == 1
    assert fake.rounds[-1] == 2


def test_too_much_that_waits_is_refused() -> None:
    fake = Fake()
    fake.gate.clear()
    with working(fake, max_waiting=3, group=1) as pipeline:
        first = _submit(pipeline, [_item()])
        wait_until(lambda: pipeline.n_waiting == 0)  # taken, and held at the gate
        more = [_submit(pipeline, [_item()]) for _ in range(3)]
        with pytest.raises(BusyError, match="busy"):
            _submit(pipeline, [_item()])
        fake.gate.set()
        assert [f.result(30) for f in [first, *more]] == [[1], [2], [3], [4]]


def test_bytes_that_wait_are_limited_but_one_body_always_fits() -> None:
    fake = Fake()
    fake.gate.clear()
    with working(fake, max_waiting_bytes=10, group=1) as pipeline:
        _submit(pipeline, [_item()])
        wait_until(lambda: pipeline.n_waiting == 0)
        large = _submit(pipeline, [_item(50)])
        with pytest.raises(BusyError):
            _submit(pipeline, [_item(1)])
        fake.gate.set()
        assert large.result(30) == [2]


def test_a_broken_pipeline_says_so_and_takes_nothing_more() -> None:
    fake = Fake()

    def broken(*_: Any) -> None:
        raise RuntimeError("a bug")

    pipeline = Pipeline(fake, fake, fake, 1, clock=lambda: 0.0, publish=broken)
    pipeline.start()
    assert _submit(pipeline, [_item()]).result(30) == [1]
    wait_until(lambda: pipeline.is_broken)
    with pytest.raises(BusyError):
        _submit(pipeline, [_item()])
    with pytest.raises(BusyError):
        pipeline.call(lambda: 1)
    pipeline.stop()


def test_calls_run_between_groups_and_their_errors_are_the_caller_s() -> None:
    with working(Fake()) as pipeline:
        assert pipeline.call(threading.get_ident).result(30) != threading.get_ident()
        with pytest.raises(ZeroDivisionError):
            pipeline.call(lambda: 1 // 0).result(30)
        assert _submit(pipeline, [_item()]).result(30) == [1]


@pytest.mark.parametrize("bad", [{"group": 0}, {"max_waiting": 0}, {"checkpoint_every": 0.0}])
def test_limits_are_checked(bad: dict[str, Any]) -> None:
    with pytest.raises(ConfigError):
        PipelineConfig(**bad)


# --- the ring -----------------------------------------------------------------------------------------------


def _run(story: Callable[[], Any]) -> None:
    asyncio.run(asyncio.wait_for(story(), 30.0))


def _event(n: int) -> Event:
    return Event(n, "s", "t", b"%d" % n)


def test_listeners_get_every_event_once_at_their_own_pace() -> None:
    async def story() -> None:
        hub = Hub(100)
        got: list[list[int]] = [[], []]

        async def listen(n: int, pause: float) -> None:
            async for some in hub.after(0, 5.0):
                got[n] += [e.id for e in some]
                await asyncio.sleep(pause)

        tasks = [asyncio.create_task(listen(0, 0.0)), asyncio.create_task(listen(1, 0.01))]
        for n in range(1, 51):
            hub.publish([_event(n)], n)
            await asyncio.sleep(0.0)
        while len(got[1]) < 50:
            await asyncio.sleep(0.01)
        assert hub.n_clients == 2
        hub.close()
        await asyncio.gather(*tasks)
        assert got == [list(range(1, 51))] * 2
        assert hub.n_clients == 0

    _run(story)


def test_a_listener_that_is_too_slow_is_ended_and_told_that_it_missed_some() -> None:
    async def story() -> None:
        hub = Hub(10)
        stream = hub.after(0, 5.0)
        hub.publish([_event(1)], 1)
        assert [e.id for e in await anext(stream)] == [1]
        hub.publish([_event(n) for n in range(2, 60)], 60)
        with pytest.raises(StopAsyncIteration):
            await anext(stream)
        assert not hub.holds_after(1)
        assert hub.holds_after(55)
        assert hub.holds_after(60)
        assert not hub.holds_after(61)

    _run(story)


def test_silence_is_told_and_forgotten_tracks_are_empty() -> None:
    async def story() -> None:
        hub = Hub(10)
        assert await anext(hub.after(0, 0.01)) == []
        hub.publish([_event(1)], 1)
        hub.forget({"t"})
        assert [(e.id, e.data) for e in await anext(hub.after(0, 5.0))] == [(1, b"{}")]

    _run(story)


# --- buckets ------------------------------------------------------------------------------------------------


def test_a_bucket_fills_with_time_and_is_of_one_key() -> None:
    now = [0.0]
    limit = RateLimit(2.0, 3, lambda: now[0], keys=2)
    assert [limit.wait("a") for _ in range(4)] == [0.0, 0.0, 0.0, 0.5]
    assert limit.wait("b") == 0.0
    now[0] = 0.5
    assert [limit.wait("a"), limit.wait("a")] == [0.0, 0.5]
    now[0] = 100.0
    assert [limit.wait("a") for _ in range(4)] == [0.0, 0.0, 0.0, 0.5]
    limit.wait("c")
    limit.wait("d")  # "a" is forgotten
    assert limit.wait("a") == 0.0
    assert RateLimit(0.0, 1, lambda: 0.0).wait("a") == 0.0


async def _quiet_until_mine(hub: Hub) -> bytes:
    lines = _lines(cast("Server", SimpleNamespace(hub=hub)), "", "mine", 0, once=False)
    told = asyncio.ensure_future(anext(lines))
    for seq, track in ((1, "another's"), (2, "another's"), (3, "mine")):
        for _ in range(5):
            await asyncio.sleep(0.0)
        assert not told.done()  # nothing, not even that the stream is alive
        hub.publish([Event(seq, "s", track, b"{}")], seq)
    return await told


def test_a_stream_of_one_track_is_silent_about_others() -> None:
    assert asyncio.run(_quiet_until_mine(Hub(10))) == b"id: 3\nevent: position\ndata: {}\n\n"


def test_a_stream_of_what_is_there_ends_where_the_log_has_gone_on_without_events() -> None:
    async def told() -> list[bytes]:
        hub = Hub(10)
        hub.publish([_event(1)], 7)  # six batches more that moved nobody
        lines = _lines(cast("Server", SimpleNamespace(hub=hub)), "", "", 0, once=True)
        async with asyncio.timeout(5.0):  # it used to wait for the next event
            return [block async for block in lines]

    assert b"".join(asyncio.run(told())).count(b"event: position") == 1
