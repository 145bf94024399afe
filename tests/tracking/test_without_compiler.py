"""The whole tracker as the plain NumPy and Python that its kernels also are: the same estimates, only slower."""

from __future__ import annotations

import csv
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest


def numbers(path: Path) -> tuple[list[str], list[list[float]]]:
    """Columns of EST.csv that are no numbers, joined by row, and those that are."""
    rows = list(csv.reader(path.read_text(encoding="utf-8").splitlines()))[1:]
    named, plain = [], []
    for row in rows:
        is_number = [_is_number(cell) for cell in row]
        named.append("|".join(cell for cell, number in zip(row, is_number, strict=True) if not number))
        plain.append([float(cell) for cell, number in zip(row, is_number, strict=True) if number])
    return named, plain


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


@pytest.mark.slow
@pytest.mark.parametrize("method", ["fused", "wknn"])
def test_without_the_compiler_the_estimates_are_the_same(
    world: Any, tmp_path: Path, run_cli: Callable[..., Any], method: str
) -> None:
    walk = sorted((world.folder / "walks").rglob("*.txt"))[0]
    words = [
        "track",
        world.folder / "SITE",
        walk,
        "--radio-map",
        world.folder / "map.npz",
        "--method",
        method,
    ]
    words += ["--particles", "60", "--jobs", "1", "--out"]
    assert run_cli(*words, tmp_path / "compiled.csv").code == 0
    done = subprocess.run(
        [sys.executable, "-m", "wayfuse", *map(str, words), str(tmp_path / "plain.csv")],
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    (named, got), (want_named, want) = numbers(tmp_path / "plain.csv"), numbers(tmp_path / "compiled.csv")
    assert len(want) > 20
    assert named == want_named
    for row, expected in zip(got, want, strict=True):
        assert row == pytest.approx(expected, abs=1e-3)
