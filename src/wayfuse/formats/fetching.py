"""Bringing a data set to the data root: download with resume, or a copy from a local folder.

A file is written beside its place as ``.part`` and moved there only when its size and checksum are those of
the manifest; an interrupted download goes on where it stopped (HTTP range requests). The server is never
trusted with the size: a download stops at the size of the manifest.
"""

from __future__ import annotations

import http.client
import shutil
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from urllib.parse import quote, urlsplit

from wayfuse.core.errors import DataMissingError, UsageError
from wayfuse.formats.datasets import Entry, digest, manifest

__all__ = ["Outcome", "copy", "fetch"]

_CHUNK = 1 << 18
_TRIES = 4
_TIMEOUT_S = 30.0
_PAUSE_S = 0.5  # before the second try, doubled before each further one
_GONE = {400, 401, 403, 404, 410}  # asking again does not help

Progress = Callable[[int], None]


@dataclass(slots=True)
class Outcome:
    """What became of the files of a set: brought, already there, failed (and why), without address."""

    brought: list[str] = field(default_factory=list)
    present: list[str] = field(default_factory=list)
    failed: dict[str, str] = field(default_factory=dict)
    without_address: list[str] = field(default_factory=list)

    @property
    def is_whole(self) -> bool:
        """Whether every file of the manifest is in its place."""
        return not (self.failed or self.without_address)


def fetch(
    name: str,
    root: Path,
    *,
    mirror: str = "",
    progress: Progress = lambda _: None,
    pause: Callable[[float], None] = time.sleep,
) -> Outcome:
    """Download what is missing of a data set.

    Parameters
    ----------
    name : of the catalogue. root : data root; the files go to ``root / name``.
    mirror : address of a folder with the same layout as the data root, used in place of the public homes.
    progress : gets the number of bytes done, of present files too.
    pause : waits some seconds between tries.
    """
    if mirror and urlsplit(mirror).scheme not in {"http", "https"}:
        raise UsageError(f"no http(s) address: {mirror}", where="mirror")
    outcome = Outcome()
    for entry in manifest(name):
        target = root / name / entry.path
        url = f"{mirror.rstrip('/')}/{quote(f'{name}/{entry.path}')}" if mirror else entry.url
        if _is_there(target, entry):
            outcome.present.append(entry.path)
            progress(entry.size)
        elif not url:
            outcome.without_address.append(entry.path)
            progress(entry.size)
        else:
            reason = _download(url, target, entry, progress, pause)
            if reason:
                outcome.failed[entry.path] = reason
            else:
                outcome.brought.append(entry.path)
    return outcome


def copy(name: str, root: Path, source: Path, *, progress: Progress = lambda _: None) -> Outcome:
    """Copy a data set from a local folder, checksums verified.

    ``source`` may be the folder of the data set, a data root that holds it, or a clone of its public
    repository.

    Raises
    ------
    DataMissingError : there is no such folder.
    """
    if not source.is_dir():
        raise DataMissingError("no such folder", where=source)
    outcome = Outcome()
    for entry in manifest(name):
        target = root / name / entry.path
        if _is_there(target, entry):
            outcome.present.append(entry.path)
        else:
            there = entry.source[2] if entry.source else entry.path
            candidates = [source / entry.path, source / name / entry.path, source / there]
            outcome_of = _copy_first((c for c in candidates if c.is_file()), target, entry)
            if outcome_of:
                outcome.failed[entry.path] = outcome_of
            else:
                outcome.brought.append(entry.path)
        progress(entry.size)
    return outcome


def _is_there(target: Path, entry: Entry) -> bool:
    return target.is_file() and target.stat().st_size == entry.size and digest(target) == entry.sha256


def _copy_first(candidates: Iterable[Path], target: Path, entry: Entry) -> str:
    reason = "not in the folder"
    for candidate in candidates:
        if _is_there(candidate, entry):
            target.parent.mkdir(parents=True, exist_ok=True)
            part = _part(target)
            shutil.copyfile(candidate, part)
            part.replace(target)
            return ""
        reason = "differs from the manifest"
    return reason


def _part(target: Path) -> Path:
    return target.with_name(target.name + ".part")


def _download(
    url: str, target: Path, entry: Entry, progress: Progress, pause: Callable[[float], None]
) -> str:
    """Bring one file into place; the reason why not, empty where it is."""
    target.parent.mkdir(parents=True, exist_ok=True)
    part = _part(target)
    counted = 0  # bytes reported so far: a second try reports only what is new

    def report(done: int) -> None:
        nonlocal counted
        if done > counted:
            progress(done - counted)
            counted = done

    reason = ""
    for attempt in range(_TRIES):
        if attempt:
            pause(_PAUSE_S * 2 ** (attempt - 1))
        try:
            _receive(url, part, entry.size, report)
        except urllib.error.HTTPError as error:
            reason = f"HTTP {error.code} {error.reason}"
            error.close()
            if error.code in _GONE:
                break
            continue
        except (OSError, http.client.HTTPException) as error:
            reason = str(error) or type(error).__name__
            continue
        if part.stat().st_size < entry.size:
            reason = "the connection ended early"
        elif digest(part) != entry.sha256:
            part.unlink()
            reason = "the checksum differs from the manifest"
        else:
            part.replace(target)
            return ""
    report(entry.size)
    return reason


def _receive(url: str, part: Path, size: int, report: Progress) -> None:
    """Append to the part file what it lacks; start anew where the server does not resume."""
    have = part.stat().st_size if part.exists() else 0
    if have > size:
        part.unlink()
        have = 0
    if have == size and part.exists():
        return
    request = urllib.request.Request(url, headers={"User-Agent": "wayfuse"})  # noqa: S310 (https, or a checked mirror)
    if have:
        request.add_header("Range", f"bytes={have}-")
    with urllib.request.urlopen(request, timeout=_TIMEOUT_S) as answer:  # noqa: S310
        resumed = answer.status == 206 and answer.headers.get("Content-Range", "").startswith(
            f"bytes {have}-"
        )
        done = have if resumed else 0
        with part.open("ab" if resumed else "wb") as file:
            report(done)
            while done < size and (chunk := answer.read(min(_CHUNK, size - done))):
                file.write(chunk)
                done += len(chunk)
                report(done)
        if done == size and answer.read(1):
            part.unlink()
            raise OSError("the file is larger than the manifest says")
