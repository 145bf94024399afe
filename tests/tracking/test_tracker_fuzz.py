"""Whatever a phone delivers: no record stops a track, every record gets a verdict, every estimate is finite."""

from __future__ import annotations

from collections import Counter
from typing import Any

import numpy as np
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from wayfuse.presets import fused
from wayfuse.sensors.quality import Verdict
from wayfuse.sensors.records import (
    Acceleration,
    BleReading,
    MagneticField,
    Orientation,
    Pressure,
    Range,
    Record,
    RotationRate,
    Waypoint,
    WifiScan,
)
from wayfuse.tracking.estimate import Estimate, State

FAR = st.floats(width=64)  # NaN, infinities, 1e308 and all
VALUE = st.one_of(st.floats(-30.0, 30.0), FAR)
GAP = st.one_of(st.floats(0.0, 1.0), st.floats(-5.0, 400.0))
TIME = st.one_of(GAP.map(lambda g: ("gap", g)), FAR.map(lambda t: ("at", t)))
READING = st.tuples(st.integers(0, 40), VALUE, VALUE, st.integers(-(2**31), 2**31 - 1))
BODY = st.one_of(
    st.tuples(st.just("acceleration"), VALUE, VALUE, VALUE),
    st.tuples(st.just("rotation_rate"), VALUE, VALUE, VALUE),
    st.tuples(st.just("magnetic_field"), VALUE, VALUE, VALUE),
    st.tuples(st.just("orientation"), VALUE, VALUE, VALUE, VALUE),
    st.tuples(st.just("other"), st.integers(0, 3), VALUE),
    st.tuples(st.just("scan"), st.lists(READING, max_size=12)),
    st.tuples(st.just("walk"), st.integers(1, 150), VALUE),
)


def scan_of(t: float, rows: list[tuple[int, float, float, int]], known: np.ndarray) -> WifiScan:
    ids = np.array([known[i] if i < len(known) else 10**6 + i for i, *_ in rows], np.uint64)
    with np.errstate(over="ignore"):
        rssi = np.array([-60.0 - v if abs(v) < 30.0 else v for _, v, _, _ in rows], np.float32)
    seen = np.array([t + s if abs(s) < 30.0 else s for *_, s, _ in rows], np.float64)
    return WifiScan(t, ids, rssi, np.array([f for *_, f in rows], np.int32), seen)


def records_of(drawn: list[tuple[tuple[str, float], tuple[Any, ...]]], known: np.ndarray) -> list[Record]:
    out: list[Record] = []
    now = 0.0
    for (kind, value), body in drawn:
        t = now + value if kind == "gap" else value
        if np.isfinite(t) and abs(t) < 1e11:
            now = t
        name, rest = body[0], body[1:]
        if name == "acceleration":
            out.append(Acceleration(t, *rest))
        elif name == "rotation_rate":
            out.append(RotationRate(t, *rest))
        elif name == "magnetic_field":
            out.append(MagneticField(t, *rest))
        elif name == "orientation":
            out.append(Orientation(t, *rest))
        elif name == "scan":
            out.append(scan_of(t, rest[0], known))
        elif (
            name == "walk"
        ):  # steps at 50 Hz, so that particles move on whatever has been said of the heading
            out += [
                Acceleration(t + 0.02 * k, 0.0, 0.0, 9.81 + 3.0 * np.sin(0.25 * k)) for k in range(rest[0])
            ]
            out.append(Orientation(t + 0.02 * rest[0], rest[1], 0.0, 0.0, 1.0))
        else:
            v = rest[1]
            out.append(
                [Pressure(t, v), BleReading(t, 1, v), Range(t, 1, v), Waypoint(t, v, v, "F1")][rest[0]]
            )
    return out


def check(estimates: list[Estimate]) -> None:
    for e in estimates:
        assert np.all(np.isfinite((e.t, e.x, e.y, e.cov_xx, e.cov_xy, e.cov_yy, e.r68, e.r95, e.ess)))
        assert 0.0 <= e.r68 <= e.r95
        assert e.floor in {0, 1}
        assert isinstance(e.state, State)
        assert e.cov_xx >= 0.0
        assert e.cov_yy >= 0.0
    assert np.all(np.diff([e.t for e in estimates]) >= 0.0)


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow])
@given(
    drawn=st.lists(st.tuples(TIME, BODY), max_size=25),
    constraint=st.sampled_from(["walkable", "barriers"]),
    lag=st.sampled_from([0.0, 3.0]),
)
def test_random_records_never_stop_a_track(world: Any, drawn: list, constraint: Any, lag: float) -> None:
    config = fused.Config(n_particles=20, map_constraint=constraint)
    tracker = fused.build(world.site, world.survey, config, lag=lag)
    records = records_of(drawn, world.survey.bssid[:30])
    state, out, verdicts = tracker.init("fuzz"), [], Counter()
    for record in records:
        state, more, verdict = tracker.step(state, record)
        assert isinstance(verdict, Verdict)
        verdicts[verdict] += 1
        out += more
        if verdict in {Verdict.LATE, Verdict.NOT_FINITE}:
            assert not more
    assert sum(verdicts.values()) == len(records)
    assert verdicts[Verdict.NOT_FINITE] == sum(
        not np.isfinite(r.t) for r in records if not isinstance(r, Waypoint)
    )
    _, more = tracker.flush(state, state.now)
    check(out + more)
