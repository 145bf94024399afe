"""Shared fixtures: where the real recordings are, and a loud skip where they are not."""

from __future__ import annotations

import os
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def data_root() -> Path:
    """Folder of the real recordings ($WAYFUSE_DATA, else ~/.cache/wayfuse-data)."""
    root = Path(os.environ.get("WAYFUSE_DATA") or Path.home() / ".cache" / "wayfuse-data")
    if not root.is_dir():
        pytest.skip(f"REAL DATA ABSENT: no folder {root}; fetch with `wayfuse datasets fetch NAME`")
    return root


@pytest.fixture(scope="session")
def ms_indoor(data_root: Path) -> Path:
    """Folder of the ms-indoor site1 (B1, F1, ...)."""
    site = data_root / "ms-indoor" / "site1"
    if not site.is_dir():
        pytest.skip(f"REAL DATA ABSENT: no folder {site}; fetch with `wayfuse datasets fetch ms-indoor`")
    return site
