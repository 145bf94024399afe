"""The tracker without its compiler: the same estimates, but for rounding."""

from __future__ import annotations

import csv
import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from wayfuse.core.jit import _without
from wayfuse.formats._kernels import mark_repeats

WITHOUT_NUMBA = "import sys; sys.modules['numba'] = None; from wayfuse.cli.main import main; main()"
COMPILED = "from wayfuse.cli.main import main; main()"


def estimates(world: Any, out: Path, program: str, **environment: str) -> list[dict[str, str]]:
    walk = sorted((world.folder / "walks").rglob("*.txt"))[0]
    done = subprocess.run(
        [sys.executable, "-c", program, "track", str(world.folder / "SITE"), str(walk),
         "--radio-map", str(world.folder / "map.npz"), "--particles", "60", "--out", str(out)],
        capture_output=True, text=True, check=False, env={**os.environ, **environment},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-3000:]
    with out.open(newline="") as stream:
        return list(csv.DictReader(stream))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("program", "environment"), [(WITHOUT_NUMBA, {}), (COMPILED, {"NUMBA_DISABLE_JIT": "1"})]
)
def test_a_walk_is_tracked_whole_without_the_compiler(
    world: Any, tmp_path: Path, program: str, environment: dict[str, str]
) -> None:
    want = estimates(world, tmp_path / "compiled.csv", COMPILED)
    got = estimates(world, tmp_path / "plain.csv", program, **environment)
    assert len(want) > 20
    assert [row["t_ms"] for row in got] == [row["t_ms"] for row in want]
    assert [row["floor"] for row in got] == [row["floor"] for row in want]
    far = [np.hypot(*(float(a[k]) - float(b[k]) for k in ("x", "y"))) for a, b in zip(got, want, strict=True)]
    # rounding may turn one particle's ancestor: the estimate of sixty then moves by a sixtieth of the cloud
    assert max(far) < 0.5
    assert np.median(far) < 0.01


AFTERWARDS = """
import sys
from wayfuse.core.jit import COMPILED, kernel, load_compiler
load_compiler()
assert COMPILED == ("numba.np.arraymath" in sys.modules)
assert "scipy" not in sys.modules
import scipy.linalg.cython_blas
load_compiler()  # leaves alone what is loaded
assert sys.modules["scipy.linalg"] is scipy.linalg
import numpy as np
from wayfuse.filters._kernels import floor_masses
mass = np.empty(2)
floor_masses(np.array([0, 1, 1], np.int32), np.array([0.5, 0.25, 0.25]), mass)
print(mass)
"""


def test_what_the_compiler_is_kept_from_can_be_loaded_afterwards() -> None:
    done = subprocess.run([sys.executable, "-c", AFTERWARDS], capture_output=True, text=True, check=False)
    assert done.stdout == "[0.5 0.5]\n", done.stderr[-3000:]


def test_modules_are_left_out_for_the_thread_that_asks_only(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delitem(sys.modules, "colorsys", raising=False)
    importers = list(sys.meta_path)
    with _without("colorsys"):
        with pytest.raises(ModuleNotFoundError, match="left out"):
            import_module("colorsys")
        with ThreadPoolExecutor(1) as pool:
            found = pool.submit(import_module, "colorsys").result()
        assert import_module("colorsys") is found  # what is loaded stays
    assert sys.meta_path == importers


def test_a_kernel_that_counts_no_references_leaves_those_of_its_arrays_alone() -> None:
    t, ids, values = np.array([1.0, 2.0, 1.0]), np.array([5, 5, 5], np.uint64), np.zeros((3, 3))
    table, repeat = np.full(8, -1), np.empty(3, np.bool_)
    arrays = (t, ids, values, table, repeat)
    before = [sys.getrefcount(a) for a in arrays]
    with np.errstate(over="ignore"):
        for _ in range(100):
            table[:] = -1
            mark_repeats(*arrays)
    assert repeat.tolist() == [False, False, True]
    assert [sys.getrefcount(a) for a in arrays] == before
