"""One phone's track while it is alive: batches in, in any order; estimates out, the same as of a replay in order.

Records are taken at once. One that comes late, but not later than ``rewind``, takes the track back to a state before
it, and all since is done again with the record in its place; states are values, so a state kept is a way back
(docs/adr/0003). What is older than the oldest kept state is settled: it cannot change any more. Therefore, whatever
the order in which batches come within the bound, the estimates are those of `Tracker.run` over all records.

What a track does depends on the batches and their arrival times alone, never on a clock: reading the log again gives
the same track.
"""

from __future__ import annotations

from bisect import bisect_right
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from operator import itemgetter
from typing import Any, NamedTuple

import numpy as np

from wayfuse.core.errors import ConfigError
from wayfuse.sensors.recording import Recording
from wayfuse.sensors.records import Record, Step
from wayfuse.service.message import Message
from wayfuse.service.phone_clock import ClockState, judge
from wayfuse.service.stretch import RANK, START, Key, Keyed, gathered, joined, keyed
from wayfuse.tracking.estimate import Estimate
from wayfuse.tracking.tracker import Tracker, TrackState

__all__ = ["LiveConfig", "LiveTrack", "Memory", "Snapshot"]

_FAR = 1e12  # s; as the tracker judges
_FIRST_EVENT = RANK[Step]  # below are the samples of motion sensors


@dataclass(frozen=True, slots=True, kw_only=True)
class LiveConfig:
    """Parameters of live tracks.

    rewind : s, how late a record may be. spacing : s between kept states: the smaller, the less is done again, the
    more memory is used. gap : s of silence that counts as a gap. remembered : keys of parts kept to tell repetitions.
    """

    rewind: float = 10.0
    spacing: float = 3.0
    gap: float = 5.0
    remembered: int = 2048

    def __post_init__(self) -> None:
        if not (self.rewind >= 0.0 and self.spacing > 0.0 and self.gap > 0.0 and self.remembered >= 1):
            raise ConfigError("rewind must not be negative; spacing, gap and remembered must be positive")


class Snapshot(NamedTuple):
    """A way back: the state after ``n_records`` records, the key of the last of them, estimates and verdicts so far."""

    last: Key
    n_records: int
    n_estimates: int
    verdicts: dict[str, int]
    state: TrackState[Any]


class Memory(NamedTuple):
    """All of a live track that outlives its process. ``kept`` : numbers of records at which states were kept."""

    name: str
    seed: int
    clock: ClockState
    base: Snapshot
    records: Recording
    kept: tuple[int, ...]
    last_settled: Estimate | None
    counts: dict[str, int]
    seen: tuple[str, ...]
    is_ended: bool


class _Stretch(NamedTuple):
    n: int
    records: Recording


