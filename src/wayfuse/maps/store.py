"""A site in a folder: what is drawn as text, what is derived as tables, and a checksum of each.

```
site.json      name, floors bottom up (level, size, elevation, anchor), connectors, provenance, sha256 of every file
F1.geojson     outline, units, walls, barriers and doors of floor F1 in metres of its frame
F1.npz         walkable mask and wall tables, derived from F1.geojson when the site was built
```
A reader needs no geometry library. A file that is missing, damaged, edited or newer than this version is an
error that names it, never a guess. Sites written before connectors and doors were known load without them.
"""

from __future__ import annotations

import hashlib
import io
import json
import re
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from wayfuse.core.errors import MapError
from wayfuse.core.frames import GeoAnchor
from wayfuse.core.types import Array
from wayfuse.maps.connector_entries import connector_entry, read_connector
from wayfuse.maps.connectors import Connector
from wayfuse.maps.site import Floor, Polygon, Site, Unit
from wayfuse.maps.walkable import Walkable
from wayfuse.maps.walls import WallIndex

__all__ = ["FORMAT", "VERSION", "check_target", "file_stems", "load_site", "save_site"]

T = TypeVar("T")

FORMAT = "wayfuse-site"
VERSION = 1
WALL_TABLES = ("clearance", "start", "index", "distance")  # of an index, as `WallIndex.tables` gives them
MANIFEST = "site.json"
ANEW = "import the site anew with `wayfuse site import`"


def save_site(site: Site, folder: Path, *, overwrite: bool = False) -> None:
    """Write a site; the manifest goes last, so that a folder with one is whole.

    Raises
    ------
    MapError : the folder holds something already, and ``overwrite`` is not set or it is not a site.
    """
    folder = Path(folder)
    check_target(folder, overwrite)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        _write(site, folder)
    except OSError as error:
        raise MapError(
            f"cannot write: {error.strerror}", where=folder, remedy="name another folder"
        ) from error


def _write(site: Site, folder: Path) -> None:
    entries: list[dict[str, Any]] = []
    for floor, stem in zip(site.floors, file_stems(site.floor_names), strict=True):
        drawn, derived = _geojson(floor), _tables(floor)
        (folder / f"{stem}.geojson").write_bytes(drawn)
        (folder / f"{stem}.npz").write_bytes(derived)
        entries.append(
            {
                "name": floor.name,
                "level": floor.level,
                "width": floor.width,
                "height": floor.height,
                "elevation": floor.elevation,
                "anchor": _anchor_entry(floor.anchor),
                "files": {f"{stem}.geojson": _sha256(drawn), f"{stem}.npz": _sha256(derived)},
            }
        )
    manifest = {
        "format": FORMAT,
        "version": VERSION,
        "name": site.name,
        "units": "metres of each floor's frame, x east, y north; anchor: (lon, lat) = origin + matrix (x, y)",
        "floors": entries,
        "connectors": [connector_entry(connector, site.floor_names) for connector in site.connectors],
        "provenance": dict(site.provenance),
    }
    text = json.dumps(manifest, indent=1, ensure_ascii=False)
    (folder / MANIFEST).write_text(text + "\n", encoding="utf-8")
    current = {name for entry in entries for name in entry["files"]}
    for path in [*folder.glob("*.geojson"), *folder.glob("*.npz")]:
        if path.name not in current:
            path.unlink()


def load_site(folder: Path) -> Site:
    """Read a site that `save_site` wrote.

    Raises
    ------
    MapError : no site there, a file missing, damaged or of a newer version; names the file and the remedy.
    """
    folder = Path(folder)
    manifest = _manifest(folder)
    try:
        floors = tuple(_floor(folder, entry) for entry in manifest["floors"])
        return Site(
            name=str(manifest["name"]),
            floors=floors,
            provenance=dict(manifest.get("provenance", {})),
            connectors=_connectors(folder, manifest, [floor.name for floor in floors]),
        )
    except (KeyError, TypeError, ValueError, ArithmeticError, AttributeError) as error:
        raise MapError(f"damaged: {error!r}", where=folder / MANIFEST, remedy=ANEW) from error


