"""A live track gives the estimates of a replay to the bit, whatever the order in which its batches come."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from wayfuse.core.errors import ConfigError, FormatError
from wayfuse.sensors.recording import Recording
from wayfuse.sensors.records import Acceleration, WifiScan
from wayfuse.service.adapters import ADAPTERS
from wayfuse.service.checkpoint import pack, unpack
from wayfuse.service.live_track import LiveConfig, LiveTrack, Memory
from wayfuse.service.message import Message, Part, Profile
from wayfuse.service.replay import envelopes
from wayfuse.service.wire import encode
from wayfuse.tracking.estimate import Estimate
from wayfuse.tracking.tracker import Tracker

NOW = 1.6e9


def _messages(recording: Recording, every: float = 1.0) -> list[Message]:
    own = ADAPTERS["own"]
    return [own.read(encode(e), Profile(), NOW)[0] for e in envelopes(recording, "phone", "walk", every)]


def _expected(tracker: Tracker, recording: Recording) -> list[Estimate]:
    return tracker.run(replace(recording, name="walk")).estimates


def _fed(tracker: Tracker, messages: Sequence[Message], config: LiveConfig | None = None) -> LiveTrack:
    track = LiveTrack(tracker, "walk", 0, config or LiveConfig())
    for message in messages:
        track.apply(message, NOW)
    return track


def _all(track: LiveTrack, settled: Sequence[Estimate] = ()) -> list[Estimate]:
    return [*settled, *track.undrained()]


@pytest.mark.parametrize(("every", "n"), [(0.37, 0), (1.0, 1), (100.0, 2)])
def test_batches_in_order_give_the_replay(tracker: Tracker, world: Any, every: float, n: int) -> None:
    walk = world.walks[n]
    assert _all(_fed(tracker, _messages(walk, every))) == _expected(tracker, walk)


@pytest.mark.parametrize("seed", range(2))
def test_batches_out_of_order_and_twice_give_the_replay(tracker: Tracker, world: Any, seed: int) -> None:
    draw = np.random.default_rng(seed)
    walk = world.walks[seed % len(world.walks)]
    messages = _messages(walk, 0.8)
    late = sorted(range(len(messages)), key=lambda n: n * 0.8 + draw.uniform(0.0, 6.0))
    again = [n for n in late if draw.random() < 0.2]
    order = late + again
    track = _fed(tracker, [messages[n] for n in order])
    assert _all(track) == _expected(tracker, walk)
    assert track.counts["rewinds"] > 0
    assert track.counts["records out of order"] > 0
    assert track.counts["duplicate parts"] == len(again)
    assert track.counts["late records"] == 0


def test_what_is_later_than_the_bound_is_left_out_and_counted(tracker: Tracker, world: Any) -> None:
    walk = world.walks[0]
    messages = _messages(walk)
    track = _fed(tracker, [*messages[3:20], messages[1], *messages[20:]], LiveConfig(rewind=5.0))
    assert track.counts["late records"] == messages[1].n_records
    kept = _fed(tracker, messages[3:], LiveConfig(rewind=5.0))
    assert _all(track) == _all(kept)


def test_estimates_are_settled_once_and_never_change(tracker: Tracker, world: Any) -> None:
    draw = np.random.default_rng(1)
    messages = _messages(world.walks[1])
    order = sorted(range(len(messages)), key=lambda n: n + draw.uniform(0.0, 4.0))
    track = LiveTrack(tracker, "walk", 0, LiveConfig(rewind=6.0, spacing=1.0))
    settled: list[Estimate] = []
    for n in order:
        before = settled + track.undrained()
        changed = track.apply(messages[n], NOW)
        assert changed >= track.first
        assert (settled + track.undrained())[:changed] == before[:changed]
        first, new = track.drain()
        assert first == len(settled)
        settled += new
    assert len(settled) > 20
    assert _all(track, settled) == _expected(tracker, world.walks[1])


@pytest.mark.parametrize("seed", range(2))
def test_a_track_goes_on_from_its_memory_as_if_nothing_had_been(
    tracker: Tracker, world: Any, seed: int
) -> None:
    draw = np.random.default_rng(seed)
    messages = _messages(world.walks[seed])
    order = sorted(range(len(messages)), key=lambda n: n + draw.uniform(0.0, 5.0))
    config = LiveConfig(rewind=6.0, spacing=1.0)
    straight, broken = (LiveTrack(tracker, "walk", 0, config) for _ in range(2))
    settled: tuple[list[Estimate], list[Estimate]] = ([], [])
    for n in order:
        straight.apply(messages[n], NOW)
        broken.apply(messages[n], NOW)
        settled[0].extend(straight.drain()[1])
        settled[1].extend(broken.drain()[1])
        if draw.random() < 0.3:
            memory = unpack(pack(broken.memory()))
            assert isinstance(memory, Memory)
            broken = LiveTrack.recall(tracker, memory, config)
        assert broken.latest == straight.latest
        assert broken.counts == straight.counts
        assert broken.verdicts == straight.verdicts
    assert _all(broken, settled[1]) == _all(straight, settled[0])
    assert settled[0] == settled[1]


def test_a_session_that_goes_on_after_its_end_is_the_same_track(tracker: Tracker, world: Any) -> None:
    walk = world.walks[2]
    messages = _messages(walk)
    messages[10] = messages[10]._replace(is_end=True)
    track = LiveTrack(tracker, "walk", 0, LiveConfig())
    for n, message in enumerate(messages):
        track.apply(message, NOW)
        assert track.is_ended == (n in {10, len(messages) - 1})
    assert _all(track) == _expected(tracker, walk)


# --- clocks -----------------------------------------------------------------------------------------------


def _shifted(message: Message, by: float) -> Message:
    def moved(record: object) -> object:
        if isinstance(record, WifiScan):
            return replace(record, t=record.t + by, last_seen=record.last_seen + by)
        return record._replace(t=record.t + by)

    return message._replace(
        parts=tuple(Part(p.key, tuple(moved(r) for r in p.records)) for p in message.parts)
    )


def test_a_lone_time_from_the_future_does_not_carry_the_track_away(tracker: Tracker, world: Any) -> None:
    walk = world.walks[0]
    messages = _messages(walk)
    foreign = Part("foreign", (Acceleration(NOW + 1e6, 0.0, 0.0, 9.8), *messages[5].parts[0].records))
    messages[5] = messages[5]._replace(parts=(foreign,))
    track = _fed(tracker, messages)
    assert track.counts["from the future"] == 1
    assert _all(track) == _expected(tracker, walk)


@pytest.mark.parametrize("by", [86_400.0, -86_400.0])
def test_a_clock_that_is_set_begins_a_track_anew_and_goes_on(tracker: Tracker, world: Any, by: float) -> None:
    messages = _messages(world.walks[0])
    start = world.walks[0].span[0]
    track = LiveTrack(tracker, "walk", 0, LiveConfig())
    for n, message in enumerate(messages):
        track.apply(_shifted(message, by) if n >= 12 else message, start + n)
    assert track.counts["clock set"] == 1
    last = track.latest
    assert last is not None
    assert abs(last.t - (world.walks[0].span[1] + by)) < 2.0
    assert track.n_settled >= 12


def test_times_that_are_none_are_counted(tracker: Tracker) -> None:
    track = LiveTrack(tracker, "walk", 0, LiveConfig())
    bad = tuple(Acceleration(t, 0.0, 0.0, 9.8) for t in (math.nan, math.inf, -math.inf, 1e300))
    track.apply(Message("phone", "", b"", (Part("", bad),)), NOW)
    assert track.counts["time not finite or out of range"] == 4
    assert track.latest is None
    assert track.undrained() == []


def test_a_pause_is_counted(tracker: Tracker, world: Any) -> None:
    messages = _messages(world.walks[0])
    track = _fed(tracker, [*messages[:8], *messages[16:]])
    assert track.verdicts["gaps"] == 1


# --- memory -----------------------------------------------------------------------------------------------


def test_repetitions_are_forgotten_in_the_end(tracker: Tracker) -> None:
    track = LiveTrack(tracker, "walk", 0, LiveConfig(remembered=3))
    for n in [0, 1, 2, 3, 0, 3]:
        track.apply(Message("phone", "", b"", (Part(f"id {n}", ()),)), NOW)
    assert track.counts["duplicate parts"] == 1
    assert len(track.memory().seen) == 3


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"\x93\x03\xa9os:system\x90",
        pack((1, 2))[:-1],
        pack(Estimate(*range(14))).replace(b"estimate:Estimate", b"estimate:Annotate"),
        pack(Estimate(*range(14))).replace(b"wayfuse.tracking", b"wayfuse.evaluate"),
        pack(Estimate(*range(14))).replace(b"share_blocked", b"share_blacked"),
    ],
)
def test_what_is_no_checkpoint_is_refused(content: bytes) -> None:
    with pytest.raises(FormatError, match="checkpoint"):
        unpack(content)


def test_what_is_no_state_is_not_packed() -> None:
    with pytest.raises(TypeError, match="no part of a state"):
        pack({"a": object()})


@pytest.mark.parametrize("bad", [{"rewind": -1.0}, {"spacing": 0.0}, {"gap": 0.0}, {"remembered": 0}])
def test_parameters_are_checked(bad: dict[str, float]) -> None:
    with pytest.raises(ConfigError):
        LiveConfig(**bad)