class LiveTrack:
    """A track under way; not for two threads at once."""

    def __init__(self, tracker: Tracker[Any], name: str, seed: int, config: LiveConfig) -> None:
        self.name, self.seed = name, seed
        self.counts: Counter[str] = Counter()
        self.is_ended = False
        self._tracker, self._config = tracker, config
        self._clock = ClockState()
        self._state = tracker.init(name, seed)
        self._verdicts: Counter[str] = Counter()
        self._last = START
        self._n_records = 0
        self._stretches: list[_Stretch] = []  # since the oldest snapshot, cut where a state is kept
        self._snapshots = [Snapshot(START, 0, 0, {}, self._state)]
        self._first = 0  # number of the first estimate still here
        self._estimates: list[Estimate] = []
        self._tail: list[Estimate] = []
        self._last_settled: Estimate | None = None
        self._seen: dict[str, None] = {}

    # --- what comes out

    @property
    def latest(self) -> Estimate | None:
        """The newest estimate."""
        here = self._tail or self._estimates
        return here[-1] if here else self._last_settled

    @property
    def first(self) -> int:
        """Number of the first estimate that has not been drained."""
        return self._first

    @property
    def n_settled(self) -> int:
        """So many estimates cannot change any more."""
        return self._snapshots[0].n_estimates

    @property
    def ahead(self) -> float:
        """s, the phone's clock ahead of the server's when the track began; NaN before."""
        return self._clock.ahead

    @property
    def state(self) -> TrackState[Any]:
        """The tracker's state after the last record."""
        return self._state

    @property
    def verdicts(self) -> dict[str, int]:
        """What became of the records, by `sensors.quality.Verdict`."""
        return dict(self._verdicts)

    def undrained(self) -> list[Estimate]:
        """All estimates that have not been drained, newest last."""
        return self._estimates + self._tail

    def drain(self) -> tuple[int, list[Estimate]]:
        """Hand over the settled estimates and their first number; they are then no longer here."""
        first, n = self._first, self.n_settled - self._first
        settled, self._estimates = self._estimates[:n], self._estimates[n:]
        self._first += n
        if settled:
            self._last_settled = settled[-1]
        return first, settled

    # --- what goes in

    def apply(self, message: Message, arrived: float) -> int:
        """Take a message; the number of the first estimate that is new or changed."""
        self.counts["messages"] += 1
        for kind, n in message.notes.items():
            self.counts[f"left out: {kind}"] += n
        records = self._fresh(message)
        before = self._first + len(self._estimates)
        self._tail = []
        changed = before
        if records:
            self.is_ended = False
            changed = self._take(records, arrived)
        self.is_ended = self.is_ended or message.is_end
        if self.is_ended:
            self._tail = self._tracker.flush(self._state, self._state.now)[1]
        return changed

    def _fresh(self, message: Message) -> list[Record]:
        """Records of the parts that were not here before."""
        out: list[Record] = []
        for part in message.parts:
            if part.key and part.key in self._seen:
                self.counts["duplicate parts"] += 1
                self.counts["duplicate records"] += len(part.records)
                continue
            if part.key:
                self._seen[part.key] = None
            out += part.records
        while len(self._seen) > self._config.remembered:
            del self._seen[next(iter(self._seen))]
        self.counts["records"] += len(out)
        return out

    def _take(self, records: Sequence[Record], arrived: float) -> int:
        t = np.array([record.t for record in records])
        sound = np.abs(t) <= _FAR  # NaN compares false
        judged = judge(self._clock, t[sound], arrived, self._config.rewind)
        self.counts["time not finite or out of range"] += int(np.count_nonzero(~sound))
        self.counts["from the future"] += int(np.count_nonzero(~judged.kept))
        self._clock = judged.state
        if judged.is_set:
            self._begin_anew()
        kept = np.flatnonzero(sound)[judged.kept].tolist()
        keyed = sorted(((records[i].t, RANK[type(records[i])]), n) for n, i in enumerate(kept))
        batch = [(key, records[kept[n]]) for key, n in keyed]
        base = self._snapshots[0].last
        fresh = [each for each in batch if each[0] >= base]
        self.counts["late records"] += len(batch) - len(fresh)
        changed = self._first + len(self._estimates)
        if not fresh:
            return changed
        if fresh[0][0] < self._last:
            changed, fresh = self._rewind(fresh)
        self._go_on(fresh)
        return changed

    def _begin_anew(self) -> None:
        """The phone's clock was set: what was is settled, and a track begins under a name of its own."""
        self.counts["clock set"] += 1
        state = self._tracker.init(f"{self.name}#{self._clock.epoch}", self.seed)
        n = self._first + len(self._estimates)
        self._stretches, self._state, self._last = [], state, START
        self._snapshots = [Snapshot(START, self._n_records, n, dict(self._verdicts), state)]

    def _rewind(self, fresh: list[Keyed]) -> tuple[int, list[Keyed]]:
        """Go back before the first of the records; the number of the first estimate undone, and what is to do again."""
        at = bisect_right(self._snapshots, fresh[0][0], key=itemgetter(0)) - 1
        back = self._snapshots[at]
        del self._snapshots[at + 1 :]
        undone = list[Recording]()
        while self._n_records > back.n_records:
            n, records = self._stretches.pop()
            undone.insert(0, records)
            self._n_records -= n
        again = keyed(joined(undone).records())
        del self._estimates[back.n_estimates - self._first :]
        self.counts["rewinds"] += 1
        self.counts["records done again"] += len(again)
        newest = again[-1][0]
        self.counts["records out of order"] += sum(key < newest for key, _ in fresh)
        self._state, self._last = back.state, back.last
        self._verdicts = Counter(back.verdicts)
        # stable: at equal keys those that were here first
        return back.n_estimates, sorted(again + fresh, key=itemgetter(0))

    def _go_on(self, fresh: list[Keyed]) -> None:
        """Take records in order, in stretches between which the state is kept."""
        start = 0
        while start < len(fresh):
            before = self._snapshots[-1].last
            if fresh[start][0][0] - before[0] >= self._config.spacing and self._last != before:
                self._keep()
            base, stop = self._snapshots[-1].last[0], start + 1
            while stop < len(fresh) and fresh[stop][0][0] - base < self._config.spacing:
                stop += 1
            self._take_stretch(fresh[start:stop])
            start = stop

    def _take_stretch(self, stretch: list[Keyed]) -> None:
        times = [key[0] for key, _ in stretch]
        before = times[0] if self._last == START else self._last[0]
        gaps = sum(b - a > self._config.gap for a, b in pairwise([before, *times]))
        if gaps:
            self._verdicts["gaps"] += gaps
        records = gathered(stretch)
        if any(key[1] < _FIRST_EVENT for key, _ in stretch):
            self._state, said, scans, others = self._tracker.extend(self._state, records)
            self._estimates += said
            for verdict, n in (*scans.items(), *others.items()):
                self._verdicts[verdict.value] += n
        else:  # of a few events, one by one: the same bits, without the work that pays for many samples
            for _, record in stretch:
                self._state, said, verdict = self._tracker.step(self._state, record)
                self._estimates += said
                self._verdicts[verdict.value] += 1
        self._stretches.append(_Stretch(len(stretch), records))
        self._n_records += len(stretch)
        self._last = stretch[-1][0]

    def _mark(self) -> None:
        """Keep a way back here."""
        done = self._first + len(self._estimates)
        self._snapshots.append(Snapshot(self._last, self._n_records, done, dict(self._verdicts), self._state))

    def _keep(self) -> None:
        """Keep a way back here, and give up those that are older than the bound."""
        self._mark()
        horizon = self._last[0] - self._config.rewind
        while len(self._snapshots) > 1 and self._snapshots[1].last[0] <= horizon:
            n = self._snapshots[1].n_records - self._snapshots.pop(0).n_records
            while n:
                n -= self._stretches.pop(0).n

    # --- what outlives the process

    def memory(self) -> Memory:
        """What is needed to go on; call `drain` before, and keep what it gives."""
        return Memory(
            self.name,
            self.seed,
            self._clock,
            self._snapshots[0],
            joined([stretch.records for stretch in self._stretches]),
            tuple(s.n_records for s in self._snapshots[1:]),
            self._last_settled,
            dict(self.counts),
            tuple(self._seen),
            self.is_ended,
        )

    @classmethod
    def recall(cls, tracker: Tracker[Any], memory: Memory, config: LiveConfig) -> LiveTrack:
        """The track of a memory, as it was."""
        track = cls(tracker, memory.name, memory.seed, config)
        base = memory.base
        track._clock, track._last_settled = memory.clock, memory.last_settled
        track._snapshots = [base]
        track._state, track._last = base.state, base.last
        track._verdicts = Counter(base.verdicts)
        track._n_records = base.n_records
        track._first = base.n_estimates
        track._seen = dict.fromkeys(memory.seen)
        records = keyed(memory.records.records())
        edges = [0, *(n - base.n_records for n in memory.kept), len(records)]
        for start, stop in pairwise(edges):
            if start:
                track._mark()
            if records:
                track._take_stretch(records[start:stop])
        track.counts = Counter(memory.counts)
        track.is_ended = memory.is_ended
        if track.is_ended:
            track._tail = tracker.flush(track._state, track._state.now)[1]
        return track
