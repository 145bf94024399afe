from __future__ import annotations

import numpy as np
import pytest
from made_up_walks import House, track

from wayfuse.evaluation.estimates_file import WalkEstimates
from wayfuse.evaluation.stability import count_flaps, jump_lengths, stability
from wayfuse.evaluation.truth import CommonFrame


def test_a_jump_is_more_than_three_metres_a_second_and_one_metre() -> None:
    t = np.array([0.0, 1.0, 2.0, 4.0, 4.0 + 1e-3])
    xy = np.array([(0, 0), (3.99, 0), (8.0, 0), (8.0, 6.9), (8.0, 9.0)])
    np.testing.assert_allclose(jump_lengths(t, xy), [4.01, 2.1])


def test_a_walker_makes_no_jumps() -> None:
    t = np.arange(0.0, 60.0, 0.5)
    walk = np.stack([1.3 * t, 0.5 * np.sin(t)], axis=1)
    found = stability([track(t, walk)])
    assert (found.n_jumps, found.longest_jump, found.n_floor_changes) == (0, 0.0, 0)
    assert found.minutes == pytest.approx(59.5 / 60)


def floors(letters: str, spacing: float = 1.0) -> tuple[int, int]:
    return count_flaps(spacing * np.arange(len(letters)), np.array(list(letters)))


@pytest.mark.parametrize(
    ("letters", "changes", "flaps"),
    [
        ("aaaa", 0, 0),
        ("aabb", 1, 0),
        ("abaa", 2, 1),  # one change taken back
        ("abab", 3, 2),  # the taking back is taken back
        ("abca", 3, 0),  # through three floors: no change is undone
        ("a", 0, 0),
        ("", 0, 0),
    ],
)
def test_floor_changes_and_flaps(letters: str, changes: int, flaps: int) -> None:
    assert floors(letters) == (changes, flaps)


def test_a_change_taken_back_late_is_no_flap() -> None:
    assert floors("abbbbbbbbba", 1.0) == (2, 1)  # after 9 s
    assert floors("abbbbbbbbbba", 1.0) == (2, 1)  # after 10 s
    assert floors("abbbbbbbbbbba", 1.0) == (2, 0)  # after 11 s


def test_counts_add_up_and_are_given_per_minute() -> None:
    jumpy = track([0.0, 30.0, 31.0], [(0, 0), (0, 0), (50, 0)], ["F1", "F2", "F1"])
    found = stability([jumpy, jumpy])
    assert (found.n_jumps, found.longest_jump, found.n_floor_changes, found.n_floor_flaps) == (2, 50.0, 4, 2)
    assert found.per_minute(found.n_jumps) == pytest.approx(2 / (62 / 60))
    assert np.isnan(stability([track([1.0], [(0, 0)])]).per_minute(1))


def test_a_change_of_floor_between_frames_is_no_jump() -> None:
    house = House(offsets=((0, 0), (0, 0), (100.0, 0.0)))
    climbs = track([0.0, 1.0], [(50.0, 0.0), (-50.0, 0.0)], ["F1", "F2"])
    assert stability([climbs]).n_jumps == 1
    assert stability([climbs], CommonFrame(house)).n_jumps == 0


def test_the_leap_from_the_prior_to_the_first_fix_is_no_jump() -> None:
    t = np.arange(4.0)
    xy = np.array([[50.0, 50.0], [5.0, 5.0], [6.0, 5.0], [30.0, 5.0]])
    state = np.array(["initialising", "initialising", "tracking", "tracking"])
    leaping = WalkEstimates(
        walk="w",
        method="m",
        t=t,
        xy=xy,
        floor=np.array(["B1", "F1", "F1", "F1"]),
        lonlat=np.full((4, 2), np.nan),
        numbers={},
        state=state,
    )
    counted = stability([leaping])
    assert (counted.n_jumps, counted.n_floor_changes) == (1, 0)
    assert counted.longest_jump == 24.0
