"""``wayfuse datasets``: the commands as a user runs them."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from wayfuse.cli.datasets import datasets
from wayfuse.core.errors import DataMissingError, UsageError
from wayfuse.formats import datasets as sets
from wayfuse.formats import fetching
from wayfuse.formats.datasets import CATALOGUE, Entry

CONTENT = {"a.dat": b"one", "b/c.dat": b"two" * 1000}


@pytest.fixture(autouse=True)
def root(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("WAYFUSE_DATA", str(tmp_path / "root"))
    return tmp_path / "root"


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two small files in place of every manifest; the second has no public address."""
    entries = tuple(
        Entry(p, len(d), hashlib.sha256(d).hexdigest(), None if "c" in p else ("o/r", "HEAD", p))
        for p, d in CONTENT.items()
    )
    monkeypatch.setattr(sets, "manifest", lambda _: entries)
    monkeypatch.setattr(fetching, "manifest", lambda _: entries)


@pytest.fixture
def source(tmp_path: Path) -> Path:
    for path, data in CONTENT.items():
        target = tmp_path / "source" / path
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes(data)
    return tmp_path / "source"


def run(*arguments: str) -> Result:
    return CliRunner().invoke(datasets, arguments)


def test_list_names_every_set_with_origin_licence_and_state(root: Path) -> None:
    result = run("list")
    assert result.exit_code == 0
    for data in CATALOGUE.values():
        assert data.name in result.output
        assert data.origin in result.output
        assert data.licence in result.output
    assert "0 of 529 files here" in result.output
    answer = json.loads(run("list", "--json").output)
    assert answer["root"] == str(root)
    assert [d["name"] for d in answer["datasets"]] == list(CATALOGUE)
    assert answer["datasets"][0]["bytes"] > 7e8


@pytest.mark.usefixtures("small")
def test_fetch_from_a_folder_then_verify(root: Path, source: Path) -> None:
    result = run("fetch", "csi", "--from", str(source))
    assert result.exit_code == 0, result.output
    assert "2 files brought, 0 were here" in result.output
    assert (root / "csi" / "b" / "c.dat").read_bytes() == CONTENT["b/c.dat"]
    result = run("verify")
    assert result.exit_code == 0
    assert "csi: 2 good, 0 missing, 0 changed" in result.output


@pytest.mark.usefixtures("small")
def test_verify_fails_on_a_changed_and_a_missing_file(root: Path, source: Path) -> None:
    run("fetch", "csi", "--from", str(source))
    (root / "csi" / "a.dat").write_bytes(b"One")
    (root / "csi" / "b" / "c.dat").unlink()
    result = run("verify", "csi")
    assert result.exit_code == 1
    assert "changed: a.dat" in result.output
    assert "missing: b/c.dat" in result.output
    result = run("verify", "csi", "--json")
    assert result.exit_code == 1
    assert json.loads(result.output)["datasets"] == {
        "csi": {"good": 0, "missing": ["b/c.dat"], "changed": ["a.dat"]}
    }


@pytest.mark.usefixtures("small")
def test_fetch_reports_failures_and_files_without_address(tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    result = run("fetch", "csi", "--from", str(tmp_path / "empty"), "--json")
    assert result.exit_code == 1
    assert json.loads(result.output)["failed"] == {
        "a.dat": "not in the folder",
        "b/c.dat": "not in the folder",
    }


@pytest.mark.usefixtures("small")
def test_a_fetch_that_finds_all_but_what_has_no_address_is_no_failure(root: Path) -> None:
    (root / "csi").mkdir(parents=True)
    (root / "csi" / "a.dat").write_bytes(CONTENT["a.dat"])
    result = run("fetch", "csi")
    assert result.exit_code == 0
    assert "no public address: b/c.dat" in result.output
    assert CATALOGUE["csi"].remark in result.output


def test_misuse_is_named(tmp_path: Path) -> None:
    assert isinstance(run("fetch", "moon").exception, UsageError)
    both = run("fetch", "csi", "--from", str(tmp_path), "--mirror", "http://localhost")
    assert "exclude each other" in str(both.exception)
    assert isinstance(run("verify").exception, DataMissingError)
    assert isinstance(run("fetch", "csi", "--from", str(tmp_path / "absent")).exception, DataMissingError)
