"""Walkers: exact steps, a path that stays in the corridors, a heading that follows it."""

from __future__ import annotations

import numpy as np
import pytest

from wayfuse.core.angles import wrap
from wayfuse.simulator.geometry import crossings
from wayfuse.simulator.routes import Route
from wayfuse.simulator.walker import GRID_HZ, Person, WalkerModel, draw_person, walk


def l_shape(pause: float = 0.0) -> Route:
    return Route(np.array([(0.0, 0.0), (12.0, 0.0), (12.0, 9.0)]), np.array([0.0, pause, 0.0]))


PERSON = Person(step_rate=1.8, step_length=0.7, bounce=0.8)


def test_steps_add_up_to_the_way():
    for seed in range(10):
        w = walk(l_shape(3.0), PERSON, WalkerModel(), np.random.default_rng(seed))
        assert w.step_length.sum() == pytest.approx(21.0)
        assert (np.diff(w.contact) > 0.3).all()
        assert (w.step_length > 0.1).all()
        np.testing.assert_allclose(np.interp(w.contact, w.phase_t, w.phase), np.arange(1, len(w.contact) + 1))


def test_without_jitter_the_number_of_steps_is_the_length_over_the_step():
    model = WalkerModel(rate_jitter=0.0, length_jitter=0.0)
    route = Route(np.array([(0.0, 0.0), (35.0, 0.0)]), np.zeros(2))
    w = walk(route, PERSON, model, np.random.default_rng(0))
    assert len(w.contact) == 50  # one short first step, the last a little longer
    assert np.diff(w.contact) == pytest.approx(1 / 1.8)


def test_the_path_passes_the_way_points_and_stands_where_told():
    w = walk(l_shape(4.0), PERSON, WalkerModel(), np.random.default_rng(0))
    np.testing.assert_allclose(w.xy[0], (0, 0), atol=1e-9)
    np.testing.assert_allclose(w.xy[-1], (12, 9), atol=1e-2)
    assert len(w.stated) == 4  # start, arrival, departure, end
    arrival, departure = w.stated[1, 0], w.stated[2, 0]
    assert departure - arrival == pytest.approx(4.0)
    standing = (w.t > arrival + 0.6) & (w.t < departure - 0.6)
    np.testing.assert_allclose(w.xy[standing], np.broadcast_to((12.0, 0.0), (standing.sum(), 2)), atol=1e-6)
    assert w.gait[standing].max() == 0.0


def test_a_corner_is_rounded_not_cut():
    w = walk(l_shape(), PERSON, WalkerModel(), np.random.default_rng(0))
    to_corner = np.hypot(*(w.xy - (12.0, 0.0)).T)
    assert 0.02 < to_corner.min() < 0.35
    assert w.heading[0] == pytest.approx(0.0, abs=1e-9)
    assert w.heading[-1] == pytest.approx(0.5 * np.pi)
    assert np.abs(np.diff(w.heading)).max() * GRID_HZ < 3.0  # rad/s


def test_persons_are_within_what_adults_do():
    people = [draw_person(WalkerModel(), np.random.default_rng(seed)) for seed in range(200)]
    speed = np.array([p.step_rate * p.step_length for p in people])
    assert speed.mean() == pytest.approx(1.2, abs=0.05)
    assert all(1.6 <= p.step_rate <= 2.0 and 0.5 <= p.step_length <= 0.84 for p in people)
    assert speed.std() > 0.05


def test_walks_stay_in_walkable_space_and_cross_no_wall(sim_site, sim_walks):
    for _, truth in sim_walks:
        storey = sim_site.building.storeys[truth.floor]
        xy = truth.xy[::5]
        assert storey.is_walkable(xy).all()
        assert not crossings(xy[:-1], xy[1:], storey.walls).any()


def test_walks_have_the_speed_and_the_length_asked_for(sim_walks, sim_scenario):
    for recording, truth in sim_walks:
        speed = np.hypot(*np.diff(truth.xy, axis=0).T) * GRID_HZ
        assert speed.max() < 2.2
        assert 0.8 < np.median(speed[truth.walking[1:] > 0.99]) < 1.6
        low, high = sim_scenario.duration_s
        start, stop = recording.span
        assert 0.6 * low < stop - start < 1.6 * high


def test_heading_is_the_direction_of_the_path(sim_walks):
    for _, truth in sim_walks:
        step = truth.xy[20:] - truth.xy[:-20]
        moving = np.hypot(*step.T) > 0.15
        error = wrap(np.arctan2(step[:, 1], step[:, 0]) - truth.heading[10:-10])[moving]
        assert np.median(np.abs(error)) < 0.02
        assert np.quantile(np.abs(error), 0.95) < 0.5
        assert (np.abs(truth.heading) <= np.pi).all()


def test_stated_places_are_the_truth_but_for_the_surveyor(sim_walks):
    errors = []
    for recording, truth in sim_walks:
        stated = np.array([(w.t, w.x, w.y) for w in recording.waypoints])
        assert (np.diff(stated[:, 0]) > 0).all()
        errors.append(stated[:, 1:] - truth.at(stated[:, 0]))
    pooled = np.concatenate(errors)
    assert len(pooled) > 50
    assert pooled.std() == pytest.approx(0.1, rel=0.2)
    assert np.abs(pooled).max() < 0.5


def test_between_stated_places_the_walk_is_nearly_linear_in_time(sim_walks):
    """Scores interpolate linearly between way-points: the truth must not stray from that by much."""
    worst = []
    for recording, truth in sim_walks:
        stated = np.array([(w.t, w.x, w.y) for w in recording.waypoints])
        inner = (truth.t >= stated[0, 0]) & (truth.t <= stated[-1, 0])
        line = np.column_stack([np.interp(truth.t[inner], stated[:, 0], stated[:, k]) for k in (1, 2)])
        worst.append(np.hypot(*(line - truth.xy[inner]).T).mean())
    assert np.mean(worst) < 0.4
