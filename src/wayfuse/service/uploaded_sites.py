"""Sites that came over the interface: read from an upload, kept in a folder each beside the database."""

from __future__ import annotations

import dataclasses
import re
import shutil
import tempfile
import zipfile
import zlib
from hashlib import sha256
from pathlib import Path, PurePosixPath
from typing import Any

from wayfuse.core.errors import MapError, UsageError
from wayfuse.maps.importers.catalogue import IMPORTERS, floor_rows, import_plan
from wayfuse.maps.problems import Severity
from wayfuse.maps.site import Site
from wayfuse.maps.validate import validate_site

__all__ = ["FORMATS", "UploadedSites", "read_upload"]

FORMATS = (*IMPORTERS, "wayfuse")  # the last: a folder that `wayfuse site import` wrote
_ARCHIVES = {"imdf"}  # formats whose files are ZIP archives themselves
_SUFFIXES = {
    "image": (".toml", ".json"),
    "osm": (".osm", ".geojson"),
    "simpleloc": (".xml",),
}  # others: a folder
_MOST_FILES, _MOST_BYTES = 2000, 256 << 20  # of an archive, unpacked
_MOST_PROBLEMS = 20  # that are told
_LONGEST_NAME = 100
_ZIP = b"PK\x03\x04"
_UNSAFE = re.compile(r"[^A-Za-z0-9._-]+")


def read_upload(plan_format: str, body: bytes, file: str = "", name: str = "") -> tuple[Site, dict[str, Any]]:
    """Site of an uploaded file, or of a ZIP archive of a folder, and what is to be told of it.

    Parameters
    ----------
    plan_format : of `FORMATS`. file : what it was called; its ending matters. name : of the site, instead of its own.

    Raises
    ------
    MapError : it cannot be read, or the archive leads out of itself or is too large. UsageError : no name for a site.
    """
    with tempfile.TemporaryDirectory() as folder:
        at = Path(folder)
        try:
            site, said = _read(plan_format, _unpacked(plan_format, body, file, at))
        except MapError as error:  # where it lay here is nobody's business
            remedy = error.remedy.replace(f"{at}/", "")
            raise MapError(str(error.what).replace(f"{at}/", ""), remedy=remedy) from error
    site = dataclasses.replace(site, name=name or site.name)
    if not site.name.isprintable() or not 0 < len(site.name.strip()) <= _LONGEST_NAME:
        raise UsageError(
            f"{site.name[:_LONGEST_NAME]!r} cannot name a site", remedy="give another with ?name="
        )
    problems = validate_site(site)
    errors = [str(p) for p in problems if p.severity is Severity.ERROR]
    return site, {"site": site.name, **said, "errors": len(errors), "problems": errors[:_MOST_PROBLEMS]}


def _read(plan_format: str, path: Path) -> tuple[Site, dict[str, Any]]:
    if plan_format == "wayfuse":
        site = Site.load(path)
        return site, {"floors": [{"floor": f.name, "level": f.level} for f in site.floors], "warnings": []}
    site, report = import_plan(plan_format, path)
    return site, {"floors": floor_rows(site, report), "warnings": list(report.warnings)}


def _unpacked(plan_format: str, body: bytes, file: str, folder: Path) -> Path:
    """The file or folder that an importer is given."""
    if plan_format in _ARCHIVES or not body.startswith(_ZIP):
        path = folder / (_UNSAFE.sub("-", file)[-80:].lstrip(".-") or "plan")
        path.write_bytes(body)
        return path
    target = folder / "unpacked"
    _unpack(body, folder / "upload.zip", target)
    held = [p for p in target.iterdir() if p.name != "__MACOSX"]
    root = held[0] if len(held) == 1 and held[0].is_dir() else target
    suffixes = _SUFFIXES.get(plan_format)
    if suffixes is None:
        return root
    found = sorted(p for p in root.iterdir() if p.suffix.lower() in suffixes)
    if len(found) != 1:
        raise MapError(
            f"holds {len(found)} files that end with {' or '.join(suffixes)}", remedy="send one of them"
        )
    return found[0]


def _unpack(body: bytes, path: Path, target: Path) -> None:
    path.write_bytes(body)
    try:
        with zipfile.ZipFile(path) as archive:
            members = archive.infolist()
            if len(members) > _MOST_FILES or sum(m.file_size for m in members) > _MOST_BYTES:
                raise MapError(
                    f"unpacks to more than {_MOST_FILES} files or {_MOST_BYTES >> 20} MiB",
                    remedy="send the plans alone",
                )
            for member in members:
                name = PurePosixPath(member.filename.replace("\\", "/"))
                if name.is_absolute() or ".." in name.parts:
                    raise MapError("names a file outside itself", remedy="pack the folder anew")
            archive.extractall(target)
    except (zipfile.BadZipFile, zlib.error, EOFError, OSError, RuntimeError, ValueError) as error:
        # RuntimeError: an encrypted member; NotImplementedError, its child: an unknown compression
        raise MapError(
            f"is no sound ZIP archive: {type(error).__name__}", remedy="pack the folder anew"
        ) from error


class UploadedSites:
    """The folder of the sites. Each is written beside its place and then moved there, so that it is never in parts."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def folders(self) -> list[Path]:
        """Folders of all sites."""
        for old in self._folder.glob("*.old"):  # a crash came between the two moves of `put`
            place = old.with_suffix("")
            if not place.exists():
                old.rename(place)
        return sorted(p for p in self._folder.glob("*") if not p.suffix)

    def write(self, site: Site) -> None:
        """Write a site beside its place, for `put`."""
        new = self._place(site.name).with_suffix(".new")
        shutil.rmtree(new, ignore_errors=True)
        site.save(new)

    def put(self, name: str) -> None:
        """Move a site that was written to its place, instead of one of its name that was there."""
        place = self._place(name)
        old = place.with_suffix(".old")
        shutil.rmtree(old, ignore_errors=True)
        if place.exists():
            place.rename(old)
        place.with_suffix(".new").rename(place)
        shutil.rmtree(old, ignore_errors=True)

    def remove(self, name: str) -> None:
        """Delete a site."""
        shutil.rmtree(self._place(name))

    def _place(self, name: str) -> Path:
        return self._folder / sha256(name.encode()).hexdigest()[:16]
