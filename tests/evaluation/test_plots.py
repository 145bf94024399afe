from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from made_up_walks import House, noisy_scores, recording, track
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from wayfuse.core.errors import UsageError
from wayfuse.evaluation.errors import Scores, score
from wayfuse.evaluation.plot_look import style
from wayfuse.evaluation.plot_walk import walk_figure
from wayfuse.evaluation.plots import (
    calibration_figure,
    cdf_figure,
    choose_walks,
    error_by_time_figure,
    write_plots,
)
from wayfuse.maps.build import build_floor
from wayfuse.maps.site import Polygon, Site, Unit
from wayfuse.sensors.records import Waypoint


def square(x: float, y: float, side: float) -> Polygon:
    return Polygon(
        np.array([(x, y), (x + side, y), (x + side, y + side), (x, y + side), (x, y)], dtype=float)
    )


@pytest.fixture(scope="module")
def house() -> Site:
    shop = Unit("1", "shop $5", "shop", square(10, 5, 8))
    floors = [
        build_floor(name, level, [square(-20, -20, 80)], [shop]) for name, level in (("F1", 1), ("F2", 2))
    ]
    return Site("house", tuple(floors))


@pytest.fixture(scope="module")
def scores() -> Scores:
    return noisy_scores(6)


def test_all_pictures_are_written(tmp_path: Path, scores: Scores, house: Site) -> None:
    paths = write_plots(scores, tmp_path / "new" / "plots", ["w0", "w3"], house)
    names = [str(p.relative_to(tmp_path / "new" / "plots")) for p in paths]
    assert names == ["cdf.png", "error_by_time.png", "coverage.png", "walks/w0.png", "walks/w3.png"]
    for path in paths:
        assert path.read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
        assert path.stat().st_size > 5000


def pixels(figure: Figure) -> np.ndarray:
    canvas = figure.canvas
    assert isinstance(canvas, FigureCanvasAgg)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())


def test_pictures_are_the_same_every_time(scores: Scores) -> None:
    for draw in (cdf_figure, lambda s: walk_figure(s, "w1")):
        np.testing.assert_array_equal(pixels(draw(scores)), pixels(draw(scores)))


def test_the_distribution_is_that_of_the_errors(scores: Scores) -> None:
    ax = cdf_figure(scores).axes[0]
    lines = {str(line.get_label()).split(":")[0]: line for line in ax.get_lines()}
    for method in scores.methods:
        error = method.points["1hz"].used().error
        x, y = (np.asarray(v, dtype=float) for v in lines[method.name].get_data())
        for level in (10.0, 50.0, 90.0):
            at = x[np.searchsorted(y, level)]
            assert abs(100 * np.mean(error <= at) - level) < 100 / len(error) + 1e-9
    assert "(m)" in ax.get_xlabel()
    assert "(%)" in ax.get_ylabel()
    legend = ax.get_legend()
    assert legend is not None
    assert all("mean" in t.get_text() and "median" in t.get_text() for t in legend.get_texts())


def test_axes_have_units(scores: Scores) -> None:
    figures = [error_by_time_figure(scores), calibration_figure(scores)]
    labels = [ax.get_xlabel() + ax.get_ylabel() for figure in figures if figure for ax in figure.axes]
    assert len(labels) == 4
    assert all("(s)" in text or "(m)" in text or "(%)" in text for text in labels)


def test_without_radii_there_is_no_calibration_picture(tmp_path: Path) -> None:
    bare = score([track([101.0], [(0, 0)])], [recording()])
    assert calibration_figure(bare) is None
    assert [p.name for p in write_plots(bare, tmp_path)] == ["cdf.png", "error_by_time.png"]


def test_a_method_without_any_used_point_is_drawn_as_nothing(tmp_path: Path) -> None:
    late = score([track([120.0], [(0, 0)], r68=[1.0], r95=[2.0])], [recording()])
    assert [p.name for p in write_plots(late, tmp_path, ["a"])] == ["cdf.png", "error_by_time.png", "a.png"]


def test_colours_differ_among_the_first_seven() -> None:
    assert len({style(k)["color"] for k in range(7)}) == 7
    assert len({(style(k)["color"], str(style(k)["linestyle"])) for k in range(14)}) == 14


