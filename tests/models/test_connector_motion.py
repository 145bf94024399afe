"""Particles on stairs, in lifts and on escalators: who boards, where they are on the way, and where they get off."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wayfuse.core.errors import ConfigError
from wayfuse.core.frames import GeoAnchor
from wayfuse.core.philox import Noise
from wayfuse.filters.cloud import NO_CONNECTOR, Cloud
from wayfuse.inertial.vertical import Behaviour, VerticalEvent
from wayfuse.maps.build import build_floor
from wayfuse.maps.connectors import Connector, ConnectorKind, Landing
from wayfuse.maps.site import Polygon, Site
from wayfuse.models.motion.connectors import UNLISTED, ConnectorMotion

ELEVATION = (0.0, 4.0, 8.0)
STAIRS, EXPRESS, LIFT, ESCALATOR, RAMP, LOCAL = range(6)  # connectors of `house`
# landings are apart by floors, so that places on the way can be told from places on a floor
CONNECTORS = (
    Connector(
        "stairs", ConnectorKind.STAIRS, (Landing(0, 10.0, 5.0), Landing(1, 14.0, 5.0), Landing(2, 14.0, 9.0))
    ),
    Connector("express stairs", ConnectorKind.STAIRS, (Landing(0, 40.0, 5.0), Landing(2, 44.0, 5.0))),
    Connector("lift", ConnectorKind.LIFT, (Landing(0, 70.0, 5.0), Landing(2, 70.0, 5.0))),
    Connector("escalator", ConnectorKind.ESCALATOR, (Landing(0, 10.0, 35.0), Landing(1, 18.0, 35.0)), (), 1),
    Connector("ramp", ConnectorKind.RAMP, (Landing(0, 40.0, 35.0), Landing(1, 60.0, 35.0))),
    Connector(
        "local lift",
        ConnectorKind.LIFT,
        (Landing(0, 80.0, 35.0), Landing(1, 80.0, 35.0), Landing(2, 80.0, 35.0)),
    ),
)
CORNER = ((0.0, 0.0), (5.0, -3.0), (-2.0, 4.0))  # m, of the floors' frames, in that of the lowest


def site_of(connectors: tuple[Connector, ...] = CONNECTORS, shifted: bool = False) -> Site:
    ring = Polygon(np.array([(0.0, 0.0), (90.0, 0.0), (90.0, 45.0), (0.0, 45.0), (0.0, 0.0)]))
    ground = GeoAnchor.from_origin(10.0, 50.0)
    anchors = [GeoAnchor.from_origin(*ground.to_lonlat(corner).tolist()) for corner in CORNER]
    floors = tuple(
        build_floor(f"F{i}", i, [ring], elevation=z, anchor=anchors[i] if shifted else None)
        for i, z in enumerate(ELEVATION)
    )
    return Site("house", floors, {}, connectors)


@pytest.fixture(scope="module")
def site() -> Site:
    return site_of()


@pytest.fixture(scope="module")
def motion(site: Site) -> ConnectorMotion:
    return ConnectorMotion(site=site)


def event(
    rise: float, kind: Behaviour = Behaviour.STAIRS, sigma: float = 0.3, steps: int = 0, over: bool = False
) -> VerticalEvent:
    return VerticalEvent(9.0, 0.0, kind, rise, sigma, steps, over, 8.0 if over else np.nan, True)


def cloud_at(x: float, y: float, floor: int, n: int = 400) -> Cloud:
    full = [np.full(n, value, np.float32) for value in (x, y, 0.1, 1.0)]
    return Cloud.on_floors(*full, np.full(n, floor, np.int32))


def spread(n: int = 500, seed: int = 1) -> Cloud:
    """Particles all over the house."""
    rng = np.random.default_rng(seed)
    columns = rng.uniform(0, 90, n), rng.uniform(0, 45, n), rng.normal(0, 0.2, n), rng.normal(1, 0.1, n)
    return Cloud.on_floors(*(c.astype(np.float32) for c in columns), rng.integers(0, 3, n).astype(np.int32))


def aboard(connector: int, floor: int, base: float, n: int = 300) -> Cloud:
    cloud = cloud_at(1.0, 1.0, floor, n)
    return cloud._replace(connector=np.full(n, connector, np.int32), base=np.full(n, base, np.float32))


def boarded(motion: ConnectorMotion, cloud: Cloud, said: VerticalEvent) -> tuple[Cloud, np.ndarray]:
    log_weights = np.zeros(cloud.n)
    return motion.board(Noise.of(3, "x"), cloud, said, log_weights), log_weights


def ended(motion: ConnectorMotion, cloud: Cloud, said: VerticalEvent, key: str = "x") -> tuple[Cloud, Any]:
    log_weights = np.zeros(cloud.n)
    return motion.end(Noise.of(4, key), cloud, said, log_weights), log_weights


def same(a: Cloud, b: Cloud) -> None:
    for one, other in zip(a, b, strict=True):
        np.testing.assert_array_equal(one, other)


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


# ---------------------------------------------------------------- the end


def test_the_floor_at_the_end_is_drawn_by_how_well_it_agrees(motion: ConnectorMotion) -> None:
    n, rise, sigma = 20_000, 2.2, 1.0
    out, weights = ended(motion, aboard(STAIRS, 0, 0.0, n), event(rise, sigma=sigma, over=True))
    z = np.array(ELEVATION)
    sd = np.hypot(sigma, motion.elevation_sigma + motion.elevation_relative * z)
    logits = np.append(np.maximum(-0.5 * ((z - rise) / sd) ** 2, -8.0), np.log(motion.half_way))
    share = np.exp(logits) / np.exp(logits).sum()
    rests = np.isclose(out.base, rise)
    found = np.array([*(np.mean((out.floor == f) & ~rests) for f in range(3)), rests.mean()])
    assert np.all(np.abs(found - share) <= 5 * np.sqrt(share * (1 - share) / n) + 1e-9)
    np.testing.assert_allclose(weights, logits.max())


def test_nobody_rests_in_a_lift_and_all_arrive_about_a_landing(motion: ConnectorMotion) -> None:
    for rise, floor in ((7.6, 2), (4.0, None), (1.0, 0)):
        out, weights = ended(motion, aboard(LIFT, 0, 0.0, 3000), event(rise, Behaviour.LIFT, over=True))
        assert not np.any(motion.is_half_way(out))
        assert np.all(out.connector == LIFT)  # who has arrived stands at the door until a step
        off = np.stack([out.x - 70.0, out.y - 5.0])
        np.testing.assert_allclose(off.mean(axis=1), 0.0, atol=5 * motion.scatter / np.sqrt(3000))
        np.testing.assert_allclose(off.std(axis=1), motion.scatter, rtol=0.08)
        if floor is None:  # between two stops: unlikely, whichever is taken
            assert weights.max() < -3.0
        else:
            assert np.mean(out.floor == floor) > 0.95


def test_a_movement_no_floor_explains_costs_weight_but_stays_finite(motion: ConnectorMotion) -> None:
    near, far = (
        ended(motion, aboard(LIFT, 0, 0.0), event(r, Behaviour.LIFT, over=True))[1] for r in (8.0, 40.0)
    )
    assert np.all(near > -0.2)
    np.testing.assert_allclose(far, -8.0)


def test_half_way_rests_and_goes_on_from_there(motion: ConnectorMotion) -> None:
    up, _ = ended(motion, motion.ride(aboard(STAIRS, 0, 0.0, 2000), event(2.2)), event(2.2, over=True))
    rests = motion.is_half_way(up)
    assert rests.mean() > 0.75
    np.testing.assert_allclose(up.base[rests], 2.2, atol=1e-6)
    np.testing.assert_allclose(up.x[rests], 12.2, atol=1e-4)
    same(motion.leave(Noise.of(1, "x"), up.take(np.flatnonzero(rests))), up.take(np.flatnonzero(rests)))
    # the second half: those who rested are for certain on these stairs, the rise counts from where they were
    again, weights = boarded(motion, up, event(1.0))
    assert np.all(again.connector[rests] == STAIRS)
    np.testing.assert_allclose(weights[rests], 0.0)
    np.testing.assert_allclose(again.x[rests], 13.2, atol=1e-4)
    out, _ = ended(motion, again.take(np.flatnonzero(rests)), event(1.8, over=True))
    assert np.mean(out.floor == 1) > 0.95
    back, _ = ended(motion, again.take(np.flatnonzero(rests)), event(-2.2, over=True))
    assert np.mean(back.floor == 0) > 0.95


def test_at_a_floor_between_people_have_arrived_and_do_not_rest(motion: ConnectorMotion) -> None:
    for rise in (3.8, 4.0, 4.2):
        way = motion.ride(aboard(STAIRS, 0, 0.0, 2000), event(3.0))
        out, _ = ended(motion, way, event(rise, over=True))
        assert np.mean(out.floor == 1) > 0.99
        assert not np.any(motion.is_half_way(out))
        off = np.hypot(out.x - 14.0, out.y - 5.0)[out.floor == 1]
        assert off.max() < 6 * motion.scatter


def test_who_rests_does_so_where_the_last_report_says(motion: ConnectorMotion) -> None:
    way = motion.ride(aboard(STAIRS, 0, 0.0, 2000), event(1.7))
    out, _ = ended(motion, way, event(2.5, over=True))
    rests = motion.is_half_way(out)
    assert rests.mean() > 0.5
    np.testing.assert_allclose(out.x[rests], 12.5, atol=1e-4)
    assert np.all(out.floor[rests] == 1)


def test_in_a_lift_nobody_is_on_a_floor_it_passes(motion: ConnectorMotion) -> None:
    cloud, seen = aboard(LOCAL, 0, 0.0), set()
    for rise in np.arange(0.0, 8.1, 0.25).tolist():
        cloud = motion.ride(cloud, event(rise, Behaviour.LIFT))
        seen |= set(cloud.floor.tolist())
    assert seen == {0, 2}
    down = motion.ride(aboard(LOCAL, 1, 4.0), event(-3.9, Behaviour.LIFT))
    assert set(down.floor.tolist()) == {0}
    half = motion.ride(aboard(LOCAL, 0, 0.0, 1000), event(4.1, Behaviour.LIFT))
    out, weights = ended(motion, half, event(4.1, Behaviour.LIFT, over=True))
    assert np.mean(out.floor == 1) > 0.99  # where it stopped
    assert np.all(weights > -0.1)


def test_settled_are_on_the_nearest_floor_and_others_stay(motion: ConnectorMotion) -> None:
    for base, floor, place in ((1.4, 0, (10.0, 5.0)), (2.6, 1, (14.0, 5.0)), (7.0, 2, (14.0, 9.0))):
        out = motion.settle(aboard(STAIRS, 1, base))
        assert set(out.floor.tolist()) == {floor}
        assert (out.x[0], out.y[0]) == place
        assert not np.any(motion.is_half_way(out))
    at_floor = aboard(STAIRS, 1, 4.0)
    same(motion.settle(at_floor), at_floor)
    same(motion.settle(spread()), spread())


@pytest.mark.parametrize(("connector", "chance"), [(STAIRS, 0.2), (LIFT, 0.5), (ESCALATOR, 0.2)])
def test_some_leave_at_each_step(motion: ConnectorMotion, connector: int, chance: float) -> None:
    n = 5000
    cloud = aboard(connector, 0, 0.0, n)
    out = motion.leave(Noise.of(7, "x"), cloud)
    off = out.connector == NO_CONNECTOR
    assert abs(off.mean() - chance) < 5 * np.sqrt(chance * (1 - chance) / n)
    same(out._replace(connector=cloud.connector), cloud)


def test_doubt_lowers_those_who_stayed_more_the_higher_the_rise(motion: ConnectorMotion) -> None:
    cloud, _ = boarded(motion, spread(), event(0.5))
    stayed = cloud.connector == NO_CONNECTOR
    assert 0 < stayed.sum() < cloud.n
    weights = [np.zeros(cloud.n)]
    for before, rise in ((0.0, 0.5), (0.5, 1.0), (1.0, 2.0), (2.0, 30.0), (30.0, 31.0)):
        log_weights = weights[-1].copy()
        motion.doubt(cloud, before, rise, 0.3, log_weights)
        weights.append(log_weights)
    assert all(np.all(w[~stayed] == 0.0) for w in weights)
    levels = [w[stayed][0] for w in weights]
    assert levels == sorted(levels, reverse=True)
    np.testing.assert_allclose(levels[-1], -8.0)  # and no further
    back = weights[3].copy()  # a rise taken back gives the weight back
    motion.doubt(cloud, 2.0, 0.0, 0.3, back)
    np.testing.assert_allclose(back, 0.0, atol=1e-12)


def test_a_movement_taken_back_leaves_the_floors(motion: ConnectorMotion) -> None:
    before = spread(4000)
    for kind in (Behaviour.STAIRS, Behaviour.LIFT):
        cloud, _ = boarded(motion, before, event(0.9, kind))
        cloud = motion.ride(cloud, event(1.2, kind))
        out, _ = ended(motion, cloud, event(0.0, kind, over=True))
        assert np.mean(out.floor == before.floor) > 0.998
        straight, _ = boarded(motion, before, event(0.0, kind, over=True))
        straight, _ = ended(motion, straight, event(0.0, kind, over=True))
        assert np.mean(straight.floor == before.floor) > 0.998
        assert np.all(np.isfinite(out.x) & np.isfinite(straight.x))


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
