from __future__ import annotations

import json
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from click.testing import CliRunner, Result

from wayfuse.cli.main import cli, main
from wayfuse.core.errors import DataMissingError, FormatError, UsageError
from wayfuse.evaluation.estimates_file import Sidecar, WalkEstimates, write_estimates

START = 1_574_661_471_000  # ms


def recording(folder: Path, name: str, *, waypoints: bool = True, floor: str = "F1") -> Path:
    """Write a walk of 10 m in 10 s along x in the format of ms-indoor, first scan after 1.5 s."""
    lines = [f"#\tstartTime:{START}", f"#\tSiteID:s\tSiteName:site\tFloorId:f\tFloorName:{floor}"]
    if waypoints:
        lines.append(f"{START}\tTYPE_WAYPOINT\t0.0\t0.0")
    for ms in (1500, 3500):
        seen = START + ms - 100
        lines.append(f"{START + ms}\tTYPE_WIFI\tnet\t0a:74:9c:2e:af:f7\t-60\t5765\t{seen}")
    if waypoints:
        lines.append(f"{START + 10_000}\tTYPE_WAYPOINT\t10.0\t0.0")
    path = folder / f"{name}.txt"
    path.write_text("\n".join(lines) + "\n")
    return path


def track(walk: str, method: str, off: float, floor: str = "F1") -> WalkEstimates:
    """Estimates once a second from the first scan on, ``off`` metres beside the truth."""
    t = np.concatenate([[1.5], np.arange(2.0, 11.0)])
    xy = np.stack([t, np.full_like(t, off)], axis=1)
    r = {"r68": np.full_like(t, 1.0), "r95": np.full_like(t, 2.5)}
    floors = np.full(len(t), floor)
    return WalkEstimates(walk, method, START / 1000 + t, xy, floors, np.full_like(xy, np.nan), r)


@pytest.fixture
def walks(tmp_path: Path) -> Path:
    folder = tmp_path / "walks"
    folder.mkdir()
    for name in ("a", "b", "c"):
        recording(folder, name)
    return folder


@pytest.fixture
def table(tmp_path: Path) -> Path:
    path = tmp_path / "est.csv"
    tracks = [track(w, m, off) for w in ("a", "b", "c") for m, off in (("fused", 1.0), ("nnss", 4.0))]
    write_estimates(path, tracks)
    return path


def run(*arguments: object) -> Result:
    return CliRunner().invoke(cli, ["evaluate", *map(str, arguments)])


def report(*arguments: object) -> dict[str, object]:
    result = run(*arguments, "--json", "--replicates", 100)
    assert result.exception is None, result.output
    found: dict[str, object] = json.loads(result.stdout)
    return found


def test_a_folder_of_recordings(table: Path, walks: Path) -> None:
    result = run(table, walks)
    assert result.exit_code == 0, result.output
    assert "fused against nnss: mean 75 % [75, 75] below" in result.stdout
    row = next(line for line in result.stdout.splitlines() if line.startswith("fused"))
    assert row.split()[:6] == ["fused", "3/3", "27", "100.0", "%", "1.00"]


def test_json_is_strict_and_holds_the_same(table: Path, walks: Path, tmp_path: Path) -> None:
    out = tmp_path / "report.json"
    found = report(table, walks, "--out", out)
    methods = found["methods"]
    assert isinstance(methods, dict)
    assert methods["nnss"]["1hz"]["mean"] == pytest.approx(4.0)
    assert methods["fused"]["coverage"]["overall"]["within95"]["value"] == 1.0
    assert json.loads(out.read_text()) == found
    assert "NaN" not in out.read_text()


def test_files_and_lists_of_recordings(table: Path, walks: Path, tmp_path: Path) -> None:
    listed = tmp_path / "list"
    listed.write_text(f"# two of them\n{walks / 'a.txt'}\n\n{walks / 'b.txt'}\n")
    found = report(table, f"@{listed}")
    assert found["walks"] == ["a", "b"]
    assert found["unscored"] == [{"walk": "c", "reason": "estimates without a recording"}]
    assert report(table, walks / "a.txt", walks / "b.txt")["walks"] == ["a", "b"]


