"""From accepted batches to tracks: one thread that writes the log and then feeds the tracks.

Whatever waits is written as one group in one transaction, so that the price of a sync is shared; only then are the
senders answered. Where batches come from many at once, a moment is waited for more of them: a transaction and a change
of threads cost far more than a batch. After that the group goes into the tracks, in the order of the log. A round of
checkpoints now and then keeps the part of the log short that must be read again after a crash; a few tracks at a time,
between groups, so that no phone waits for the checkpoints of all.
"""

from __future__ import annotations

import logging
import threading
from collections import deque
from collections.abc import Callable, Collection, Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from typing import NamedTuple, Protocol, TypeVar

from sqlalchemy.exc import SQLAlchemyError

from wayfuse.core.errors import ConfigError, WayfuseError
from wayfuse.service.live import Applied, Live
from wayfuse.service.message import Message
from wayfuse.storage.log import Entry, IngestLog
from wayfuse.storage.tracks import Checkpoint, TrackStore

__all__ = ["BusyError", "Item", "Pipeline", "PipelineConfig", "recover"]

_log = logging.getLogger(__name__)


T = TypeVar("T")
_TOLD_AT_ONCE = (
    32  # entries in the tracks before what they changed is told: the first need not wait for the last
)


class BusyError(WayfuseError):
    """Too much is waiting; the sender should come again."""


class Item(NamedTuple):
    """A message and the entry it becomes; the pipeline gives the ``seq``."""

    entry: Entry
    message: Message


@dataclass(frozen=True, slots=True, kw_only=True)
class PipelineConfig:
    """Limits and periods.

    max_waiting, max_waiting_bytes : what may wait to be written. group : most entries of one transaction.
    gather : s that are waited for more, after a group of several. enough : entries for which nothing is waited for.
    checkpoint_every : s between rounds of checkpoints. slice : tracks that are written at once.
    retry_every : s until a database that was away is asked again.
    idle : s until a silent track leaves the memory.
    """

    max_waiting: int = 10_000
    max_waiting_bytes: int = 256 << 20
    group: int = 512
    gather: float = 0.02
    enough: int = 32
    checkpoint_every: float = 10.0
    slice: int = 20
    retry_every: float = 1.0
    idle: float = 900.0

    def __post_init__(self) -> None:
        if (
            min(self.max_waiting, self.max_waiting_bytes, self.group, self.enough, self.slice) < 1
            or not self.checkpoint_every > 0.0
            or not self.gather >= 0.0
        ):
            raise ConfigError("the limits of the pipeline must be positive", where="PipelineConfig")


class Done(Protocol):
    """Who waits for a batch: a future of a thread or of an event loop."""

    def done(self) -> bool:
        """Whether it waits no more."""
        ...

    def set_result(self, seqs: list[int], /) -> None:
        """The batch is on the disk."""
        ...

    def set_exception(self, error: BusyError, /) -> None:
        """It is not."""
        ...


class _Waiting(NamedTuple):
    items: Sequence[Item]
    done: Done

    def accept(self, first: int) -> None:
        if not self.done.done():
            self.done.set_result(list(range(first, first + len(self.items))))

    def refuse(self, what: str, remedy: str) -> None:
        if not self.done.done():
            self.done.set_exception(BusyError(what, remedy=remedy))


def _at_once(do: Callable[[], None]) -> None:
    do()


