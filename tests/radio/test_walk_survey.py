"""A survey from walks: where fingerprints lie, what they hold, and its file."""

from __future__ import annotations

import json
import zipfile
from pathlib import Path

import numpy as np
import pytest

from wayfuse.core.errors import RadioMapError
from wayfuse.radio.archive import write_archive
from wayfuse.radio.survey_file import save_survey
from wayfuse.radio.walk_survey import SurveyParameters, SurveyWalk, WalkRadioMap, load, survey_from_walks
from wayfuse.sensors.records import WifiScan


def scans(
    t: list[float], rssi: float = -50.0, frequency: int = 2412, offset: int = 0
) -> tuple[WifiScan, ...]:
    ids = np.uint64([7, 5, 9, 11]) + np.uint64(offset)
    level = np.float32([rssi, rssi - 10, rssi - 20, rssi - 30])
    return tuple(
        WifiScan(s, ids, level + np.float32(s), np.full(4, frequency, np.int32), np.full(4, s)) for s in t
    )


def walk(name: str = "a", floor: tuple[int, int] = (0, 0), **more: object) -> SurveyWalk:
    t, xy = np.array([0.0, 10.0]), np.array([[0.0, 0.0], [10.0, 5.0]])
    return SurveyWalk(name, t, xy, np.array(floor, np.int32), scans([0.5, 3.0, 5.5, 8.0], **more))  # type: ignore[arg-type]


def test_fingerprints_lie_every_second_on_the_line() -> None:
    survey = survey_from_walks([walk()], ("F1", "F2"))
    assert len(survey) == 11
    np.testing.assert_allclose(survey.xy, np.outer(np.arange(11.0), [1.0, 0.5]))
    assert survey.bssid.tolist() == [5, 7, 9, 11]
    assert survey.walks == ("a",)
    assert set(survey.floor.tolist()) == {0}
    assert set(survey.frequency.tolist()) == {2412}


def test_a_fingerprint_is_the_weighted_mean_of_what_was_heard_around_it() -> None:
    p = SurveyParameters(before=4.0, after=2.0, decay=1.5)
    survey = survey_from_walks([walk()], ("F1",), p)
    heard = np.array([0.5, 3.0, 5.5, 8.0])
    for t in range(11):
        use = heard[(heard >= t - 4.0) & (heard < t + 2.0)]
        w = np.exp(-np.abs(use - t) / 1.5)
        want = np.sum(w * (-60.0 + use)) / np.sum(w)  # access point 5
        assert survey.dense()[t, 0] == pytest.approx(want, abs=1e-4)


def test_between_floors_nothing_is_taken() -> None:
    t, xy = np.array([0.0, 4.0, 8.0, 12.0]), np.zeros((4, 2))
    one = SurveyWalk("s", t, xy, np.int32([0, 0, 1, 1]), scans([1.0, 3.0, 5.0, 7.0, 9.0, 11.0]))
    survey = survey_from_walks([one], ("F1", "F2"))
    assert survey.floor.tolist() == [0] * 4 + [1] * 5


def test_walks_that_cannot_survey_are_passed_over() -> None:
    lone = walk("lone")._replace(t=np.array([0.0]))
    deaf = walk("deaf")._replace(scans=())
    survey = survey_from_walks([lone, walk("b", frequency=5180), deaf, walk("c", frequency=5180)], ("F1",))
    assert survey.walks == ("b", "c")
    assert set(survey.frequency.tolist()) == {5180}
    assert np.bincount(survey.walk).tolist() == [11, 11]
    for nothing in ([], [lone], [deaf]):
        with pytest.raises(RadioMapError, match="no recording has both Wi-Fi scans and two waypoints"):
            survey_from_walks(nothing, ("F1",))


def test_places_with_few_readings_are_left_out() -> None:
    sparse = walk()._replace(scans=scans([0.5]))
    survey = survey_from_walks([sparse], ("F1",))
    assert len(survey) == 5  # 0.5 s is heard from t - 4 on: at 0 to 4 s
    with pytest.raises(RadioMapError, match="no fingerprint"):
        survey_from_walks([sparse], ("F1",), SurveyParameters(min_readings=5))


def test_odd_channels_do_no_harm() -> None:
    odd = walk("odd", frequency=-1)
    survey = survey_from_walks([odd, walk("b"), walk("c")], ("F1",))
    assert set(survey.frequency.tolist()) == {2412}
    assert set(survey_from_walks([odd], ("F1",)).frequency.tolist()) <= {-1, 0}


def test_a_radio_map_comes_back_from_its_file(tmp_path: Path) -> None:
    made = WalkRadioMap(survey_from_walks([walk()], ("F1",)), SurveyParameters(decay=2.0), "hall")
    made.save(tmp_path / "map.npz")
    back = load(tmp_path / "map.npz")
    assert (back.site, back.parameters) == ("hall", made.parameters)
    for name in ("bssid", "frequency", "xy", "floor", "walk", "indptr", "indices", "rssi"):
        np.testing.assert_array_equal(getattr(back.survey, name), getattr(made.survey, name))
    assert (back.survey.floors, back.survey.walks) == (("F1",), ("a",))
    made.save(tmp_path / "again.npz")
    assert (tmp_path / "again.npz").read_bytes() == (tmp_path / "map.npz").read_bytes()


def test_files_that_are_none_are_refused(tmp_path: Path) -> None:
    made = WalkRadioMap(survey_from_walks([walk()], ("F1",)), SurveyParameters(), "hall")
    good = tmp_path / "map.npz"
    made.save(good)
    whole = good.read_bytes()
    bad = tmp_path / "bad.npz"
    for content in (b"", b"no zip", whole[: len(whole) // 2], whole[:-3]):
        bad.write_bytes(content)
        with pytest.raises(RadioMapError, match=r"bad\.npz"):
            load(bad)
    for i in range(60, len(whole), max(1, len(whole) // 60)):
        bad.write_bytes(whole[:i] + bytes([whole[i] ^ 0xFF]) + whole[i + 1 :])
        try:
            back = load(bad)
        except RadioMapError:
            continue
        np.testing.assert_array_equal(back.survey.rssi, made.survey.rssi)  # a byte that means nothing
    with pytest.raises(RadioMapError, match="no such file"):
        load(tmp_path / "absent.npz")
    save_survey(made.survey, bad)
    with pytest.raises(RadioMapError, match="holds 'survey', not 'walk-radio-map'"):
        load(bad)


def test_headers_that_lack_or_hold_too_much_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "map.npz"
    WalkRadioMap(survey_from_walks([walk()], ("F1",)), SurveyParameters(), "hall").save(path)
    with zipfile.ZipFile(path) as archive:
        header = json.loads(archive.read("header.json"))["header"]
        arrays = {n[:-4]: np.load(archive.open(n)) for n in archive.namelist() if n.endswith(".npy")}
    for change in ({"parameters": {"unknown": 1}}, {"parameters": 3}, {"survey": 7}, {"survey": {}}):
        write_archive(path, "walk-radio-map", 1, {**header, **change}, arrays)
        with pytest.raises(RadioMapError, match=r"map\.npz"):
            load(path)
    for missing in ("site", "parameters", "survey"):
        write_archive(path, "walk-radio-map", 1, {k: v for k, v in header.items() if k != missing}, arrays)
        with pytest.raises(RadioMapError, match=missing):
            load(path)
    write_archive(path, "walk-radio-map", 2, header, arrays)
    with pytest.raises(RadioMapError, match="newer"):
        load(path)