def check_target(folder: Path, overwrite: bool) -> None:
    """Raise MapError where `save_site` would: the folder is a file, or holds other things or a site."""
    if folder.exists() and not folder.is_dir():
        raise MapError("is a file, not a folder", where=folder, remedy="name another folder")
    held = sorted(p.name for p in folder.iterdir()) if folder.is_dir() else []
    if held and MANIFEST not in held:
        raise MapError(
            f"holds other files ({held[0]}, ...)", where=folder, remedy="name an empty or new folder"
        )
    if held and not overwrite:
        raise MapError(
            "holds a site already", where=folder, remedy="name another folder, or give --overwrite"
        )


def _manifest(folder: Path) -> dict[str, Any]:
    path = folder / MANIFEST
    if not folder.is_dir():
        raise MapError("no such folder", where=folder, remedy="import a site first: `wayfuse site import`")
    if not path.is_file():
        raise MapError(f"not a site: it has no {MANIFEST}", where=folder, remedy=ANEW)
    try:
        manifest = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise MapError(f"damaged: {error}", where=path, remedy=ANEW) from error
    if not isinstance(manifest, dict) or manifest.get("format") != FORMAT:
        raise MapError(f"not a site: its format is not {FORMAT!r}", where=path, remedy=ANEW)
    version = manifest.get("version")
    if not isinstance(version, int) or version > VERSION:
        raise MapError(f"version {version!r}, known up to {VERSION}", where=path, remedy="upgrade wayfuse")
    return manifest


def file_stems(names: tuple[str, ...]) -> list[str]:
    """A file stem for each floor name: the name where it can be one, unique whatever the case."""
    stems: list[str] = []
    for i, name in enumerate(names):
        stem = re.sub(r"[^0-9A-Za-z_-]+", "_", name) or "floor"
        taken = {s.casefold() for s in stems} | {"site"}
        stems.append(stem if stem.casefold() not in taken else f"{stem}_{i}")
    return stems


def _geojson(floor: Floor) -> bytes:
    features = [_feature("MultiPolygon", [_rings(p) for p in floor.outline], {"kind": "outline"})]
    features += [
        _feature("Polygon", _rings(u.polygon), {"kind": "unit", "name": u.name, "category": u.category}, u.id)
        for u in floor.units
    ]
    drawn = (("walls", floor.walls), ("barriers", floor.barriers), ("doors", floor.doors))
    for kind, segments in drawn:
        features.append(_feature("MultiLineString", segments.reshape(-1, 2, 2).tolist(), {"kind": kind}))
    head = '{"type": "FeatureCollection", "coordinates": "metres, x east, y north", "features": [\n'
    lines = ",\n".join(json.dumps(feature, ensure_ascii=False) for feature in features)
    return (head + lines + "\n]}\n").encode()


def _feature(kind: str, coordinates: Any, properties: dict[str, str], ident: str = "") -> dict[str, Any]:
    geometry = {"type": kind, "coordinates": coordinates}
    named = {"id": ident} if ident else {}
    return {"type": "Feature", **named, "properties": properties, "geometry": geometry}


def _rings(polygon: Polygon) -> list[Any]:
    return [ring.tolist() for ring in polygon.rings]


def _tables(floor: Floor) -> bytes:
    buffer = io.BytesIO()
    indexes = {"wall": floor.wall_index, "barrier": floor.barrier_index}
    tables: dict[str, Any] = {
        f"{name}_{key}": table
        for name, index in indexes.items()
        for key, table in zip(WALL_TABLES, index.tables, strict=True)
    }
    np.savez_compressed(
        buffer,
        mask=floor.walkable.mask,
        mask_frame=np.array([*floor.walkable.origin, floor.walkable.cell]),
        **tables,
    )
    return buffer.getvalue()


def _floor(folder: Path, entry: dict[str, Any]) -> Floor:
    files: dict[str, str] = entry["files"]
    drawn = next(name for name in [*files, ".geojson"] if name.endswith(".geojson"))
    derived = str(Path(drawn).with_suffix(".npz"))
    outline, units, segments = _read(folder, drawn, files[drawn], _parse_geojson)
    walkable, walls, barriers = _read(
        folder,
        derived,
        files[derived],
        lambda content: _parse_tables(content, segments["walls"], segments["barriers"]),
    )
    anchor = entry["anchor"]
    return Floor(
        name=str(entry["name"]),
        level=int(entry["level"]),
        width=float(entry["width"]),
        height=float(entry["height"]),
        elevation=float(entry["elevation"]),
        outline=outline,
        units=units,
        walls=segments["walls"],
        barriers=segments["barriers"],
        walkable=walkable,
        wall_index=walls,
        barrier_index=barriers,
        anchor=None if anchor is None else _anchor(anchor),
        doors=segments.get("doors", np.empty((0, 4))),
    )


