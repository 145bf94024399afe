"""The catalogue of data sets: manifests are whole and safe, and verify finds what is missing or changed."""

from __future__ import annotations

import hashlib
import re
from pathlib import Path, PurePosixPath

import pytest

from wayfuse.core.errors import UsageError
from wayfuse.formats import datasets
from wayfuse.formats.datasets import CATALOGUE, Entry, data_root, find, manifest, verify

CONTENT = {"a/walk 1.txt": b"one\n" * 5000, "a/b/walk2.txt": b"", "läge.txt": bytes(range(256)) * 700}


def entries(content: dict[str, bytes] = CONTENT) -> tuple[Entry, ...]:
    return tuple(
        Entry(p, len(d), hashlib.sha256(d).hexdigest(), ("o/r", "HEAD", p)) for p, d in content.items()
    )


@pytest.mark.parametrize("name", CATALOGUE)
def test_manifests_are_whole_and_safe(name: str) -> None:
    files = manifest(name)
    assert len(files) > 10
    paths = [e.path for e in files]
    assert len(set(paths)) == len(paths)
    for entry in files:
        path = PurePosixPath(entry.path)
        assert not path.is_absolute()
        assert ".." not in path.parts
        assert not path.name.startswith((".", "~$"))
        assert re.fullmatch(r"[0-9a-f]{64}", entry.sha256)
        assert entry.size >= 0
        assert not entry.url or re.fullmatch(r"https://raw\.githubusercontent\.com/[!-~]+", entry.url)
    data = find(name)
    assert data.origin.startswith("https://")
    assert data.licence
    assert data.citation
    assert data.remark or all(e.url for e in files)


def test_addresses_follow_the_public_repositories() -> None:
    by_path = {f"{n}/{e.path}": e.url for n in CATALOGUE for e in manifest(n)}
    raw = "https://raw.githubusercontent.com"
    assert by_path["ms-indoor/site1/B1/floor_info.json"] == (
        f"{raw}/location-competition/indoor-location-competition-20/HEAD/data/site1/B1/floor_info.json"
    )
    log = "IPIN2023_T3_TrainingTrial01_repetition01.txt"
    assert by_path[f"ipin2023-track3/logs/{log}"] == (
        f"{raw}/Kenny5269/2023_IPIN_Competition_Track03/HEAD/01%20Logfiles/"
        f"01%20IPIN2023_T3_TrainingTrials%20%28training%29/{log}"
    )
    assert by_path["ipin2023-track3/logs/IPIN2023_T3_TrainingTrial53_repetition01.txt"] == ""
    assert by_path["csi/intel5300-distance/1-0-4.dat"].endswith("/M%E4%BB%A3%E7%A0%81/1-0-4.dat")


def test_the_data_root_follows_the_environment(tmp_path: Path) -> None:
    assert data_root({"WAYFUSE_DATA": str(tmp_path)}) == tmp_path
    assert data_root({}) == Path.home() / ".cache" / "wayfuse-data"
    assert data_root({"WAYFUSE_DATA": ""}) == data_root({})


def test_an_unknown_name_lists_the_known() -> None:
    with pytest.raises(UsageError, match="ms-indoor, ipin2023-track3"):
        find("ms-outdoor")


def test_verify_lists_missing_and_changed_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(datasets, "manifest", lambda _: entries())
    for path, data in CONTENT.items():
        target = tmp_path / "toy" / path
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes(data)
    done: list[int] = []
    assert verify("toy", tmp_path, done.append).is_whole
    assert sum(done) == sum(map(len, CONTENT.values()))
    (tmp_path / "toy" / "a" / "b" / "walk2.txt").unlink()
    changed = bytearray(CONTENT["läge.txt"])
    changed[77] ^= 1
    (tmp_path / "toy" / "läge.txt").write_bytes(changed)
    check = verify("toy", tmp_path)
    assert (check.n_good, check.missing, check.changed) == (1, ["a/b/walk2.txt"], ["läge.txt"])
    assert not check.is_whole


@pytest.mark.real_data
@pytest.mark.parametrize("name", ["csi", "sodindoorloc", "sensorlogger"])
def test_the_local_copies_are_those_of_the_manifest(data_root: Path, name: str) -> None:
    if not (data_root / name).is_dir():
        pytest.skip(
            f"REAL DATA ABSENT: no folder {data_root / name}; fetch with `wayfuse datasets fetch {name}`"
        )
    check = verify(name, data_root)
    assert check.is_whole
    assert check.n_good == len(manifest(name))
