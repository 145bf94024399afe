"""Where a movement between floors ends: on a floor, or half-way; who leaves, and who is doubted."""

from __future__ import annotations

import numpy as np
import pytest
from made_up_stairs import (
    ELEVATION,
    ESCALATOR,
    LIFT,
    LOCAL,
    STAIRS,
    aboard,
    boarded,
    ended,
    event,
    same,
    site_of,
    spread,
)

from wayfuse.core.philox import Noise
from wayfuse.filters.cloud import NO_CONNECTOR
from wayfuse.inertial.vertical import Behaviour
from wayfuse.models.motion.connectors import ConnectorMotion


@pytest.fixture(scope="module")
def motion() -> ConnectorMotion:
    return ConnectorMotion(site=site_of())


def test_the_floor_at_the_end_is_drawn_by_how_well_it_agrees(motion: ConnectorMotion) -> None:
    n, rise, sigma = 20_000, 2.2, 1.0
    out, weights = ended(motion, aboard(STAIRS, 0, 0.0, n), event(rise, sigma=sigma, over=True))
    z = np.array(ELEVATION)
    sd = np.hypot(sigma, motion.elevation_sigma + motion.elevation_relative * z)
    logits = np.append(np.maximum(-0.5 * ((z - rise) / sd) ** 2, -8.0), np.log(motion.half_way))
    logits[0] += np.log(motion.turn_back)  # where they began
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