def _read(folder: Path, name: str, sha256: str, parse: Callable[[bytes], T]) -> T:
    """Parse a file whose checksum is right; whatever is wrong with it is an error that names it."""
    content = _checked(folder, name, sha256)
    try:
        return parse(content)
    except (MapError, KeyError, TypeError, ValueError, IndexError, OSError, zipfile.BadZipFile) as error:
        raise MapError(f"damaged: {error}", where=folder / name, remedy=ANEW) from error


def _parse_tables(content: bytes, *segments: Array) -> tuple[Walkable, WallIndex, WallIndex]:
    if not zipfile.is_zipfile(io.BytesIO(content)):
        raise ValueError("not an archive of tables")
    with np.load(io.BytesIO(content), allow_pickle=False) as tables:
        x, y, cell = tables["mask_frame"].tolist()
        walls, barriers = (
            WallIndex.from_tables(lines, *(tables[f"{name}_{key}"] for key in WALL_TABLES))
            for name, lines in zip(("wall", "barrier"), segments, strict=True)
        )
        return Walkable((x, y), cell, tables["mask"]), walls, barriers


def _checked(folder: Path, name: str, sha256: str) -> bytes:
    if Path(name).name != name:
        raise MapError(f"names a file outside its folder: {name!r}", where=folder / MANIFEST, remedy=ANEW)
    path = folder / name
    try:
        content = path.read_bytes()
    except OSError as error:
        raise MapError(f"missing or unreadable: {error.strerror}", where=path, remedy=ANEW) from error
    if _sha256(content) != sha256:
        raise MapError(f"damaged or edited: its checksum is not in {MANIFEST}", where=path, remedy=ANEW)
    return content


def _parse_geojson(
    content: bytes,
) -> tuple[tuple[Polygon, ...], tuple[Unit, ...], dict[str, Array]]:
    outline: tuple[Polygon, ...] = ()
    units: list[Unit] = []
    segments: dict[str, Array] = {}
    for feature in json.loads(content)["features"]:
        properties, coordinates = feature["properties"], feature["geometry"]["coordinates"]
        match properties["kind"]:
            case "outline":
                outline = tuple(_polygon(rings) for rings in coordinates)
            case "unit":
                unit = Unit(feature["id"], properties["name"], properties["category"], _polygon(coordinates))
                units.append(unit)
            case "walls" | "barriers" | "doors" as kind:
                segments[kind] = np.array(coordinates, dtype=np.float64).reshape(-1, 4)
    return outline, tuple(units), segments


def _polygon(rings: list[Any]) -> Polygon:
    exterior, *holes = (np.array(ring, dtype=np.float64) for ring in rings)
    return Polygon(exterior, tuple(holes))


def _anchor_entry(anchor: GeoAnchor | None) -> dict[str, Any] | None:
    return (
        None
        if anchor is None
        else {"origin": list(anchor.origin), "matrix": [list(row) for row in anchor.matrix]}
    )


def _anchor(entry: dict[str, Any]) -> GeoAnchor:
    (lon, lat), ((a, b), (c, d)) = entry["origin"], entry["matrix"]
    return GeoAnchor((lon, lat), ((a, b), (c, d)))


def _connectors(folder: Path, manifest: dict[str, Any], names: list[str]) -> tuple[Connector, ...]:
    found = []
    for entry in manifest.get("connectors", []):
        try:
            found.append(read_connector(entry, names))
        except (MapError, KeyError, TypeError, ValueError, AttributeError) as error:
            ident = entry.get("id", "?") if isinstance(entry, dict) else "?"
            raise MapError(
                f"damaged: connector {ident}: {error}", where=folder / MANIFEST, remedy=ANEW
            ) from error
    return tuple(found)


def _sha256(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()