def test_several_files_of_estimates(table: Path, walks: Path, tmp_path: Path) -> None:
    other = tmp_path / "plain.csv"
    lines = ["walk,t_ms,x,y,floor,lat,lon", *(f"{w},{START + 1500},5,0,F1,," for w in "ab")]
    other.write_bytes("\r\n".join(lines).encode())
    found = report(table, walks, other)
    methods = found["methods"]
    assert isinstance(methods, dict)
    assert list(methods) == ["fused", "nnss", "plain"]
    assert methods["plain"]["missing_walks"] == ["c"]


def test_one_method_in_two_files_is_joined_or_told_apart(tmp_path: Path, walks: Path) -> None:
    first, second, third = (tmp_path / f"{name}.csv" for name in ("one", "two", "three"))
    write_estimates(first, [track("a", "m", 1.0), track("b", "m", 1.0)])
    write_estimates(second, [track("c", "m", 3.0)])
    write_estimates(third, [track("b", "m", 2.0)])
    joined = report(first, second, walks)["methods"]
    assert isinstance(joined, dict)
    assert {name: m["n_walks"] for name, m in joined.items()} == {"m": 3}
    apart = report(first, third, walks)["methods"]
    assert isinstance(apart, dict)
    assert {name: m["n_walks"] for name, m in apart.items()} == {"m (one)": 2, "m (three)": 1}


def test_recordings_without_estimates_are_named_and_not_read(table: Path, walks: Path) -> None:
    (walks / "z.txt").write_text(f"#\tstartTime:{START}\nrubbish\n")
    found = report(table, walks)
    assert found["unscored"] == [{"walk": "z", "reason": "recording without estimates"}]


def test_pictures(table: Path, walks: Path, tmp_path: Path) -> None:
    found = report(table, walks, "--plots", tmp_path / "plots", "--max-pictures", 2)
    paths = found["plots"]
    assert isinstance(paths, list)
    assert [Path(p).name for p in paths[:3]] == ["cdf.png", "error_by_time.png", "coverage.png"]
    assert len(paths) == 5
    assert all(Path(p).is_file() for p in paths)
    assert any("2 of 3 walks" in str(note) for note in found["notes"])  # type: ignore[attr-defined]


def test_bad_lines_of_recordings_are_told_at_the_end(table: Path, walks: Path) -> None:
    with (walks / "a.txt").open("a") as stream:
        stream.write(f"{START + 4000}\tTYPE_WIFI\tnet\n")
    result = run(table, walks)
    assert result.exit_code == 0
    assert "a.txt" in result.stderr
    assert "a.txt" not in result.stdout


def test_a_lag_is_said(walks: Path, tmp_path: Path) -> None:
    path = tmp_path / "est.csv"
    write_estimates(path, [track("a", "lagged", 1.0)], Sidecar(site="", lag=3.0))
    assert any("lag 3 s" in str(note) for note in report(path, walks)["notes"])  # type: ignore[attr-defined]


def test_a_site_that_a_sidecar_names_and_is_gone_is_said(walks: Path, tmp_path: Path) -> None:
    path = tmp_path / "est.csv"
    write_estimates(path, [track("a", "m", 1.0)], Sidecar(site="gone", radio_map="gone.map"))
    notes = report(path, walks)["notes"]
    assert notes == [
        "The site gone is not there; give --site.",
        "The radio-map gone.map is not there; give --radio-map.",
    ]


def test_the_site_of_the_sidecar_orders_the_floors(tmp_path: Path, walks: Path) -> None:
    from wayfuse.maps.build import build_floor
    from wayfuse.maps.site import Polygon, Site

    ring = np.array([(0, 0), (50, 0), (50, 50), (0, 50), (0, 0)], dtype=float)
    floors = [build_floor(f"F{k}", k, [Polygon(ring)]) for k in (1, 2, 3)]
    Site("house", tuple(floors)).save(tmp_path / "house")
    path = tmp_path / "est.csv"
    write_estimates(path, [track("a", "m", 1.0, "F3")], Sidecar(site="house"))  # beside the file
    methods = report(path, walks)["methods"]
    assert isinstance(methods, dict)
    assert methods["m"]["1hz"]["combined_mean"] == pytest.approx(31.0)
    write_estimates(path, [track("a", "m", 1.0, "roof")])
    result = run(path, walks, "--site", tmp_path / "house")
    assert isinstance(result.exception, UsageError)
    assert "no floor 'roof'" in str(result.exception)


