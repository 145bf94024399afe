"""What a survey collects, in files beside the database: scans that phones push, walks tapped on the map, recordings.

::

    FOLDER/scans/DEVICE.jsonl     a line per push: when it arrived, the phone's newest time in it, its Wi-Fi scans
    FOLDER/walks/ID.json          a walk: which phone, and where it was when (server's clock)
    FOLDER/recordings/ID-NAME     uploaded files, as they came

What is older than it may be goes by `trim`, what a phone collected by `forget`, single parts by `remove`.
"""

from __future__ import annotations

import re
import threading
from collections.abc import Iterator
from hashlib import sha256
from pathlib import Path

import msgspec

from wayfuse.core.errors import UsageError
from wayfuse.service.wire import Name, Scan

__all__ = ["Phone", "Push", "SurveyStore", "TappedWalk", "Waypoint"]

_ID = re.compile(r"[0-9a-f]{16}")
_UNSAFE = re.compile(r"[^A-Za-z0-9._-]+")
_MOST_BYTES = 512 << 20  # of a site's survey; a surveyor of a large mall fills a few tens of megabytes


class Push(msgspec.Struct, frozen=True):
    """Scans that came together. arrived : Unix s, server. newest : s, phone, of the newest record in the push."""

    arrived: float
    newest: float
    scans: list[Scan]


class Waypoint(msgspec.Struct, frozen=True):
    """A place (m, frame of the floor) at a time (Unix s, server)."""

    t: float
    floor: int
    x: float
    y: float


class TappedWalk(msgspec.Struct, frozen=True):
    """Waypoints of a phone; between two of them it went straight, or stood where they are one place."""

    device: Name
    waypoints: list[Waypoint]


class Phone(msgspec.Struct, frozen=True):
    """A phone that pushes scans for the survey: its pseudonym, when it was heard last (Unix s), how many scans."""

    device: str
    heard: float
    scans: int