def test_many_walks_are_chosen_from_and_that_is_said() -> None:
    tracks, walks = [], []
    for i in range(30):
        walks.append(recording(f"w{i:02}"))
        t = np.arange(101.0, 111.0)
        tracks.append(track(t, np.stack([t - 100.0, np.full_like(t, float(i))], axis=1), walk=f"w{i:02}"))
    found = score(tracks, walks)
    chosen, note = choose_walks(found, 9)
    assert chosen[:3] == ["w00", "w01", "w02"]
    assert chosen[-3:] == ["w27", "w28", "w29"]
    assert len(chosen) == 9
    assert "9 of 30 walks" in note
    everything, silence = choose_walks(found, 30)
    assert (len(everything), silence) == (30, "")
    assert choose_walks(found, 0)[0] == []
    assert len(choose_walks(found, 1)[0]) == 1


def test_a_walk_shows_truth_estimates_and_marks(scores: Scores, house: Site) -> None:
    figure = walk_figure(scores, "w0", house)
    (ax,) = figure.axes
    labels = [str(line.get_label()) for line in ax.get_lines()]
    assert "truth, waypoints" in labels
    good, bad = (next(s for s in labels if s.startswith(f"{name}: mean")) for name in ("good", "bad"))
    assert "median" in good
    assert "floor 100 %" in bad
    texts = {t.get_text() for t in ax.texts}
    assert {"start", "end"} <= texts
    assert any(t.endswith(" m") for t in texts)
    assert "good: 95 % ellipses as stated" in labels
    ellipse = ax.patches[0]
    assert ellipse.get_width() == pytest.approx(2 * 2.4477, rel=1e-3)  # type: ignore[attr-defined]


def test_a_walk_over_two_floors_has_two_panels_and_marks_wrong_floors(house: Site) -> None:
    points = (Waypoint(100, 0, 0, "F1"), Waypoint(110, 10, 0, "F1"), Waypoint(130, 20, 0, "F2"))
    estimate = track([101, 112, 125], [(1, 1), (11, 0), (18, 0)], ["F1", "F2", "F2"])
    figure = walk_figure(score([estimate], [recording(waypoints=points)], house), "a", house)
    titles = [ax.get_title(loc="left").splitlines()[-1] for ax in figure.axes]
    assert titles[:2] == ["floor F1", "floor F2"]
    assert titles[2].startswith("Floor over time")
    wrong = [
        line for ax in figure.axes for line in ax.get_lines() if "another floor" in str(line.get_label())
    ]
    assert [np.asarray(line.get_xydata()).tolist() for line in wrong] == [[[11.0, 0.0]]]


def test_floors_are_drawn_in_their_own_frames() -> None:
    shifted = House(offsets=((0, 0), (0, 0), (100.0, 0.0)))
    points = (Waypoint(100, 3, 4, "F2"), Waypoint(110, 13, 4, "F2"))
    found = score([track([101], [(5, 5)], "F2")], [recording(waypoints=points)], shifted)
    (ax,) = walk_figure(found, "a").axes
    line = next(s for s in ax.get_lines() if s.get_label() == "truth, waypoints")
    assert np.asarray(line.get_xydata()).tolist() == [[3.0, 4.0], [13.0, 4.0]]
    low, high = ax.get_xlim()
    assert low < 3.0
    assert high < 60.0


def test_names_of_walks_make_safe_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        "wayfuse.evaluation.plot_site.save_figure", lambda _, path: path
    )  # names are the matter
    names = ["../../x", "a b$", "a_b_", "A_B_", "a_b_-2"]
    walks = [recording(name) for name in names]
    found = score([track([101.0], [(0, 0)], walk=name) for name in names], walks)
    paths = write_plots(found, tmp_path, found.walks)[2:]
    assert all(p.parent == tmp_path / "walks" for p in paths)
    assert len({p.name.casefold() for p in paths}) == 5


def test_names_of_methods_are_shown_as_they_are() -> None:
    (ax,) = cdf_figure(noisy_scores(2, {"_a": 1.0, "$b_{c": 2.0})).axes
    legend = ax.get_legend()
    assert legend is not None
    assert [t.get_text().split(":")[0].strip() for t in legend.get_texts()] == ["_a", "$b_{c"]
    assert not any(t.get_parse_math() for t in legend.get_texts())


def test_a_folder_that_cannot_be_made_is_an_error_of_use(tmp_path: Path, scores: Scores) -> None:
    blocked = tmp_path / "file"
    blocked.write_text("")
    with pytest.raises(UsageError, match="cannot write pictures"):
        write_plots(scores, blocked)
