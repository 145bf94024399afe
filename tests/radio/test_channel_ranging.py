"""Ranges of the frames of a moment, and the model on disk."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from wayfuse.core.errors import ConfigError, RadioMapError
from wayfuse.core.philox import Noise
from wayfuse.radio.archive import read_archive, write_archive
from wayfuse.radio.channel_model import ChannelModel, fit_channel_model, load_channel_model
from wayfuse.radio.channel_ranging import ChannelRanging, ChannelState
from wayfuse.radio.csi import INTEL5300_20MHZ, direct_path_power, fourier_order, subcarriers_of
from wayfuse.radio.ranging import RangeRegression
from wayfuse.sensors.quality import Verdict
from wayfuse.sensors.records import CsiFrame

A, B, FOREIGN = 11, 12, 99
LAW = RangeRegression(-2.0, -0.08)  # 10 m at -53.8 dBm
MODEL = ChannelModel({A: (LAW, LAW), B: (LAW, LAW)}, INTEL5300_20MHZ, "hall")


def frame(t: float, anchor: int, rss: float, antennas: int = 2, n: int = 30) -> CsiFrame:
    return CsiFrame(t, anchor, np.ones((antennas, 1, n), np.complex64), rss, 0.0, -92.0)


def feed(ranging: ChannelRanging, *frames: CsiFrame) -> tuple[ChannelState | None, list[Verdict]]:
    state, verdicts = None, []
    for one in frames:
        state, verdict = ranging.step(state, one)
        verdicts.append(verdict)
    return state, verdicts


def test_a_moment_gives_one_range_per_anchor_of_the_median_power() -> None:
    ranging = ChannelRanging(model=MODEL)
    levels = (-60.0, -90.0, -58.0)  # one deep fade
    state, verdicts = feed(
        ranging, *(frame(0.1 * k, A, rss) for k, rss in enumerate(levels)), frame(0.2, B, -50.0)
    )
    assert set(verdicts) == {Verdict.USED}
    assert state is not None
    assert ranging.end_of(state) == pytest.approx(0.5)
    far, near = ranging.ranges(state, 0.5)
    assert (far.anchor, near.anchor, far.t, near.t) == (A, B, 0.5, 0.5)
    middle = direct_path_power(frame(0.0, A, -60.0))[0]
    assert far.distance == pytest.approx(float(LAW.distance(middle)))
    assert near.distance < far.distance


def test_an_antenna_that_hears_nothing_is_left_out() -> None:
    deaf = frame(0.0, A, -60.0)
    deaf.csi[1] = 0.0
    ranging = ChannelRanging(model=MODEL)
    state, verdicts = feed(ranging, deaf)
    assert verdicts == [Verdict.USED]
    assert state is not None
    (found,) = ranging.ranges(state, 1.0)
    assert found.distance == pytest.approx(float(LAW.distance(direct_path_power(deaf)[0])))
    fewer, _ = feed(ranging, frame(0.0, A, -60.0, antennas=1))
    assert fewer is not None
    assert np.isnan(fewer.heard[0][1][1])


def test_frames_of_which_nothing_can_be_made_are_told_apart() -> None:
    ranging = ChannelRanging(model=MODEL)
    silent, unlevelled = frame(0.0, A, -60.0), frame(0.0, A, float("nan"))
    silent.csi[:] = 0.0
    state, verdicts = feed(
        ranging, frame(0.0, FOREIGN, -50.0), frame(0.0, A, -50.0, n=64), silent, unlevelled
    )
    assert state is None
    assert verdicts == [
        Verdict.UNKNOWN_ACCESS_POINTS,
        Verdict.OUT_OF_RANGE,
        Verdict.NOT_FINITE,
        Verdict.NOT_FINITE,
    ]
    huge = frame(0.0, A, -60.0)
    huge.csi[:] = np.complex64(complex(np.inf, 0.0))
    assert feed(ranging, huge)[1] == [Verdict.NOT_FINITE]


def test_a_moment_does_not_grow_without_end() -> None:
    ranging = ChannelRanging(model=MODEL)
    state = ChannelState(0.0, ((A, (-60.0, -60.0)),) * 4096)
    after, verdict = ranging.step(state, frame(0.1, A, -60.0))
    assert after is state
    assert verdict is Verdict.IGNORED
    with pytest.raises(ConfigError, match="moment"):
        ChannelRanging(model=MODEL, moment=0.0)


def surveyed(n: int = 400) -> tuple[list[CsiFrame], np.ndarray]:
    """Frames of two anchors that keep to the law but for fading, and their distances."""
    noise, frames, distances = Noise.of(0, "survey"), [], []
    for k, (u, z) in enumerate(zip(noise.uniforms(n)[0].tolist(), noise.normals(n)[0].tolist(), strict=True)):
        distance = 1.0 + 14.0 * u
        power = (np.log(distance) - LAW.log_scale) / LAW.rate + 2.0 * z
        offset = float(direct_path_power(frame(0.0, A, 0.0))[0])
        frames.append(frame(0.1 * k, (A, B)[k % 2], power - offset))
        distances.append(distance)
    return frames, np.array(distances)


def test_a_fitted_model_comes_back_from_disk(tmp_path: Path) -> None:
    model = fit_channel_model(*surveyed(), site="hall")
    assert list(model.anchors) == [A, B]
    for antennas in model.anchors.values():
        for antenna in antennas:
            assert antenna.distance(-55.0) == pytest.approx(float(LAW.distance(-55.0)), rel=0.1)
    model.save(tmp_path / "model.npz")
    again = load_channel_model(tmp_path / "model.npz")
    assert (again.site, dict(again.anchors)) == ("hall", dict(model.anchors))
    np.testing.assert_array_equal(again.subcarriers, INTEL5300_20MHZ)


def test_antennas_may_differ_in_number(tmp_path: Path) -> None:
    replace(MODEL, anchors={A: (LAW,), B: (LAW, LAW)}).save(tmp_path / "m.npz")
    assert [len(v) for v in load_channel_model(tmp_path / "m.npz").anchors.values()] == [1, 2]


def test_what_cannot_be_fitted_or_read_is_named(tmp_path: Path) -> None:
    with pytest.raises(RadioMapError, match="no channel state"):
        fit_channel_model([], np.empty(0))
    with pytest.raises(RadioMapError, match=r"\[30, 64\] subcarriers"):
        fit_channel_model([frame(0.0, A, -50.0), frame(0.0, A, -50.0, n=64)], np.ones(2))
    with pytest.raises(ConfigError, match="31 subcarriers"):
        fit_channel_model([frame(0.0, A, -50.0, n=31)], np.ones(1))
    one_place = [frame(0.1 * k, A, -50.0) for k in range(20)]
    with pytest.raises(RadioMapError, match="00:00:00:00:00:0b has 1 surveyed distances"):
        fit_channel_model(one_place, np.full(20, 3.0))
    write_archive(tmp_path / "odd.npz", "channel-model", 1, {"site": "x"}, {"anchor": np.ones(2)})
    with pytest.raises(RadioMapError, match="not a channel model"):
        load_channel_model(tmp_path / "odd.npz")
    assert read_archive(tmp_path / "odd.npz")[0] == "channel-model"
    of_floats = {
        "anchor": np.array([np.nan]),
        "regressions": np.ones((1, 1, 2)),
        "subcarriers": np.arange(30),
    }
    write_archive(tmp_path / "odd.npz", "channel-model", 1, {"site": "x"}, of_floats)
    with pytest.raises(RadioMapError, match="not a channel model"):
        load_channel_model(tmp_path / "odd.npz")


def test_cards_are_known_by_their_subcarriers() -> None:
    np.testing.assert_array_equal(subcarriers_of(30), INTEL5300_20MHZ)
    np.testing.assert_array_equal(subcarriers_of(64), fourier_order(64))
