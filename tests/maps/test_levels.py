"""Floor names."""

from __future__ import annotations

import pytest

from wayfuse.maps.levels import parse_level, sort_key

LEVELS = {
    "B1": -1, "B12": -12, "b2": -2, "1B": -1, "LG2": -2, "LG": -1,
    "-1": -1, "BF": -1, "B": -1, "basement 1": -1,
    "G": 0, "UG": 0, "M": 0, "GF": 0, "0": 0,
    "F1": 1, "F10": 10, "f8": 8, "1F": 1, "03F": 3, "L1": 1, "Level 2": 2, "2": 2, "F": 1,
    "Roof": None, "": None, "Fx": None, "B0": None, "F1a": None,
}  # fmt: skip


@pytest.mark.parametrize("name", LEVELS)
def test_level_of_a_name(name):
    assert parse_level(name) == LEVELS[name]


def test_floors_sort_bottom_up_and_unknown_names_come_last():
    names = ["Roof", "F2", "F10", "B1", "G", "LG1", "F1", "B2", "M", "Attic"]
    assert sorted(names, key=sort_key) == ["B2", "B1", "LG1", "G", "M", "F1", "F2", "F10", "Attic", "Roof"]
