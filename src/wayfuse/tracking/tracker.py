"""The tracker: records in, estimates out; live or replayed, one record or a recording at a time.

`Tracker.step` is the live form: state and record in, state and estimates out. `Tracker.run` replays a whole
recording with the array path of the front end and gives the same bits. Estimates come at every delivered scan, at
every step that moves the method, and at least once per `interval`; an estimate for time t uses records up to t (plus
the lag, where one is asked).

Bad records never stop a track: they get a `Verdict` and are counted.
"""

from __future__ import annotations

import heapq
import math
from collections import Counter
from dataclasses import dataclass, field, replace
from operator import attrgetter
from typing import TYPE_CHECKING, Generic, TypeVar

import numpy as np

from wayfuse.core.errors import ConfigError, UsageError
from wayfuse.inertial.front_end import InertialFrontEnd, StepEvent, StepEvents
from wayfuse.inertial.vertical import VerticalEvent
from wayfuse.inertial.vertical_front_end import VerticalFrontEnd
from wayfuse.radio.scans import ScanBuffer
from wayfuse.sensors.quality import Verdict
from wayfuse.sensors.recording import Recording
from wayfuse.sensors.records import (
    Acceleration,
    CsiFrame,
    MagneticField,
    Orientation,
    Pressure,
    Range,
    Record,
    RotationRate,
    Step,
    Waypoint,
    WifiScan,
)
from wayfuse.tracking.engine import Engine, Known
from wayfuse.tracking.estimate import Estimate
from wayfuse.tracking.record_checks import judge_range, judge_step, step_event
from wayfuse.tracking.track_state import FAR, LONGEST_GAP, Batch, Replay, Track, TrackState, is_even

if TYPE_CHECKING:
    from wayfuse.radio.channel_ranging import ChannelRanging

__all__ = ["Batch", "Track", "TrackState", "Tracker"]

S = TypeVar("S")

_MOTION = (Acceleration, RotationRate, MagneticField, Orientation, Pressure)
_QUIET_AFTER = 2.0  # s without motion sensors until a method diffuses (a standing phone still reports)