def test_the_radio_map_splits_by_distance(
    table: Path, walks: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from wayfuse.radio.survey import Survey

    survey = Survey.from_dense(np.full((1, 1), -50.0), np.array([(0.0, 0.0)]), np.array([0]), ("F1",))
    asked: list[Path] = []

    def load(path: Path) -> SimpleNamespace:
        asked.append(path)
        return SimpleNamespace(survey=survey)

    monkeypatch.setattr("wayfuse.radio.walk_survey.load", load, raising=False)
    methods = report(table, walks, "--radio-map", tmp_path / "map")["methods"]
    assert asked == [tmp_path / "map"]
    assert isinstance(methods, dict)
    split = methods["fused"]["by_survey_distance"]
    assert {label: s["n"] for label, s in split.items()} == {"<= 2 m": 3, "2-5 m": 9, "> 5 m": 15}


@pytest.mark.parametrize(
    ("line", "fault"),
    [
        ("a,{t},nan,0,F1,,", "x is not a finite"),
        ("a,{t},0", "3 fields of 7"),
        ("a,1000,0,0,F1,,", "does not ascend"),
    ],
)
def test_a_damaged_line_stops_with_its_place(walks: Path, tmp_path: Path, line: str, fault: str) -> None:
    path = tmp_path / "est.csv"
    good = f"a,{START + 1500},0,0,F1,,"
    path.write_text(f"walk,t_ms,x,y,floor,lat,lon\n{good}\n{line.format(t=START + 2500)}\n")
    result = run(path, walks)
    assert isinstance(result.exception, FormatError)
    assert fault in str(result.exception)
    assert f"{path}:3" in str(result.exception)


def test_what_cannot_work_is_said_in_one_line(
    table: Path,
    walks: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(sys, "argv", ["wayfuse", "evaluate", str(walks)])
    with pytest.raises(SystemExit) as stopped:
        main()
    assert stopped.value.code == 2
    told = capsys.readouterr().err
    assert told.count("\n") == 1
    assert "no file of estimates" in told

    assert "no recordings" in str(run(table).exception)
    assert isinstance(run(table, tmp_path / "absent").exception, DataMissingError)
    wrong = tmp_path / "wrong.csv"
    wrong.write_text("t,x,y\n1,2,3\n")
    assert isinstance(run(wrong, walks).exception, FormatError)
    assert "no such file" in str(run(tmp_path / "absent.csv", walks).exception)
    assert "no method 'x'" in str(run(table, walks, "--baseline", "x").exception)
    assert "cannot write" in str(run(table, walks, "--out", tmp_path / "absent" / "r.json").exception)


def test_nothing_to_score_is_an_error(tmp_path: Path, table: Path) -> None:
    blind = tmp_path / "blind"
    blind.mkdir()
    recording(blind, "a", waypoints=False)
    result = run(table, blind)
    assert isinstance(result.exception, UsageError)
    assert "a: recording without waypoints" in str(result.exception)


@pytest.mark.real_data
def test_the_truth_itself_scores_zero_on_real_walks(ms_indoor: Path, tmp_path: Path) -> None:
    from wayfuse.evaluation.truth import truth_of
    from wayfuse.formats.reading import read

    paths = sorted((ms_indoor / "F1").rglob("*.txt"))[:4]
    tracks = []
    for path in paths:
        walk = read(path)
        truth = truth_of(walk)
        assert truth is not None
        t = np.arange(truth.t[0], truth.t[-1], 0.05)
        xy, floor = truth.at(t)
        tracks.append(WalkEstimates(walk.name, "truth", t, xy, floor, np.full_like(xy, np.nan)))
    table = tmp_path / "est.csv"
    write_estimates(table, tracks)
    methods = report(table, *paths)["methods"]
    assert isinstance(methods, dict)
    figures = methods["truth"]["1hz"]
    assert figures["n"] > 50
    assert figures["p95"] < 0.15  # m: at most 50 ms old at a walker's pace
    assert figures["floor_accuracy"] == 1.0
    assert methods["truth"]["stability"]["n_jumps"] == 0
