"""The command line as a whole: quick help, completion, exit states."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from wayfuse import __version__
from wayfuse.cli.main import COMMANDS, cli

HEAVY = ("numpy", "numba", "scipy", "shapely", "matplotlib", "concurrent.futures.process", "multiprocessing")
SCRIPT = """
import json, sys
from wayfuse.cli.main import main
sys.argv = ["wayfuse", *json.loads(sys.argv[1])]
try:
    main()
finally:
    print(json.dumps(sorted(sys.modules)), file=sys.stderr)
"""


def modules_of(*arguments: str) -> tuple[str, set[str]]:
    """Output and modules loaded of a run in a process of its own."""
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT, json.dumps(arguments)], capture_output=True, text=True, check=False
    )
    assert "Traceback" not in done.stderr
    return done.stdout, set(json.loads(done.stderr.splitlines()[-1]))


@pytest.mark.parametrize(
    "arguments",
    [("--help",), ("--version",), *((name, "--help") for name in COMMANDS), ("survey", "build", "--help")],
)
def test_help_loads_nothing_heavy(arguments: tuple[str, ...]) -> None:
    out, loaded = modules_of(*arguments)
    assert out.strip()
    assert not loaded & set(HEAVY)


def test_tracking_loads_neither_plots_nor_statistics_nor_test_tools(world: Any, tmp_path: Path) -> None:
    walk = sorted((world.folder / "walks").rglob("*.txt"))[0]
    _, loaded = modules_of(
        "track", str(world.folder / "SITE"), str(walk), "--radio-map", str(world.folder / "map.npz"),
        "--particles", "20", "--out", str(tmp_path / "EST.csv"),
    )  # fmt: skip
    assert (tmp_path / "EST.csv").exists()
    banned = ("matplotlib", "scipy", "sklearn", "shapely", "networkx", "unittest", "numpy.testing")
    assert not [name for name in banned if name in loaded]


def test_help_names_every_command(run_cli: Callable[..., Any]) -> None:
    said = run_cli("--help")
    assert said.code == 0
    for name, (_, line) in COMMANDS.items():
        assert name in said.out
        assert line.split()[0] in said.out
        command = cli.get_command(None, name)  # type: ignore[arg-type]
        assert command is not None
        assert command.help
    assert __version__ in run_cli("--version").out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("nonsense",), "No such command 'nonsense'"),
        (("track",), "Missing argument"),
        (("--nonsense",), "No such option"),
    ],
)
def test_wrong_commands_are_refused(
    run_cli: Callable[..., Any], arguments: tuple[str, ...], message: str
) -> None:
    said = run_cli(*arguments)
    assert said.code == 2
    assert message in said.err
    assert "Traceback" not in said.err


@pytest.mark.parametrize(
    ("shell", "mark"), [("bash", "complete"), ("zsh", "#compdef wayfuse"), ("fish", "complete")]
)
def test_completion_scripts(shell: str, mark: str) -> None:
    environment = {**os.environ, "_WAYFUSE_COMPLETE": f"{shell}_source"}
    if shell == "bash":
        environment["PATH"] = os.environ.get("PATH", "")
    done = subprocess.run(
        [sys.executable, "-m", "wayfuse"], capture_output=True, text=True, check=False, env=environment
    )
    assert done.returncode == 0
    assert mark in done.stdout
    assert "_WAYFUSE_COMPLETE" in done.stdout


def test_completion_offers_commands_and_methods() -> None:
    for words, at, wanted in (("wayfuse tr", 1, "track"), ("wayfuse track --method f", 3, "fused")):
        environment = {
            **os.environ,
            "_WAYFUSE_COMPLETE": "bash_complete",
            "COMP_WORDS": words,
            "COMP_CWORD": str(at),
        }
        done = subprocess.run(
            [sys.executable, "-m", "wayfuse"], capture_output=True, text=True, check=False, env=environment
        )
        assert wanted in done.stdout


def test_a_closed_pipe_is_no_traceback() -> None:
    command = [sys.executable, "-m", "wayfuse", "datasets", "list", "--json"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as running:
        assert running.stdout is not None
        assert running.stderr is not None
        running.stdout.close()
        assert "Traceback" not in running.stderr.read()


def test_kernels_run_uncompiled() -> None:
    """A fast part of the suite in plain Python: the kernels are also what they say."""
    tests = Path(__file__).parents[1]
    chosen = [
        "core/test_philox.py", "core/test_elementary.py::test_sincos", "filters/test_filter_kernels.py",
        "models/test_pdr_motion.py::test_the_kernel_is_its_twin",
        "models/test_constraints.py::test_the_mask_is_its_twin",
        "models/test_fingerprint_likelihood.py::test_it_is_its_twin",
        "radio/test_sparse_knn.py::test_the_kernel_picks_as_a_stable_sort_does",
        "radio/test_sparse_knn.py::test_distances_are_those_of_the_formula",
    ]  # fmt: skip
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *(str(tests / name) for name in chosen),
         "-k", "not moments and not uniforms_are"],
        capture_output=True, text=True, check=False, cwd=tests.parent,
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
    )  # fmt: skip
    assert done.returncode == 0, done.stdout[-3000:]
