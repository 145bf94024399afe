"""Particles on stairs, in lifts and on escalators: who boards, and where they are on the way."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_up_stairs import (
    CONNECTORS,
    CORNER,
    ELEVATION,
    ESCALATOR,
    EXPRESS,
    LIFT,
    RAMP,
    STAIRS,
    aboard,
    boarded,
    cloud_at,
    ended,
    event,
    same,
    site_of,
    spread,
)

from wayfuse.core.errors import ConfigError
from wayfuse.core.philox import Noise
from wayfuse.filters.cloud import NO_CONNECTOR, Cloud
from wayfuse.inertial.vertical import Behaviour
from wayfuse.maps.site import Site
from wayfuse.models.motion.connectors import UNLISTED, ConnectorMotion


@pytest.fixture(scope="module")
def site() -> Site:
    return site_of()


@pytest.fixture(scope="module")
def motion(site: Site) -> ConnectorMotion:
    return ConnectorMotion(site=site)


# ---------------------------------------------------------------- boarding


@settings(max_examples=40)
@given(
    far=st.floats(0.0, 12.0),
    angle=st.floats(0.0, 6.3),
    steps=st.integers(0, 20),
    kind=st.sampled_from([Behaviour.STAIRS, Behaviour.LIFT, Behaviour.ESCALATOR]),
)
def test_the_odds_to_board_are_those_of_the_formula(
    motion: ConnectorMotion, far: float, angle: float, steps: int, kind: Behaviour
) -> None:
    at = CONNECTORS[STAIRS].landings[1]
    cloud = cloud_at(at.x + far * np.cos(angle), at.y + far * np.sin(angle), 1, 3)
    _, weights = boarded(motion, cloud, event(2.0, kind, steps=steps))
    k = {Behaviour.STAIRS: 1.0, Behaviour.LIFT: motion.other_kind, Behaviour.ESCALATOR: motion.like_kind}
    d2 = (cloud.x[0].item() - at.x) ** 2 + (cloud.y[0].item() - at.y) ** 2
    width = motion.sigma + motion.per_step * steps
    total = k[kind] * np.exp(-d2 / (2 * width**2)) + motion.unlisted + motion.false_alarm
    np.testing.assert_allclose(weights, np.log(total), atol=1e-6)


def test_the_share_that_boards_is_the_share_of_the_odds(motion: ConnectorMotion) -> None:
    n = 20_000
    at = CONNECTORS[STAIRS].landings[0]
    after, _ = boarded(motion, cloud_at(at.x + 8.0, at.y, 0, n), event(1.0))
    odds = np.array([np.exp(-0.5 * (8.0 / 3.0) ** 2), motion.unlisted, motion.false_alarm])
    share = odds / odds.sum()
    found = np.array([np.mean(after.connector == c) for c in (STAIRS, UNLISTED, NO_CONNECTOR)])
    assert found.sum() == 1.0
    assert np.all(np.abs(found - share) < 5 * np.sqrt(share * (1 - share) / n))


@pytest.mark.parametrize(
    ("place", "floor", "rise", "kind", "boards"),
    [
        ((10.0, 5.0), 0, 1.0, Behaviour.STAIRS, STAIRS),
        ((10.0, 5.0), 0, -1.0, Behaviour.STAIRS, None),  # there is nothing below
        ((14.0, 5.0), 1, 1.0, Behaviour.STAIRS, STAIRS),
        ((14.0, 5.0), 1, -1.0, Behaviour.STAIRS, STAIRS),
        ((14.0, 9.0), 2, 1.0, Behaviour.STAIRS, None),
        ((14.0, 9.0), 2, -1.0, Behaviour.STAIRS, STAIRS),
        ((42.0, 5.0), 1, 1.0, Behaviour.STAIRS, None),  # passed without a stop
        ((70.0, 5.0), 0, 1.0, Behaviour.LIFT, LIFT),
        ((70.0, 5.0), 1, 1.0, Behaviour.LIFT, None),
        ((10.0, 35.0), 0, 1.0, Behaviour.ESCALATOR, ESCALATOR),
        ((18.0, 35.0), 1, -1.0, Behaviour.ESCALATOR, None),  # it goes up only
        ((18.0, 35.0), 1, 1.0, Behaviour.ESCALATOR, None),
        ((40.0, 35.0), 0, 1.0, Behaviour.STAIRS, RAMP),
    ],
)
def test_who_boards_depends_on_floor_and_direction(
    motion: ConnectorMotion,
    place: tuple[float, float],
    floor: int,
    rise: float,
    kind: Behaviour,
    boards: int | None,
) -> None:
    after, weights = boarded(motion, cloud_at(*place, floor), event(rise, kind))
    if boards is None:
        assert np.all(after.connector < 0)
        np.testing.assert_allclose(weights, np.log(motion.unlisted + motion.false_alarm), atol=0.05)
    else:
        assert np.mean(after.connector == boards) > 0.9
        assert set(after.connector.tolist()) <= {boards, UNLISTED, NO_CONNECTOR}
        assert np.all(weights > -0.1)


def test_the_reported_kind_is_likelier_than_another_but_not_by_force(motion: ConnectorMotion) -> None:
    at = (10.0, 5.0)
    level = {
        kind: boarded(motion, cloud_at(*at, 0, 2), event(1.0, kind))[1][0] for kind in list(Behaviour)[2:]
    }
    assert level[Behaviour.STAIRS] > level[Behaviour.ESCALATOR] > level[Behaviour.LIFT]
    assert level[Behaviour.LIFT] > np.log(motion.unlisted + motion.false_alarm)


def test_more_steps_forgive_more_distance(motion: ConnectorMotion) -> None:
    far = cloud_at(20.0, 5.0, 0, 2)
    weights = [boarded(motion, far, event(1.0, steps=n))[1][0] for n in (0, 10, 30)]
    assert weights[0] < weights[1] < weights[2]


@pytest.mark.parametrize("rise", [3.0, -3.0, 0.0])
def test_a_site_without_connectors_lets_everybody_ride_unlisted_or_stay(rise: float) -> None:
    bare = ConnectorMotion(site=site_of(()))
    after, weights = boarded(bare, spread(), event(rise))
    assert set(np.unique(after.connector)) == {UNLISTED, NO_CONNECTOR}
    np.testing.assert_allclose(weights, np.log(bare.unlisted_alone + bare.false_alarm))
    same(bare.leave(Noise.of(1, "y"), spread()), spread())
    out, _ = ended(bare, after, event(rise, over=True))
    assert np.all(out.connector == NO_CONNECTOR)


# ---------------------------------------------------------------- on the way


@pytest.mark.parametrize("rise", [0.0, 1.0, 2.5, 4.0, 5.5, 8.0, 11.0])
def test_on_stairs_the_place_is_between_the_landings_at_that_height(
    motion: ConnectorMotion, rise: float
) -> None:
    after = motion.ride(aboard(STAIRS, 0, 0.0), event(rise))
    z = min(rise, 8.0)
    x = np.interp(z, ELEVATION, (10.0, 14.0, 14.0))
    y = np.interp(z, ELEVATION, (5.0, 5.0, 9.0))
    np.testing.assert_allclose(after.x, x, atol=1e-5)
    np.testing.assert_allclose(after.y, y, atol=1e-5)
    nearest = int(np.argmin(np.abs(np.array(ELEVATION) - z)))
    if abs(abs(z - ELEVATION[nearest]) - 2.0) > motion.hysteresis:
        assert np.all(after.floor == nearest)


def test_half_way_a_floor_is_kept_until_another_is_clearly_nearer(motion: ConnectorMotion) -> None:
    for start, base in ((0, 0.0), (1, 4.0)):
        for z in (1.9, 2.0, 2.1):
            after = motion.ride(aboard(STAIRS, start, base), event(z - base))
            assert np.all(after.floor == start)
    assert np.all(motion.ride(aboard(STAIRS, 0, 0.0), event(2.2)).floor == 1)
    assert np.all(motion.ride(aboard(STAIRS, 1, 4.0), event(-2.2)).floor == 0)


def test_stairs_pass_a_served_floor_and_a_lift_never_says_one_it_skips(motion: ConnectorMotion) -> None:
    seen: dict[int, set[int]] = {STAIRS: set(), EXPRESS: set(), LIFT: set()}
    for connector, floors in seen.items():
        cloud = aboard(connector, 0, 0.0)
        for rise in np.arange(0.0, 9.0, 0.25).tolist():
            kind = Behaviour.LIFT if connector == LIFT else Behaviour.STAIRS
            cloud = motion.ride(cloud, event(rise, kind))
            floors |= set(cloud.floor.tolist())
            out, _ = ended(motion, cloud, event(rise, kind, over=True))
            arrived = ~motion.is_half_way(out)
            floors |= set(out.floor[arrived].tolist())
    assert seen == {STAIRS: {0, 1, 2}, EXPRESS: {0, 2}, LIFT: {0, 2}}


def test_an_unlisted_connector_keeps_place_and_floor_until_the_end(motion: ConnectorMotion) -> None:
    cloud = aboard(UNLISTED, 1, 4.0)
    same(motion.ride(cloud, event(3.7)), cloud)
    out, weights = ended(motion, cloud, event(3.9, over=True))
    assert np.mean(out.floor == 2) > 0.99
    assert np.all(out.connector == NO_CONNECTOR)
    np.testing.assert_allclose([out.x.mean(), out.y.mean()], 1.0, atol=0.2)
    assert np.all(weights > -0.1)


@pytest.mark.parametrize("connector", [STAIRS, UNLISTED])
def test_places_are_taken_into_the_frame_of_the_floor(connector: int) -> None:
    shifted = site_of(shifted=True)
    motion = ConnectorMotion(site=shifted)
    offset = np.array(CORNER[0]) - np.array(CORNER[1])
    np.testing.assert_allclose(shifted.shift(0, 1), offset, atol=1e-3)
    if connector == STAIRS:
        low, high = np.array((10.0, 5.0)), np.array((14.0, 5.0))
        up = motion.ride(aboard(STAIRS, 0, 0.0), event(1.0))  # still said to be on the lower floor
        want = 0.75 * low + 0.25 * (high - offset)
        np.testing.assert_allclose([up.x[0], up.y[0]], want, atol=1e-2)
        up = motion.ride(aboard(STAIRS, 0, 0.0), event(3.0))
        assert up.floor[0] == 1
        np.testing.assert_allclose([up.x[0], up.y[0]], 0.25 * (low + offset) + 0.75 * high, atol=1e-2)
        out, _ = ended(motion, up, event(4.0, over=True))
        np.testing.assert_allclose([out.x.mean(), out.y.mean()], high, atol=0.2)
    else:
        out, _ = ended(motion, aboard(UNLISTED, 0, 0.0, 3000), event(4.0, over=True))
        on = out.floor == 1
        assert on.mean() > 0.95
        found = [out.x[on].mean(), out.y[on].mean()]
        np.testing.assert_allclose(found, np.array((1.0, 1.0)) + offset, atol=0.1)


# ---------------------------------------------------------------- contracts


def everything(motion: ConnectorMotion, cloud: Cloud, rise: float, kind: Behaviour) -> list[Cloud]:
    """The clouds of a movement from its begin to the steps after it."""
    noise, log_weights = Noise.of(5, "x"), np.zeros(cloud.n)
    on = motion.board(noise, cloud, event(0.3 * rise, kind), log_weights)
    motion.doubt(on, 0.0, rise, 0.4, log_weights)
    way = motion.ride(on, event(rise, kind))
    out = motion.end(noise, way, event(rise, kind, over=True), log_weights)
    left = motion.leave(noise, out)
    assert np.all(np.isfinite(log_weights))
    return [on, way, out, left, motion.settle(left)]


@settings(max_examples=60)
@given(
    rise=st.one_of(st.floats(-12.0, 12.0), st.sampled_from([1e6, -1e6, 1e-30, 0.0, -0.0])),
    kind=st.sampled_from([Behaviour.STAIRS, Behaviour.LIFT, Behaviour.ESCALATOR]),
    seed=st.integers(0, 50),
)
def test_every_cloud_is_whole_whatever_the_rise(
    motion: ConnectorMotion, rise: float, kind: Behaviour, seed: int
) -> None:
    before = spread(60, seed)
    kept = [column.copy() for column in before]
    served = [set(c.floors) for c in CONNECTORS]
    for cloud in everything(motion, before, rise, kind):
        for name, column in cloud._asdict().items():
            assert column.shape == (60,)
            assert column.dtype == (np.int32 if name in ("floor", "connector") else np.float32)
            assert np.all(np.isfinite(column))
        assert np.all((cloud.floor >= 0) & (cloud.floor < 3))
        assert np.all((cloud.connector >= UNLISTED) & (cloud.connector < len(CONNECTORS)))
        for i in np.flatnonzero(cloud.connector >= 0):
            assert cloud.floor[i] in served[cloud.connector[i]]
        np.testing.assert_array_equal(cloud.heading_bias, before.heading_bias)
        np.testing.assert_array_equal(cloud.step_scale, before.step_scale)
    same(before, Cloud(*kept))  # nothing written in place


def test_nothing_is_written_into_a_cloud_that_was_given(motion: ConnectorMotion) -> None:
    half = aboard(STAIRS, 0, 2.0)
    for act in (
        lambda c: motion.board(Noise.of(1, "x"), c, event(1.0), np.zeros(c.n)),
        lambda c: motion.ride(c, event(1.0)),
        lambda c: motion.end(Noise.of(1, "x"), c, event(2.0, over=True), np.zeros(c.n)),
        lambda c: motion.leave(Noise.of(1, "x"), c),
        motion.settle,
    ):
        for column in half:
            column.setflags(write=False)
        act(half)  # a write would raise
        for column in half:
            column.setflags(write=True)


@pytest.mark.parametrize("kind", [Behaviour.STAIRS, Behaviour.LIFT])
def test_a_particles_fate_does_not_depend_on_the_others(motion: ConnectorMotion, kind: Behaviour) -> None:
    cloud = spread(300)
    whole = everything(motion, cloud, 3.9, kind)
    few = everything(motion, cloud.take(np.arange(7)), 3.9, kind)
    for a, b in zip(whole, few, strict=True):
        same(a.take(np.arange(7)), b)
    again = everything(motion, cloud, 3.9, kind)
    for a, b in zip(whole, again, strict=True):
        same(a, b)


@pytest.mark.parametrize(
    "name", ["sigma", "false_alarm", "unlisted", "unlisted_alone", "elevation_sigma", "half_way"]
)
def test_parameters_out_of_range_are_refused(site: Site, name: str) -> None:
    for value in (0.0, -1.0, np.nan):
        with pytest.raises(ConfigError, match=name):
            ConnectorMotion(site=site, **{name: value})
