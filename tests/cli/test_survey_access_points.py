"""``wayfuse survey access-points``: from a radio map to a file of places."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from wayfuse.radio.ap_estimation import estimate_places
from wayfuse.radio.ap_places import read_ap_places

Run = Callable[..., Any]


def test_the_file_holds_what_the_library_estimates(world: Any, run_cli: Run, tmp_path: Path) -> None:
    out = tmp_path / "aps.csv"
    said = run_cli("survey", "access-points", world.folder / "map.npz", "--out", out)
    assert said.code == 0, said.err
    places = read_ap_places(out, world.survey.floors)
    expected = estimate_places(world.survey)
    assert places.is_estimated
    np.testing.assert_array_equal(places.bssid, expected.bssid)
    np.testing.assert_allclose(places.xy, expected.xy, atol=5.1e-3)
    assert f"places of {len(expected)} of {len(world.survey.bssid)} access points estimated" in said.out


def test_uncertain_places_are_left_out_on_request(world: Any, run_cli: Run, tmp_path: Path) -> None:
    out = tmp_path / "aps.csv"
    every = json.loads(
        run_cli("survey", "access-points", world.folder / "map.npz", "--out", out, "--json").out
    )
    limit = every["median_sigma_m"]
    said = run_cli(
        "survey", "access-points", world.folder / "map.npz", "--out", out, "--json", "--most-sigma", limit
    )
    fewer = json.loads(said.out)
    assert 0 < fewer["placed"] < every["placed"] == sum(every["placed_by_floor"].values())
    places = read_ap_places(out, world.survey.floors)
    assert len(places) == fewer["placed"]
    assert places.sigma is not None
    assert places.sigma.max() <= limit


def test_wrong_use_is_one_line_and_status_2(world: Any, run_cli: Run, tmp_path: Path) -> None:
    for arguments, message in (
        ((tmp_path / "gone.npz", "--out", tmp_path / "a.csv"), "gone.npz"),
        ((world.folder / "map.npz", "--out", tmp_path / "no" / "a.csv"), "create it first"),
        ((world.folder / "map.npz", "--out", tmp_path / "a.csv", "--min-places", 100_000), "larger survey"),
    ):
        said = run_cli("survey", "access-points", *arguments)
        assert said.code == 2
        assert message in said.err
        assert "Traceback" not in said.err
        assert not (tmp_path / "a.csv").exists()
