"""A small building on disk, for the tests of maps."""

from __future__ import annotations

from pathlib import Path

import pytest
from made_up_plans import HEIGHT, WIDTH, box, outline, unit, write_floor


@pytest.fixture
def plans(tmp_path) -> Path:
    """Folder "mall" with B1 (one shop) and F1 (a shop with a court, and a void)."""
    root = tmp_path / "mall"
    whole = outline(box(0, 0, WIDTH, HEIGHT))
    write_floor(root / "B1", [outline(box(0, 0, WIDTH, HEIGHT), "B1"), unit("b", box(5, 5, 15, 25))])
    court = unit("s", box(5, 5, 25, 25), box(10, 10, 20, 20)[::-1], name="Books &amp; more")
    void = unit("v", box(30, 5, 36, 25), category=["5d3577c8b7271665f903b6e3", "5d357b7f0c02a37d6cc84c8a"])
    write_floor(root / "F1", [whole, court, void])
    return root
