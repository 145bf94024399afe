"""The files of an IMDF archive, read in memory with limits: nothing is ever unpacked to disk."""

from __future__ import annotations

import zipfile
import zlib
from pathlib import Path, PurePosixPath
from typing import Any

from wayfuse.core.errors import MapError
from wayfuse.maps.importers.plan_file import LARGEST_FILE, parse_json

__all__ = ["MOST_FILES", "read_archive"]

MOST_FILES = 100  # IMDF has 17 files; publishers add a few of their own
REMEDY = "export the venue anew"


def read_archive(path: Path, limit: int = LARGEST_FILE) -> dict[str, Any]:
    """JSON documents of an archive by stem ("manifest", "level", ...).

    Parameters
    ----------
    limit : bytes all files may have together when unpacked.

    Raises
    ------
    MapError : no such file, no archive, larger or with more files than allowed, or names that lead out of it.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            _check(path, archive.infolist(), limit)
            return _documents(path, archive, limit)
    except OSError as error:
        raise MapError(f"cannot be read: {error.strerror}", where=path, remedy="name the archive") from error
    except (zipfile.BadZipFile, zlib.error, EOFError, RuntimeError, ValueError) as error:
        # RuntimeError: an encrypted member; NotImplementedError, its child: an unknown compression
        raise MapError(f"is not a sound ZIP archive: {error}", where=path, remedy=REMEDY) from error


def _check(path: Path, members: list[zipfile.ZipInfo], limit: int) -> None:
    if len(members) > MOST_FILES:
        raise MapError(f"holds {len(members)} files, more than {MOST_FILES}", where=path, remedy=REMEDY)
    for member in members:
        name = PurePosixPath(member.filename.replace("\\", "/"))
        if name.is_absolute() or ".." in name.parts or ":" in name.parts[0:1]:
            raise MapError(f"names a file outside itself: {member.filename!r}", where=path, remedy=REMEDY)
    if sum(member.file_size for member in members) > limit:
        raise MapError(f"unpacks to more than {limit / 2**20:.0f} MiB", where=path, remedy=REMEDY)


def _documents(path: Path, archive: zipfile.ZipFile, limit: int) -> dict[str, Any]:
    names = [m.filename for m in archive.infolist() if not m.is_dir() and "__MACOSX" not in m.filename]
    manifests = sorted((n for n in names if PurePosixPath(n).name == "manifest.json"), key=len)
    if not manifests:
        raise MapError("holds no manifest.json", where=path, remedy="name an IMDF archive")
    folder = PurePosixPath(manifests[0]).parent
    documents = {}
    for name in names:
        file = PurePosixPath(name)
        if file.parent != folder or file.suffix not in (".json", ".geojson"):
            continue
        with archive.open(name) as stream:
            content = stream.read(limit + 1)  # the size in the header may lie
        limit -= len(content)
        if limit < 0:
            raise MapError("unpacks to more than it says", where=path, remedy=REMEDY)
        documents[file.stem] = parse_json(content, f"{path}: {name}")
    return documents