class Pipeline:
    """The thread.

    clock : gives Unix s. publish : called, in the thread, with what a group changed and the seq of its last entry.
    answer : calls what tells the senders of a group, once for all of them, where their futures may be touched.
    """

    def __init__(
        self,
        log: IngestLog,
        live: Live,
        tracks: TrackStore,
        next_seq: int,
        *,
        clock: Callable[[], float],
        publish: Callable[[list[Applied], int], None],
        answer: Callable[[Callable[[], None]], None] = _at_once,
        config: PipelineConfig | None = None,
    ) -> None:
        self.applied = next_seq - 1  # seq of the last entry that is in the tracks
        self.n_waiting = 0
        self.is_broken = False
        self._config = config or PipelineConfig()
        self._log, self._live, self._tracks = log, live, tracks
        self._clock, self._publish, self._answer = clock, publish, answer
        self._next = next_seq
        self._kept = self.applied  # seq of the last round
        self._round: tuple[int, list[str]] | None = None  # its seq, and tracks still to be written
        self._due = clock() + self._config.checkpoint_every
        self._queue: deque[_Waiting] = deque()
        self._calls: list[Callable[[], None]] = []
        self._bytes = 0
        self._unsaved: list[tuple[int, list[Checkpoint]]] = []  # those that could not be written
        self._wake = threading.Condition()
        self._is_gathering = self._were_several = False
        self._stopping = False
        self._thread = threading.Thread(target=self._run, name="wayfuse-pipeline", daemon=True)

    def start(self) -> None:
        """Begin to work."""
        self._thread.start()

    def stop(self) -> None:
        """Do what waits, write a checkpoint, end."""
        with self._wake:
            self._stopping = True
            self._wake.notify()
        self._thread.join()

    def put(self, items: Sequence[Item], done: Done) -> None:
        """Hand over a batch; ``done`` gets the seqs when they are on the disk: ``answer`` must be able to touch it.

        Raises
        ------
        BusyError : too much waits already, or the server is going down.
        """
        size = sum(len(item.entry.body) for item in items)
        with self._wake:
            is_full = self.n_waiting + len(items) > self._config.max_waiting
            if (
                self._stopping
                or is_full
                or (self._bytes and self._bytes + size > self._config.max_waiting_bytes)
            ):
                raise BusyError("the server is busy", remedy="send it again in a moment")
            self._queue.append(_Waiting(items, done))
            self.n_waiting += len(items)
            self._bytes += size
            if not self._is_gathering or self.n_waiting >= self._config.enough:
                self._wake.notify()

    def call(self, do: Callable[[], T]) -> Future[T]:
        """Do something in the thread, between two groups, when nothing moves.

        Raises
        ------
        BusyError : the server is going down.
        """
        done: Future[T] = Future()

        def run() -> None:
            try:
                done.set_result(do())
            except Exception as error:  # it is the caller's, who waits for it
                done.set_exception(error)

        with self._wake:
            if self._stopping:
                raise BusyError("the server is going down", remedy="send it again later")
            self._calls.append(run)
            self._wake.notify()
        return done

    def _run(self) -> None:
        try:
            self._work()
        except Exception:  # the thread cannot go on; nobody may be told that a batch was kept
            _log.exception("the pipeline has stopped")
            with self._wake:
                self._stopping, self.is_broken = True, True
                lost, self._queue = list(self._queue), deque()
            self._refuse(lost, "the server is broken", "tell its operator")

    def _work(self) -> None:
        while True:
            group, calls = self._take()
            for call in calls:
                call()
            if group:
                self._do(group)
            is_over = self._is_over()
            self._checkpoint(is_last=is_over)
            if is_over:
                return

    def _is_over(self) -> bool:
        with self._wake:
            return self._stopping and not self._queue and not self._calls

    def _take(self) -> tuple[list[_Waiting], list[Callable[[], None]]]:
        with self._wake:
            if not (self._queue or self._calls or self._stopping or self._round):
                self._wake.wait(min(1.0, self._config.checkpoint_every))
            self._gather()
            group: list[_Waiting] = []
            n = 0
            while self._queue and (not group or n + len(self._queue[0].items) <= self._config.group):
                group.append(self._queue.popleft())
                n += len(group[-1].items)
            self.n_waiting -= n
            self._were_several = len(group) > 1 if group else self._were_several
            self._bytes -= sum(len(i.entry.body) for w in group for i in w.items)
            calls, self._calls = self._calls, []
            return group, calls

    def _gather(self) -> None:
        """Wait a moment for more; senders do not wake the thread meanwhile. The lock is held."""
        is_worth_it = self._were_several and self._queue and self.n_waiting < self._config.enough
        if is_worth_it and not (self._calls or self._stopping):
            self._is_gathering = True
            self._wake.wait(self._config.gather)
            self._is_gathering = False

    def _refuse(self, group: list[_Waiting], what: str, remedy: str) -> None:
        def tell() -> None:
            for waiting in group:
                waiting.refuse(what, remedy)

        self._answer(tell)

    def _accept(self, group: list[_Waiting], first: int) -> None:
        def tell() -> None:
            seq = first
            for waiting in group:
                waiting.accept(seq)
                seq += len(waiting.items)

        self._answer(tell)

    def _do(self, group: list[_Waiting]) -> None:
        seq, numbered = self._next, list[Item]()
        for waiting in group:
            for item in waiting.items:
                numbered.append(Item(item.entry._replace(seq=seq), item.message))
                seq += 1
        try:
            self._log.append([item.entry for item in numbered])
        except SQLAlchemyError as error:
            _log.error("the log cannot be written: %s", type(error).__name__)
            self._refuse(group, "the log cannot be written now", "send it again later")
            return
        first, self._next = self._next, seq
        self._accept(group, first)
        for start in range(0, len(numbered), _TOLD_AT_ONCE):
            changes = []
            for item in numbered[start : start + _TOLD_AT_ONCE]:
                applied = self._apply(item)
                if applied is not None:
                    changes.append(applied)
                self.applied = item.entry.seq
            self._publish(changes, self.applied)

    def _apply(self, item: Item) -> Applied | None:
        """Apply an entry; it is in the log, so wait for a database that is away rather than leave it out."""
        while True:
            try:
                return self._live.apply(item.entry, item.message)
            except SQLAlchemyError as error:
                _log.error("a checkpoint cannot be read: %s", type(error).__name__)
                with self._wake:
                    if self._stopping:
                        raise
                    self._wake.wait(self._config.retry_every)

    def drop(self, tracks: Collection[str]) -> None:
        """Leave tracks out of what is still to be written; to be used in `call` alone."""
        self._unsaved = [(seq, [k for k in kept if k.row.track not in tracks]) for seq, kept in self._unsaved]

    def _checkpoint(self, *, is_last: bool) -> None:
        """Begin a round where one is due, and go on with it: a slice, or at the end all that is left."""
        if self._round is None and self._kept < self.applied and (is_last or self._clock() >= self._due):
            self._round = (self.applied, self._live.changed())
        if self._round is None:
            return
        seq, tracks = self._round
        n = len(tracks) if is_last else self._config.slice
        some, tracks[:] = tracks[:n], tracks[n:]
        self._unsaved.append((self.applied, self._live.checkpoint(some)))
        try:
            while self._unsaved:
                self._tracks.save(*self._unsaved[0])
                del self._unsaved[0]
            if tracks:
                return
            self._tracks.close_round(seq)
        except SQLAlchemyError as error:
            _log.error("checkpoints cannot be written: %s", type(error).__name__)
            if not is_last:
                with self._wake:
                    self._wake.wait(self._config.retry_every)
            return
        self._round, self._kept = None, seq
        now = self._clock()
        self._due = now + self._config.checkpoint_every
        self._live.release(now - self._config.idle)


def recover(
    log: IngestLog,
    live: Live,
    tracks: TrackStore,
    now: float,
    idle: float,
    told: Callable[[Applied], None],
) -> int:
    """Bring tracks back as they were: recent checkpoints, then the log after them. How many entries were read again.

    A recent track whose checkpoint is of another version is made again from what the log still has of it. ``told`` is
    called with what the entries after the checkpoint changed, as it was when they first came.
    """
    kept, n = tracks.round(), 0
    for row in tracks.newest(heard_after=now - idle):
        if not live.load(row.track):
            for entry in log.read(track=row.track):
                if entry.seq <= kept:
                    live.apply(entry)
                    n += 1
    for entry in log.read(after=kept):
        applied = live.apply(entry)
        if applied is not None:
            told(applied)
        n += 1
    return n
