"""The picture of a walk over several floors: panels, connectors, numbered changes, the floor over time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_up_walks import recording, track
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure

from wayfuse.evaluation.errors import Scores, score
from wayfuse.evaluation.plot_walk import walk_figure
from wayfuse.evaluation.plot_walk_floors import floor_changes
from wayfuse.maps.build import build_floor
from wayfuse.maps.connectors import Connector, ConnectorKind, Landing
from wayfuse.maps.site import Polygon, Site
from wayfuse.sensors.records import Waypoint

SQUARE = Polygon(np.array([(-5, -5), (45, -5), (45, 25), (-5, 25), (-5, -5)], dtype=float))
SHAFT = np.array([(20, 9), (22, 9), (22, 11), (20, 11), (20, 9)], dtype=float)


@pytest.fixture(scope="module")
def house() -> Site:
    """Floors 0, 1, 2; stairs between 0 and 1 at (10, 10), a lift to 0 and 2 at (20, 10)."""
    floors = [build_floor(str(k), k, [SQUARE], []) for k in range(3)]
    stairs = Connector("s", ConnectorKind.STAIRS, (Landing(0, 10, 10), Landing(1, 12, 10)), (20,))
    lift = Connector("l", ConnectorKind.LIFT, (Landing(0, 20, 10), Landing(2, 20, 10)), footprint=SHAFT)
    return Site("house", tuple(floors), {}, (stairs, lift))


@pytest.fixture(scope="module")
def scores(house: Site) -> Scores:
    """Up by stairs at 20 s, (far from any connector) down at 50 s, up by lift at 75 s; the estimate is late once."""
    points = (
        Waypoint(100, 0, 10, "0"), Waypoint(118, 9, 10, "0"), Waypoint(122, 12, 11, "1"), Waypoint(149, 40, 10, "1"),
        Waypoint(151, 40, 10, "0"), Waypoint(170, 20, 10, "0"), Waypoint(180, 20, 10, "2"), Waypoint(200, 5, 10, "2"),
    )  # fmt: skip
    t = np.arange(101.0, 200.0, 2.0)
    floors = ["0" if at < 126 or 150 <= at < 176 else ("1" if at < 150 else "2") for at in t.tolist()]
    estimate = track(t.tolist(), [(20.0, 9.0)] * len(t), floors)
    return score([estimate], [recording(waypoints=points)], house)


def texts(figure: Figure, panel: int) -> list[str]:
    return [text.get_text() for text in figure.axes[panel].texts]


def test_changes_of_floor_are_told_with_the_connector_taken(scores: Scores, house: Site) -> None:
    changes = floor_changes(scores, scores.truths["a"], house)
    assert [(c.row, c.start, c.stop, c.by) for c in changes] == [
        (1, "0", "1", "stairs"),
        (3, "1", "0", ""),
        (5, "0", "2", "lift"),
    ]
    assert [c.by for c in floor_changes(scores, scores.truths["a"], None)] == ["", "", ""]


def test_floors_stand_bottom_up_at_one_scale_above_the_times(scores: Scores, house: Site) -> None:
    figure = walk_figure(scores, "a", house)
    assert [ax.get_title(loc="left") for ax in figure.axes[:3]] == ["floor 0", "floor 1", "floor 2"]
    assert len({(ax.get_xlim(), ax.get_ylim()) for ax in figure.axes[:3]}) == 1
    assert "stairs 0 to 1, change 1 to 0, lift 0 to 2" in str(figure.get_suptitle())
    times = figure.axes[3]
    assert [label.get_text() for label in times.get_yticklabels()] == ["floor 0", "floor 1", "floor 2"]
    truth = np.asarray(times.get_lines()[0].get_xydata())
    assert truth[np.searchsorted(truth[:, 0], 19.0), 1] == 0
    assert truth[np.searchsorted(truth[:, 0], 21.0), 1] == 1
    assert truth[-1, 1] == 2


def test_badges_number_where_a_floor_is_left_and_reached(scores: Scores, house: Site) -> None:
    figure = walk_figure(scores, "a", house)
    ground, first, second = (texts(figure, k) for k in range(3))
    assert {"1", "2", "3"} <= set(ground)
    assert {"stairs to 1", "from 1", "lift to 2"} <= set(ground)
    assert {"from 0", "change to 0"} <= set(first)
    assert "3" in second
    assert "from 0" in second


def test_connectors_are_drawn_only_where_they_stop(scores: Scores, house: Site) -> None:
    figure = walk_figure(scores, "a", house)
    leads = [{t for t in texts(figure, k) if t.startswith("to ")} for k in range(3)]
    assert leads == [{"to 1", "to 2"}, {"to 0"}, {"to 0"}]
    assert sum(len(ax.patches) for ax in figure.axes[:3]) == 2  # the footprint of the lift, on two floors


def test_an_escalator_has_a_symbol_too(scores: Scores, house: Site) -> None:
    escalator = Connector("e", ConnectorKind.ESCALATOR, (Landing(1, 30, 5), Landing(2, 33, 5)), direction=1)
    figure = walk_figure(scores, "a", replace(house, connectors=(*house.connectors, escalator)))
    assert "to 2" in texts(figure, 1)


def test_wrong_floors_are_crosses_where_stated_and_tinted_over_time(scores: Scores, house: Site) -> None:
    figure = walk_figure(scores, "a", house)
    crosses = [
        (k, line)
        for k in range(3)
        for line in figure.axes[k].get_lines()
        if "another floor" in str(line.get_label())
    ]
    assert [k for k, _ in crosses] == [0]  # late after the stairs: still on floor 0
    assert len(np.asarray(crosses[0][1].get_xydata())) == 3
    (tint,) = figure.axes[3].collections
    assert to_rgba("#D55E00")[:3] == tuple(tint.get_facecolor()[0][:3])
    spans = [path.get_extents() for path in tint.get_paths()]
    first = min(spans, key=lambda span: float(span.x0))
    assert (first.x0, first.x1) == pytest.approx((20.25, 27.0), abs=0.3)
    assert (
        sum(span.width for span in spans) < 7.0 + 3 * 2.3
    )  # and for one step of the estimates at each change


def test_without_a_site_the_floors_are_empty_sheets(scores: Scores) -> None:
    figure = walk_figure(scores, "a")
    assert [ax.get_title(loc="left") for ax in figure.axes[:3]] == ["floor 0", "floor 1", "floor 2"]
    assert "change to 1" in texts(figure, 0)