@dataclass(frozen=True, slots=True, kw_only=True)
class Tracker(Generic[S]):
    """Routes records to the front end and the engine, and asks for estimates.

    Parameters
    ----------
    engine : the positioning method. front_end, vertical, scan_buffer : motion records to steps, motion records and
    pressure to movements between floors, scans to fingerprints.
    channel : channel state to ranges; None = it is not looked at.
    interval : s, longest time between estimates. lag : s, estimates are given this much later and better.
    """

    engine: Engine[S]
    front_end: InertialFrontEnd = field(default_factory=InertialFrontEnd)
    vertical: VerticalFrontEnd = field(default_factory=VerticalFrontEnd)
    scan_buffer: ScanBuffer = field(default_factory=ScanBuffer)
    channel: ChannelRanging | None = None
    interval: float = 1.0
    lag: float = 0.0
    _telling: tuple[type, ...] = field(init=False, repr=False)  # records that end a silence

    def __post_init__(self) -> None:
        if not self.interval > 0.0 or not self.lag >= 0.0:
            raise ConfigError(
                f"interval must be positive and lag not negative, got {self.interval}, {self.lag}"
            )
        if self.lag > 0.0 and not self.engine.supports_lag:
            raise UsageError("this method has no lag", where="--lag", remedy="leave --lag out, or use fused")
        ranging = (Range, *((CsiFrame,) if self.channel else ())) if self.engine.uses_ranges else ()
        object.__setattr__(self, "_telling", (Acceleration, WifiScan, Step, *ranging))

    def init(self, name: str, seed: int = 0) -> TrackState[S]:
        """State before the first record of a track; equal names and seeds give equal bits."""
        return TrackState(
            name,
            seed,
            self.front_end.init(),
            self.vertical.init(),
            self.scan_buffer.init(),
            self.engine.init(name, seed),
        )

    def step(self, state: TrackState[S], record: Record) -> tuple[TrackState[S], list[Estimate], Verdict]:
        """Take one record: the state after it, the estimates that are due, and what became of the record."""
        if isinstance(record, Waypoint):  # truth is no input, not even its time
            return state, [], Verdict.IGNORED
        if not np.isfinite(record.t):
            return state, [], Verdict.NOT_FINITE
        if abs(record.t) > FAR:
            return state, [], Verdict.OUT_OF_RANGE
        if record.t < state.now:
            return state, [], Verdict.LATE
        out: list[Estimate] = []
        state = self._moments(state, record.t, out)
        is_heard = isinstance(record, self._telling)
        is_paused = state.now > -np.inf and record.t - state.now > LONGEST_GAP
        if is_paused or (is_heard and record.t - state.last_heard > LONGEST_GAP):
            state = self._restart(state, record.t, out)
        if is_heard:
            state = state._replace(last_heard=record.t)
        state = self._advance(state, record.t, out, None)
        if isinstance(record, WifiScan):
            state, verdict = self._scan(state, record, out)
            return state, out, verdict
        if isinstance(record, Range):
            state, verdict = self._range(state, record)
            return state, out, verdict
        if isinstance(record, Step):
            return self._told(state, record, out)
        if isinstance(record, CsiFrame) and self.channel is not None and CsiFrame in self._telling:
            channel, verdict = self.channel.step(state.channel, record)
            return state._replace(channel=channel), out, verdict
        if not isinstance(record, _MOTION):
            return state, out, Verdict.IGNORED  # BLE: no model yet
        front_end, event = self.front_end.step(state.front_end, record)
        state = state._replace(front_end=front_end)
        if isinstance(record, Acceleration):
            state = state._replace(last_motion=record.t)
        event = None if state.is_told else event
        if event is not None:
            state = self._step_event(state, event, out)
        if self.engine.uses_vertical:
            state = self._vertical(state, record, event, out)
        return state, out, Verdict.USED

    def _vertical(
        self, state: TrackState[S], record: Record, step: StepEvent | None, out: list[Estimate]
    ) -> TrackState[S]:
        vertical, said = self.vertical.step(state.vertical, record)
        state = state._replace(vertical=vertical)
        if said is not None:
            state = self._vertical_event(state, said, out)
        return state if step is None else self._foot(state, step, out)

    def _foot(self, state: TrackState[S], step: StepEvent, out: list[Estimate]) -> TrackState[S]:
        """What a step tells of the movements between floors."""
        vertical, said = self.vertical.on_step(state.vertical, step)
        state = state._replace(vertical=vertical)
        return state if said is None else self._vertical_event(state, said, out)

    def _told(
        self, state: TrackState[S], record: Step, out: list[Estimate]
    ) -> tuple[TrackState[S], list[Estimate], Verdict]:
        """Take a step that the phone worked out itself; from then on its samples make none."""
        verdict = judge_step(record)
        if verdict is not Verdict.USED:
            return state, out, verdict
        event = step_event(record)
        state = self._step_event(state._replace(is_told=True), event, out)
        if self.engine.uses_vertical:
            state = self._foot(state, event, out)
        return state, out, verdict

    def flush(self, state: TrackState[S], until: float) -> tuple[TrackState[S], list[Estimate]]:
        """The estimates still due up to a time, and those that wait for their lag."""
        out: list[Estimate] = []
        state = self._finish(self._moments(state, np.inf, out), until, out, None)
        return state, out

    def run(self, recording: Recording, seed: int = 0) -> Track:
        """Replay a recording: the same bits as `step` over its records and `flush` at its end."""
        if replace(recording, waypoints=()).is_empty:
            return Track(recording.name, [], Counter())
        state, out, scans, _ = self.extend(self.init(recording.name, seed), recording)
        return Track(recording.name, out + self.flush(state, state.now)[1], scans)

    def extend(self, state: TrackState[S], recording: Recording) -> Batch[S]:
        """Take the records of a recording as a batch: the same bits as `step` over them, in less time."""
        recording = replace(recording, waypoints=())
        if recording.is_empty:
            return Batch(state, [], Counter(), Counter())
        # ranges and steps are few; the array path is for what is many
        waiting = state.ranges or state.channel is not None
        ranging = (Range in self._telling and recording.ranges) or (
            CsiFrame in self._telling and recording.csi
        )
        few = recording.steps or waiting or ranging
        if few or not is_even(state, recording):
            return self._extend_by_record(state, recording)
        out: list[Estimate] = []
        scans: Counter[Verdict] = Counter()
        start, end = recording.span
        replay = Replay(recording.acceleration.t, state.last_motion)
        state = self._advance(state, start, out, replay)
        done = -np.inf
        for scan in recording.wifi:
            state = self._steps(state, recording, replay, (done, scan.t), out)
            done = scan.t
            state = self._advance(state, scan.t, out, replay)
            state, verdict = self._scan(state, scan, out)
            scans[verdict] += 1
        state = self._steps(state, recording, replay, (done, end), out)
        state = self._advance(state, end, out, replay)
        heard = [float(t[-1]) for t in (recording.acceleration.t, [s.t for s in recording.wifi]) if len(t)]
        if heard:
            state = state._replace(last_heard=max(heard))
        n_motion, n_other = recording.n_motion, recording.n_records - len(recording.wifi)
        others = Counter({Verdict.USED: n_motion, Verdict.IGNORED: n_other - n_motion})
        return Batch(state, out, scans, +others)

    def _extend_by_record(self, state: TrackState[S], recording: Recording) -> Batch[S]:
        out: list[Estimate] = []
        scans: Counter[Verdict] = Counter()
        others: Counter[Verdict] = Counter()
        for record in recording.records():
            state, said, verdict = self.step(state, record)
            out += said
            (scans if isinstance(record, WifiScan) else others)[verdict] += 1
        return Batch(state, out, scans, others)

    def _steps(
        self,
        state: TrackState[S],
        recording: Recording,
        replay: Replay,
        within: tuple[float, float],
        out: list[Estimate],
    ) -> TrackState[S]:
        """Feed the motion records with within[0] < t <= within[1] through the array path of the front end."""
        # whether the heading is absolute matters at scans only, so the state at the end of the stretch will do
        front_end, steps = self.front_end.run(state.front_end, recording, *within)
        state = state._replace(front_end=front_end)
        if state.is_told:
            steps = StepEvents(*(column[:0] for column in steps))
        vertical: list[VerticalEvent] = []
        if self.engine.uses_vertical:
            after, vertical = self.vertical.run(state.vertical, recording, steps, *within)
            state = state._replace(vertical=after)
        feet: list[StepEvent | VerticalEvent] = [
            StepEvent(*row) for row in zip(*(column.tolist() for column in steps), strict=True)
        ]
        # in time order, a step before what is reported at its time
        for event in heapq.merge(feet, vertical, key=attrgetter("t")):
            state = self._advance(state, event.t, out, replay)
            if isinstance(event, StepEvent):
                state = self._step_event(state, event, out)
            else:
                state = self._vertical_event(state, event, out)
        return state

    def _advance(
        self, state: TrackState[S], t: float, out: list[Estimate], replay: Replay | None
    ) -> TrackState[S]:
        """Let time pass to t: what is due before t, then t itself."""
        if state.now == -np.inf:
            return self._heard(state._replace(now=t, next_output=t, diffused=t), t, replay)
        state = self._pass(state, t, out, replay)
        return self._heard(state._replace(now=t), t, replay)

    def _pass(
        self, state: TrackState[S], t: float, out: list[Estimate], replay: Replay | None
    ) -> TrackState[S]:
        """The outputs due before t, and the estimates whose lag is over before t, in time order."""
        while True:
            ripe = state.pending[0] + self.lag if state.pending else np.inf
            if min(state.next_output, ripe) >= t:
                return state
            if state.next_output <= ripe:
                state = self._output(self._heard(state, state.next_output, replay), state.next_output, out)
            else:
                state = self._recall(state, out)

    def _restart(self, state: TrackState[S], t: float, out: list[Estimate]) -> TrackState[S]:
        """After a long silence the person can be anywhere: finish what was, begin anew under a name of its own."""
        state = self._finish(state, state.now, out, None)
        silence = t - min(state.now, state.last_heard)
        fresh = self.init(f"{state.name}@{t:.3f}", state.seed)
        engine = self.engine.resume(state.engine, fresh.name, fresh.seed, silence)
        return fresh._replace(
            engine=engine,
            front_end=state.front_end,
            vertical=state.vertical,
            now=t,
            next_output=t,
            diffused=t,
            last_heard=t,
        )

    @staticmethod
    def _heard(state: TrackState[S], t: float, replay: Replay | None) -> TrackState[S]:
        return state if replay is None else state._replace(last_motion=replay.last_motion(t))

    def _finish(
        self, state: TrackState[S], until: float, out: list[Estimate], replay: Replay | None
    ) -> TrackState[S]:
        state = self._pass(state, np.nextafter(until, np.inf), out, replay)
        if self.engine.uses_vertical and math.isfinite(until):
            vertical, said = self.vertical.flush(state.vertical, until)
            state = state._replace(vertical=vertical)
            if said is not None:
                state = self._vertical_event(state, said, out)
        while state.pending:
            state = self._recall(state, out)
        return state

    def _step_event(self, state: TrackState[S], event: StepEvent, out: list[Estimate]) -> TrackState[S]:
        if not (math.isfinite(event.length) and math.isfinite(event.heading)):  # sensors gone mad
            return state
        engine = self.engine.on_step(state.engine, event)
        if engine is state.engine:
            return state
        return self._output(state._replace(engine=engine), event.t, out)

    def _vertical_event(
        self, state: TrackState[S], event: VerticalEvent, out: list[Estimate]
    ) -> TrackState[S]:
        engine = self.engine.on_vertical(state.engine, event)
        if engine is state.engine:
            return state
        return self._output(state._replace(engine=engine), event.t, out)

    def _scan(
        self, state: TrackState[S], scan: WifiScan, out: list[Estimate]
    ) -> tuple[TrackState[S], Verdict]:
        scans, fingerprint = self.scan_buffer.step(state.scans, scan)
        repeated = scans is state.scans
        state = self._diffuse(state._replace(scans=scans), scan.t)
        if fingerprint is not None:
            before = state.engine
            engine = self.engine.on_fingerprint(before, scan.t, fingerprint, self._known(state))
            state = state._replace(engine=engine)
            verdict = Verdict.USED if engine is not before else Verdict.UNKNOWN_ACCESS_POINTS
            if not self.engine.uses_scans:
                verdict = Verdict.IGNORED
        else:
            verdict = Verdict.DUPLICATE if repeated else Verdict.OUT_OF_RANGE
        return self._output(state, scan.t, out), verdict

    def _range(self, state: TrackState[S], record: Range) -> tuple[TrackState[S], Verdict]:
        """Keep a range until its moment is over: those of one time are looked at together."""
        if not self.engine.uses_ranges:
            return state, Verdict.IGNORED
        verdict = judge_range(record, state.ranges)
        return (state._replace(ranges=(*state.ranges, record)) if verdict is Verdict.USED else state), verdict

    def _moments(self, state: TrackState[S], t: float, out: list[Estimate]) -> TrackState[S]:
        """Look at what was heard in moments that are over by t."""
        if state.ranges and t > state.ranges[0].t:
            state = self._ranges(state, out)
        if state.channel is None or self.channel is None or t < self.channel.end_of(state.channel):
            return state
        end = min(self.channel.end_of(state.channel), t if math.isfinite(t) else state.now)
        ranges = self.channel.ranges(state.channel, end)
        state = self._advance(state._replace(channel=None), end, out, None)
        return self._ranges(state._replace(ranges=ranges), out)

    def _ranges(self, state: TrackState[S], out: list[Estimate]) -> TrackState[S]:
        """Look at the ranges of a moment that is over."""
        if not state.ranges:
            return state
        ranges, t = state.ranges, state.ranges[0].t
        state = self._diffuse(state._replace(ranges=()), t)
        engine = self.engine.on_ranges(state.engine, t, ranges, self._known(state))
        return self._output(state._replace(engine=engine), t, out)

    def _known(self, state: TrackState[S]) -> Known:
        return Known(
            state.is_told or state.front_end.is_heading_absolute,
            math.isfinite(self.vertical.altitude(state.vertical)),
        )

    def _diffuse(self, state: TrackState[S], t: float) -> TrackState[S]:
        if self.engine.uses_steps and state.is_told:  # without steps it stands
            return state._replace(diffused=t)
        spoke = state.last_motion if self.engine.uses_steps else -np.inf
        if t - spoke <= _QUIET_AFTER:
            return state._replace(diffused=t)
        engine = self.engine.on_quiet(state.engine, t - max(state.diffused, spoke))
        return state._replace(engine=engine, diffused=t)

    def _output(self, state: TrackState[S], t: float, out: list[Estimate]) -> TrackState[S]:
        state = self._diffuse(state, t)._replace(next_output=t + self.interval)
        if self.lag == 0.0:
            engine, estimate = self.engine.estimate(state.engine, t)
            out.append(estimate)
            return state._replace(engine=engine)
        return state._replace(engine=self.engine.mark(state.engine, t), pending=(*state.pending, t))

    def _recall(self, state: TrackState[S], out: list[Estimate]) -> TrackState[S]:
        engine, estimate = self.engine.recall(state.engine)
        out.append(estimate)
        return state._replace(engine=engine, pending=state.pending[1:])
