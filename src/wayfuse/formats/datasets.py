"""Catalogue of the public data sets that wayfuse is measured on: origin, licence, checksums, state of the
local copy.

Nothing is shipped with the package but the manifests (sha256, size and path of each file). A data set lies in
a folder of its name under the data root, ``$WAYFUSE_DATA`` or ``~/.cache/wayfuse-data``;
`wayfuse.formats.fetching` brings it there. Missing data is an error that says how to get it, never a
stand-in.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache
from importlib import resources
from pathlib import Path
from urllib.parse import quote

from wayfuse.core.errors import UsageError

__all__ = ["CATALOGUE", "Check", "DataSet", "Entry", "data_root", "digest", "find", "manifest", "verify"]

_RAW = "https://raw.githubusercontent.com"
_CHUNK = 1 << 20


@dataclass(frozen=True, slots=True)
class Entry:
    """A file of a data set: path below the set's folder, size in bytes, checksum, where it is published.

    ``source`` is (repository, commit or ``HEAD``, path in the repository), None where no public address is
    known.
    """

    path: str
    size: int
    sha256: str
    source: tuple[str, str, str] | None

    @property
    def url(self) -> str:
        """Address of the raw file, empty where none is known."""
        if self.source is None:
            return ""
        repository, commit, path = self.source
        return f"{_RAW}/{repository}/{commit}/{quote(path)}"


@dataclass(frozen=True, slots=True)
class DataSet:
    """A public data set.

    ``roots`` maps the beginning of a path here to (repository, beginning of the path there). ``remark`` says
    what cannot be fetched file by file and how to get it.
    """

    name: str
    title: str
    origin: str
    licence: str
    citation: str
    roots: tuple[tuple[str, str, str], ...]
    remark: str = ""


def _github(repository: str) -> str:
    return f"https://github.com/{repository}"


CATALOGUE: Mapping[str, DataSet] = {
    d.name: d
    for d in (
        DataSet(
            "ms-indoor",
            "Indoor Location Competition 2.0, sample walks of site1: IMU, Wi-Fi, BLE, waypoints, floor maps",
            _github("location-competition/indoor-location-competition-20"),
            "MIT",
            "Indoor Location Competition 2.0 data set, Microsoft Research and XYZ10, 2020",
            (("site1/", "location-competition/indoor-location-competition-20", "data/site1/"),),
        ),
        DataSet(
            "ipin2023-track3",
            "IPIN 2023 competition, track 3: GetSensorData logs in a museum on three levels, stairs and lift",
            _github("Kenny5269/2023_IPIN_Competition_Track03"),
            "as on Zenodo (cite it)",
            "Torres-Sospedra et al., Datasets and Supporting Materials for the IPIN 2023 Competition "
            "Track 3, Zenodo, doi:10.5281/zenodo.8362205",
            (
                (
                    "logs/",
                    "Kenny5269/2023_IPIN_Competition_Track03",
                    "01 Logfiles/01 IPIN2023_T3_TrainingTrials (training)/",
                ),
                ("", "Kenny5269/2023_IPIN_Competition_Track03", ""),
            ),
            "floormaps/ and ble/ are in the package at doi:10.5281/zenodo.8362205; trials 51 and 53, "
            "repetition 01, were rebuilt from its .mat files",
        ),
        DataSet(
            "sodindoorloc",
            "SODIndoorLoc: Wi-Fi fingerprints in three buildings with known access points",
            _github("renwudao24/SODIndoorLoc"),
            "see the origin",
            "Bi et al., Supplementary open dataset for WiFi indoor localization based on received signal "
            "strength, Satellite Navigation 3, 2022, doi:10.1186/s43020-022-00086-y",
            (("", "renwudao24/SODIndoorLoc", ""),),
        ),
        DataSet(
            "oxford-steps",
            "Oxford step counter: accelerometer walks in seven carrying positions with step counts",
            _github("Oxford-step-counter/DataSet"),
            "CC BY 4.0",
            "Salvi et al., An optimised algorithm for accurate steps counting from smart-phone "
            "accelerometry, EMBC 2018, doi:10.1109/EMBC.2018.8513319",
            (("oxford_steps/", "Oxford-step-counter/DataSet", ""),),
        ),
        DataSet(
            "wifi-rtt",
            "Wi-Fi round-trip times, signal strengths and IMU with known access points",
            _github("haiyaoyu/RTT-Indoor-localization-data-set"),
            "MIT",
            "Hai Yao Yu, RTT indoor localization data set, 2022",
            (("rtt_imu_haiyaoyu/", "haiyaoyu/RTT-Indoor-localization-data-set", ""),),
        ),
        DataSet(
            "csi",
            "Channel state information: Intel 5300 captures by distance, samples of other receivers",
            _github("Challenger1132/CSI_research"),
            "see the origins",
            "Challenger1132/CSI_research; citysu/csiread; Gi-z/CSIKit",
            (),
            "single samples of other tools have no known public address",
        ),
        DataSet(
            "maps",
            "Indoor maps: OSM simple indoor tagging, a floor plan in XML, GeoJSON floors with two walks",
            _github("Accessible-InfoPoint/2.5D-Indoor-Maps"),
            "MIT, ODbL (OpenStreetMap), see the origins",
            "Accessible-InfoPoint/2.5D-Indoor-Maps; simpleLoc/IPIN2024_Data; Shoushtari et al., IPIN "
            "2021 (Hossein-Shoushtari/IPIN21Data)",
            (
                ("osm_apb/", "Accessible-InfoPoint/2.5D-Indoor-Maps", ""),
                ("simpleloc_ipin2024/", "simpleLoc/IPIN2024_Data", ""),
                ("hcu_ipin21/", "Hossein-Shoushtari/IPIN21Data", ""),
            ),
        ),
        DataSet(
            "sensorlogger",
            "One recording of the Sensor Logger app on Android (CSV)",
            _github("d33pk3rn3l/Navigation_23FS_ETHZ"),
            "MIT",
            "d33pk3rn3l/Navigation_23FS_ETHZ, 2023",
            (("sensorlogger_ethz/", "d33pk3rn3l/Navigation_23FS_ETHZ", ""),),
        ),
    )
}


@dataclass(slots=True)
class Check:
    """State of a local copy: number of whole files, paths missing, paths that differ from the manifest."""

    n_good: int = 0
    missing: list[str] = field(default_factory=list)
    changed: list[str] = field(default_factory=list)

    @property
    def is_whole(self) -> bool:
        """Whether every file is there and unchanged."""
        return not (self.missing or self.changed)


def data_root(environment: Mapping[str, str] = os.environ) -> Path:
    """Folder of the data sets: ``$WAYFUSE_DATA``, else ``~/.cache/wayfuse-data``."""
    return Path(environment.get("WAYFUSE_DATA") or Path.home() / ".cache" / "wayfuse-data")


def find(name: str) -> DataSet:
    """A data set by name.

    Raises
    ------
    UsageError : there is none of that name.
    """
    if name not in CATALOGUE:
        raise UsageError(
            f"unknown data set {name!r}", where="datasets", remedy=f"one of {', '.join(CATALOGUE)}"
        )
    return CATALOGUE[name]


@cache
def manifest(name: str) -> tuple[Entry, ...]:
    """Files of a data set, in the order of their paths.

    A line of a manifest is sha256, size and path, separated by tabs, and where the rule of `DataSet.roots`
    does not hold a fourth field: ``-`` (no public address) or ``owner/repository@commit:path``.
    """
    data = find(name)
    text = resources.files("wayfuse.formats").joinpath("manifests", f"{name}.txt").read_text(encoding="utf-8")
    entries = []
    for line in text.splitlines():
        if not line or line.startswith("#"):
            continue
        sha256, size, path, *special = line.split("\t")
        entries.append(Entry(path, int(size), sha256, _source(data, path, special[0] if special else "")))
    return tuple(entries)


def _source(data: DataSet, path: str, special: str) -> tuple[str, str, str] | None:
    if special == "-":
        return None
    if special:
        place, _, there = special.partition(":")
        repository, _, commit = place.partition("@")
        return repository, commit, there
    for here, repository, beginning in data.roots:
        if path.startswith(here):
            return repository, "HEAD", beginning + path.removeprefix(here)
    return None


def digest(path: Path) -> str:
    """SHA-256 of a file as hexadecimal digits."""
    sha = hashlib.sha256()
    with path.open("rb") as file:
        while chunk := file.read(_CHUNK):
            sha.update(chunk)
    return sha.hexdigest()


def verify(name: str, root: Path, progress: Callable[[int], None] = lambda _: None) -> Check:
    """Compare the local copy of a data set with its manifest; ``progress`` gets the bytes checked."""
    check = Check()
    for entry in manifest(name):
        path = root / name / entry.path
        if not path.is_file():
            check.missing.append(entry.path)
        elif path.stat().st_size != entry.size or digest(path) != entry.sha256:
            check.changed.append(entry.path)
        else:
            check.n_good += 1
        progress(entry.size)
    return check
