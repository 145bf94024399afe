"""The benchmark command writes its page and its figures, and says loudly which peers are not there."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PROGRAM = """
import sys
from importlib import metadata, util
version, find = metadata.version, util.find_spec
absent = ("particles", "pfilter", "stonesoup", "filterpy", "scikit-learn", "sklearn")

def missing(name):
    if name in absent:
        raise metadata.PackageNotFoundError(name)
    return version(name)

metadata.version = missing
util.find_spec = lambda name, package=None: None if name in absent else find(name, package)
from benchmarks.__main__ import main
sys.exit(main())
"""


@pytest.mark.slow
def test_the_page_names_the_peers_that_are_not_installed(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, "--quick", "--only", "limit,filter_step", "--out", str(tmp_path)],
        capture_output=True, text=True, check=False, cwd=ROOT,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-3000:]
    page = (tmp_path / "benchmarks.md").read_text(encoding="utf-8")
    assert (
        "**Not installed, so not compared: particles, pfilter, stonesoup, filterpy, scikit-learn.**" in page
    )
    assert "filterpy |" not in page
    assert "load " in page
    figures = json.loads((tmp_path / "benchmarks.json").read_text(encoding="utf-8"))
    assert figures["versions"]["particles"] is None
    assert {g["verdict"] for g in figures["goals"]} <= {"reached", "missed", "not measured"}
    assert {t["title"] for t in figures["tables"]} >= {"What one core can do", "Parts of an update"}