class SurveyStore:
    """The files of one site's survey; used from any thread."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._lock = threading.Lock()
        self._phones: dict[str, Phone] = {}
        self._written: set[str] = set()  # phones whose file ends with a whole line
        for path in self._folder.glob("scans/*.new"):
            path.unlink()  # of a trim that a crash cut off
        for path in self._in("scans"):
            pushes = list(self.pushes(path.stem))
            self._phones[path.stem] = Phone(
                path.stem, pushes[-1].arrived if pushes else 0.0, sum(len(p.scans) for p in pushes)
            )

    # --- scans

    def add_push(self, device: str, push: Push) -> None:
        """Keep scans of a phone (by its pseudonym); a push without scans only says that the phone is there."""
        with self._lock:
            self._check_room()
            known = self._phones.get(device, Phone(device, 0.0, 0))
            path = self._path("scans", f"{_checked(device)}.jsonl")
            with path.open("ab") as out:
                # the line before may have been cut off by a crash
                begin = b"" if device in self._written or not path.stat().st_size else b"\n"
                out.write(begin + msgspec.json.encode(push) + b"\n")
            self._written.add(device)
            self._phones[device] = Phone(device, push.arrived, known.scans + len(push.scans))

    def pushes(self, device: str) -> Iterator[Push]:
        """All pushes of a phone; a line cut off by a crash is left out."""
        path = self._path("scans", f"{_checked(device)}.jsonl")
        if not path.is_file():
            return
        with path.open("rb") as lines:
            for line in lines:
                try:
                    yield msgspec.json.decode(line, type=Push)
                except msgspec.DecodeError:
                    continue

    def phones(self) -> list[Phone]:
        """Phones that pushed, the last heard first."""
        with self._lock:
            return sorted(self._phones.values(), key=lambda p: -p.heard)

    # --- walks

    def add_walk(self, walk: TappedWalk) -> str:
        """Keep a walk; its identifier."""
        body = msgspec.json.encode(walk)
        name = sha256(body).hexdigest()[:16]
        with self._lock:
            self._check_room()
            self._path("walks", f"{name}.json").write_bytes(body)
        return name

    def walks(self) -> dict[str, TappedWalk]:
        """All walks by identifier."""
        return {p.stem: _walk(p) for p in self._in("walks")}

    # --- recordings

    def add_recording(self, name: str, body: bytes) -> tuple[str, Path]:
        """Keep an uploaded file; its identifier and where it lies."""
        identifier = sha256(body).hexdigest()[:16]
        tidy = _UNSAFE.sub("-", name)[-80:].lstrip(".-") or "recording"
        with self._lock:
            self._check_room()
            known = next(self._folder.glob(f"recordings/{identifier}-*"), None)
            path = known or self._path("recordings", f"{identifier}-{tidy}")
            path.write_bytes(body)
        return identifier, path

    def recordings(self) -> dict[str, Path]:
        """All uploaded files by identifier."""
        return {p.name[:16]: p for p in self._in("recordings")}

    def remove(self, identifier: str) -> bool:
        """Delete a walk or a recording; whether there was one."""
        if not _ID.fullmatch(identifier):
            return False
        with self._lock:
            found = [
                *self._folder.glob(f"walks/{identifier}.json"),
                *self._folder.glob(f"recordings/{identifier}-*"),
            ]
            for path in found:
                path.unlink()
        return bool(found)

    # --- what may not be kept

    def forget(self, device: str) -> int:
        """Delete the scans a phone pushed and the walks tapped for it; how many files that were.

        Uploaded recordings do not say whose they are; they stay.
        """
        with self._lock:
            found = self.files_of(device)
            for path in found:
                path.unlink()
            self._phones.pop(device, None)
        return len(found)

    def files_of(self, device: str) -> list[Path]:
        """The files that `forget` would delete."""
        scans = self._folder / "scans" / f"{_checked(device)}.jsonl"
        walks = [path for path in self._in("walks") if _walk(path).device == device]
        return [path for path in (scans, *walks) if path.is_file()]

    def trim(self, before: float) -> None:
        """Delete scans that arrived, walks that ended, and recordings that were uploaded before a time (Unix s)."""
        with self._lock:
            for path in self._in("scans"):
                self._trim_scans(path, before)
            for path in self._in("walks"):
                if _walk(path).waypoints[-1].t < before:
                    path.unlink()
            for path in self._in("recordings"):
                if path.stat().st_mtime < before:
                    path.unlink()

    def _trim_scans(self, path: Path, before: float) -> None:
        first = next(self.pushes(path.stem), None)
        if first is not None and first.arrived >= before:  # they are in the order of their arrival
            return
        kept = [push for push in self.pushes(path.stem) if push.arrived >= before]
        if not kept:
            path.unlink()
            self._phones.pop(path.stem, None)
            return
        new = path.with_suffix(".new")
        new.write_bytes(b"".join(msgspec.json.encode(push) + b"\n" for push in kept))
        new.replace(path)
        self._phones[path.stem] = Phone(path.stem, kept[-1].arrived, sum(len(p.scans) for p in kept))

    # --- files

    def _path(self, kind: str, name: str) -> Path:
        folder = self._folder / kind
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        return folder / name

    def _in(self, kind: str) -> list[Path]:
        return sorted(self._folder.glob(f"{kind}/*"))

    def _check_room(self) -> None:
        if sum(p.stat().st_size for p in self._folder.rglob("*") if p.is_file()) > _MOST_BYTES:
            raise UsageError(
                "the survey of this site is full", remedy="delete recordings that are no longer needed"
            )


def _walk(path: Path) -> TappedWalk:
    return msgspec.json.decode(path.read_bytes(), type=TappedWalk)


def _checked(device: str) -> str:
    if not _ID.fullmatch(device):
        raise UsageError("no phone of this survey", remedy="list them at /api/v1/survey")
    return device
