"""Frames of one packet over anchors, and the ranges of a packet."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest

from wayfuse.core.errors import ConfigError
from wayfuse.radio.csi import INTEL5300_20MHZ, fourier_order, impulse_response
from wayfuse.radio.multilateration import constrained_least_squares
from wayfuse.radio.packet_groups import PacketGrouper, group, group_ranges
from wayfuse.radio.ranging import RangeRegression
from wayfuse.sensors.records import CsiFrame

ANCHORS = {1: (0.0, 0.0), 2: (12.0, 0.0), 3: (12.0, 8.0), 4: (0.0, 8.0)}
GROUPER = PacketGrouper(anchors=tuple(ANCHORS))
MODEL = RangeRegression(-3.0, -0.1)  # m at a power in dBm


class Heard(NamedTuple):
    target: int
    sequence: int
    frame: CsiFrame


def heard(anchor: int, t: float, sequence: int = -1, target: int = 7, rss: float = -50.0) -> Heard:
    csi = np.full((2, 1, 30), 5.0 + 0j, dtype=np.complex64)
    return Heard(target, sequence, CsiFrame(t, anchor, csi, rss, 40.0, float("nan")))


def test_frames_of_a_number_are_a_packet_whenever_they_come() -> None:
    packets = [
        heard(3, 0.000, 5),
        heard(1, 0.001, 6),
        heard(1, 0.010, 5),
        heard(2, 0.011, 6),
        heard(4, 0.015, 5),
    ]
    packets += [heard(2, 0.020, 5), heard(3, 0.021, 6), heard(4, 0.022, 6)]
    groups, counts = group(GROUPER, packets)
    assert [(g.sequence, g.t, [f.anchor for f in g.frames]) for g in groups] == [
        (5, 0.0, [1, 2, 3, 4]),
        (6, 0.001, [1, 2, 3, 4]),
    ]
    assert (counts.groups, counts.late, counts.repeated) == (2, 0, 0)


def test_without_a_number_the_window_decides_and_transmitters_stay_apart() -> None:
    packets = [heard(1, 0.000), heard(2, 0.001), heard(1, 0.002, target=8), heard(3, 0.003)]
    packets += [heard(4, 0.010), heard(1, 0.011)]  # the next packet
    groups, _ = group(GROUPER, packets)
    assert [(g.target, [f.anchor for f in g.frames]) for g in groups] == [
        (7, [1, 2, 3]),
        (8, [1]),
        (7, [1, 4]),
    ]


def test_late_repeated_foreign_and_missing_frames_are_counted() -> None:
    packets = [heard(1, 0.0, 1), heard(2, 0.0, 1), heard(1, 0.01, 1), heard(9, 0.01, 1)]
    packets += [heard(a, 0.5, 2) for a in ANCHORS]
    packets += [heard(3, 0.05, 1), heard(2, 0.55, 2)]  # after the wait; a packet that was given out already
    groups, counts = group(GROUPER, packets)
    assert [len(g.frames) for g in groups] == [2, 4]
    assert (counts.groups, counts.late, counts.repeated, counts.foreign) == (2, 1, 2, 1)
    assert dict(counts.missing) == {1: 0, 2: 0, 3: 1, 4: 1}


def test_a_packet_is_given_out_as_soon_as_all_have_heard_it() -> None:
    state = GROUPER.init()
    for k, anchor in enumerate(ANCHORS):
        before = state
        state, out = GROUPER.step(state, heard(anchor, 0.001 * k, 3))
        assert len(out) == (k == 3)
        assert before is not state
    state, out = GROUPER.flush(state)
    assert out == []
    assert state.waiting == ()


def test_the_order_of_arrival_within_the_wait_does_not_matter() -> None:
    rng = np.random.default_rng(0)
    packets = [heard(a, 0.01 * n + rng.uniform(0.0, 0.003), n) for n in range(60) for a in ANCHORS]
    packets = [p for p in packets if rng.uniform() > 0.1]
    groups, counts = group(GROUPER, packets)
    shuffled = sorted(packets, key=lambda p: p.frame.t + rng.uniform(0.0, 0.1))
    again, counted = group(GROUPER, shuffled)
    assert [(g.sequence, g.t, g.frames) for g in again] == [(g.sequence, g.t, g.frames) for g in groups]
    assert counted == counts
    assert sum(len(g.frames) for g in groups) == len(packets)
    assert sum(n for _, n in counts.missing) == 240 - len(packets)


def test_the_ranges_of_a_packet_find_the_place() -> None:
    place = np.array([4.0, 3.0])
    packets = []
    for anchor, at in ANCHORS.items():
        distance = float(np.hypot(*(place - at)))
        power = (np.log(distance) - MODEL.log_scale) / MODEL.rate
        packets.append(
            heard(anchor, 1.0, 4, rss=power + 10.0 * np.log10(2.0))
        )  # two antennas share the power
    ((packet,), _) = group(GROUPER, packets)
    ranges = group_ranges(packet, dict.fromkeys((1, 2, 3), (MODEL, MODEL)))
    assert [(r.t, r.anchor) for r in ranges] == [(1.0, 1), (1.0, 2), (1.0, 3)]  # no model, no range
    true = [float(np.hypot(*(place - ANCHORS[r.anchor]))) for r in ranges]
    assert [r.distance for r in ranges] == pytest.approx(true, rel=1e-3)
    found = constrained_least_squares(
        np.array([ANCHORS[r.anchor] for r in ranges]), np.array([[r.distance for r in ranges]])
    )
    assert found[0] == pytest.approx(place, abs=0.02)


def test_an_antenna_that_is_silent_or_has_no_model_takes_no_part() -> None:
    frame = heard(1, 0.0, 4).frame
    frame.csi[1] = 0.0
    (packet,), _ = group(PacketGrouper(anchors=(1,)), [Heard(7, 4, frame)])
    (one,) = group_ranges(packet, {1: (MODEL, MODEL)})
    (three,) = group_ranges(packet, {1: (MODEL, MODEL, MODEL)})
    assert one.distance == three.distance == pytest.approx(float(MODEL.distance(-50.0)))
    frame.csi[0] = 0.0
    assert group_ranges(packet, {1: (MODEL,)}) == ()


def test_impulse_responses_of_wider_channels() -> None:
    for n in (64, 128, 256):
        k = fourier_order(n)
        assert sorted(k.tolist()) == list(range(-n // 2, n // 2))
        delayed = 3.0 * np.exp(-2j * np.pi * k * 5.0 / n)  # 5 taps of the channel's own bandwidth
        taps = np.abs(impulse_response(delayed, k))
        assert len(taps) == 4 * n
        assert int(taps.argmax()) == 20
        assert taps.max() == pytest.approx(3.0)
    assert len(impulse_response(np.ones(30), INTEL5300_20MHZ)) == 256


@pytest.mark.parametrize(
    "bad",
    [
        {"anchors": ()},
        {"anchors": (1, 1)},
        {"anchors": (1,), "window": 0.5},
        {"anchors": (1,), "window": 0.0},
    ],
)
def test_parameters_are_checked(bad: dict[str, object]) -> None:
    with pytest.raises(ConfigError):
        PacketGrouper(**bad)  # type: ignore[arg-type]
