"""Import a venue in the Indoor Mapping Data Format 1.0.0 (OGC 20-094): a ZIP archive of GeoJSON files.

A floor is all levels of one ordinal; its outline is theirs. Units are walked in, except walls, columns, voids and
plants (`CLOSED`). Walls are the outline and the edges of the units that enclose (all but those in `OPEN`), without
the parts where an opening lies; space of a level without units is open. Openings are doors. Stairs, lifts and
other connectors are units, joined by relationships or, where there are none, where they overlap (`joining`).

An archive of `wayfuse.maps.importers.imdf_write` carries its own properties ("wayfuse:...") and comes back as it
was.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from wayfuse.core.errors import MapError
from wayfuse.core.frames import GeoAnchor
from wayfuse.core.types import Array
from wayfuse.maps.build import build_floor, nominal_elevation
from wayfuse.maps.importers import geojson
from wayfuse.maps.importers.imdf_archive import read_archive
from wayfuse.maps.importers.imdf_relationships import read_connectors
from wayfuse.maps.importers.joining import KINDS
from wayfuse.maps.importers.report import FloorReport, ImportReport, Notes
from wayfuse.maps.importers.rooms import anchor_residual, chords, cleaned, cut_walls, local_anchor
from wayfuse.maps.problems import KEY, problems_text
from wayfuse.maps.site import Floor, Polygon, Site, Unit

__all__ = ["CLOSED", "CONNECTORS", "OPEN", "import_site"]

# categories nobody walks in
CLOSED = frozenset(
    ("brick", "column", "concrete", "drywall", "glass", "opentobelow", "structure", "vegetation", "wood")
)
CONNECTORS = frozenset(KINDS)
# categories whose edge is no wall
OPEN = CONNECTORS | {
    *("fieldofplay", "footbridge", "lobby", "parking", "platform", "road", "terrace", "unenclosedarea"),
    *("unspecified", "waitingroom", "walkway", "walkway.island"),
}
OPENING_DEPTH = 0.025  # m, an opening cuts walls this near: it is drawn on the edges it opens
LEVEL_LIMIT = 200  # ordinals beyond are a mistake


@dataclass(slots=True)
class _Level:
    """What is drawn of one ordinal (degrees); an opening has its id, line and our own mark of doors."""

    name: str
    outline: list[tuple[Array, ...]] = field(default_factory=list)
    units: list[tuple[dict[str, Any], tuple[tuple[Array, ...], ...]]] = field(default_factory=list)
    openings: list[tuple[str, Array, Any]] = field(default_factory=list)
    elevation: float | None = None
    notes: Notes = field(default_factory=Notes)


def import_site(path: Path) -> tuple[Site, ImportReport]:
    """Site of an IMDF archive, all floors in one frame, and what was met on the way.

    Raises
    ------
    MapError : the archive cannot be read, is of another version, or has no level with an outline.
    """
    path = Path(path)
    files = read_archive(path)
    manifest = files["manifest"]
    version = manifest.get("version") if isinstance(manifest, dict) else None
    if not isinstance(version, str) or not version.startswith("1.0."):
        raise MapError(f"IMDF version {version!r}, known is 1.0.0", where=path, remedy="export IMDF 1.0.0")
    language = str(manifest.get("language", "en"))
    notes = Notes()
    levels, ordinals = _levels(path, files, language, notes)
    _add_units(path, files, levels, ordinals, notes)
    _add_openings(path, files, levels, ordinals, notes)
    points = np.concatenate([rings[0] for level in levels.values() for rings in level.outline])
    anchor = local_anchor(points, path)
    size = anchor.to_xy(points.max(axis=0))
    built = [_build(k, levels[k], anchor, size, language, 0 in levels) for k in sorted(levels)]
    floors = [item for item in built if item is not None]
    if not floors:
        raise MapError("no level encloses an area", where=path, remedy="export the venue anew")
    venue = _features(path, files, "venue")
    name = _label(_properties(venue[0]).get("name"), language) if venue else ""
    storeys = tuple(floor for floor, _ in floors)
    related = [_properties(feature) for feature in _features(path, files, "relationship")]
    own = manifest.get("generated_by") == "wayfuse"
    connectors = read_connectors(storeys, related, _sources(path, files, ordinals), anchor, notes, own=own)
    problems = [p for k in sorted(levels) for p in levels[k].notes.problems] + notes.problems
    provenance = {
        "importer": "imdf",
        "source": path.name,
        "frame": "metres east and north of the south-west corner of all levels",
        KEY: problems_text(problems),
    }
    site = Site(name or path.stem, storeys, provenance, connectors)
    return site, ImportReport(tuple(report for _, report in floors), tuple(notes))


def _features(path: Path, files: Mapping[str, Any], kind: str) -> list[Any]:
    if kind not in files:
        return []
    document = files[kind]
    features = document.get("features") if isinstance(document, dict) else None
    if not isinstance(features, list):
        raise MapError(
            "is not a FeatureCollection", where=f"{path}: {kind}.geojson", remedy="export the venue anew"
        )
    return features


def _properties(feature: Any) -> dict[str, Any]:
    held = feature.get("properties") if isinstance(feature, dict) else None
    return held if isinstance(held, dict) else {}


def _placed(feature: Any, ordinals: Mapping[str, int]) -> tuple[str, dict[str, Any], int | None]:
    """Id, properties and the ordinal of the level of a feature, None where it names no known level."""
    properties = _properties(feature)
    ident = str(feature.get("id", "")) if isinstance(feature, dict) else ""
    return ident, properties, ordinals.get(str(properties.get("level_id")))


def _label(labels: Any, language: str) -> str:
    """Text of a label in the language of the archive, else in any."""
    if not isinstance(labels, dict) or not labels:
        return ""
    return str(labels.get(language) or next(iter(labels.values())) or "")


def _levels(
    path: Path, files: Mapping[str, Any], language: str, notes: Notes
) -> tuple[dict[int, _Level], dict[str, int]]:
    """Levels by ordinal, and the ordinal of each level id."""
    levels: dict[int, _Level] = {}
    ordinals: dict[str, int] = {}
    for feature in _features(path, files, "level"):
        properties = _properties(feature)
        ident = str(feature.get("id", "")) if isinstance(feature, dict) else ""
        ordinal, parts = properties.get("ordinal"), geojson.polygons(feature)
        if not isinstance(ordinal, int) or abs(ordinal) > LEVEL_LIMIT or not parts:
            notes.append(f"level {ident}: no polygon on the earth, or no whole ordinal: left out")
            continue
        name = _label(properties.get("short_name"), language) or _label(properties.get("name"), language)
        taken = {level.name.casefold() for level in levels.values()}
        if name.casefold() in taken:
            name = f"{name} ({ordinal})"
        level = levels.setdefault(ordinal, _Level(name or str(ordinal), notes=Notes(name or str(ordinal))))
        level.outline += parts
        elevation = properties.get("wayfuse:elevation")
        if isinstance(elevation, float):
            level.elevation = elevation
        ordinals[ident] = ordinal
    if not levels:
        raise MapError("holds no level with an outline", where=path, remedy="name an IMDF archive")
    return levels, ordinals


def _add_units(
    path: Path,
    files: Mapping[str, Any],
    levels: Mapping[int, _Level],
    ordinals: Mapping[str, int],
    notes: Notes,
) -> None:
    for feature in _features(path, files, "unit"):
        ident, properties, ordinal = _placed(feature, ordinals)
        parts = geojson.polygons(feature)
        if ordinal is None or not parts:
            notes.append(f"unit {ident}: no polygon on the earth, or no known level: left out")
        else:
            levels[ordinal].units.append(({**properties, "id": ident}, parts))


def _add_openings(
    path: Path,
    files: Mapping[str, Any],
    levels: Mapping[int, _Level],
    ordinals: Mapping[str, int],
    notes: Notes,
) -> None:
    for feature in _features(path, files, "opening"):
        ident, properties, ordinal = _placed(feature, ordinals)
        points = geojson.line(feature)
        if ordinal is None or points is None:
            notes.append(f"opening {ident}: no line on the earth, or no known level: left out")
        else:
            levels[ordinal].openings.append((ident, points, properties.get("wayfuse:door")))


def _sources(
    path: Path, files: Mapping[str, Any], ordinals: Mapping[str, int]
) -> dict[str, tuple[int, str, str]]:
    """Ordinal, id as imported, and category of each unit of a level, by its id in the archive."""
    found = {}
    for feature in _features(path, files, "unit"):
        ident, properties, ordinal = _placed(feature, ordinals)
        if ordinal is not None:
            category = str(properties.get("wayfuse:category") or properties.get("category"))
            found[ident] = (ordinal, str(properties.get("wayfuse:id") or ident), category)
    return found


def _build(
    ordinal: int, level: _Level, anchor: GeoAnchor, size: Array, language: str, has_ground: bool
) -> tuple[Floor, FloorReport] | None:
    import shapely

    notes = level.notes

    def metres(parts: Sequence[tuple[Array, ...]], what: str) -> list[Polygon]:
        drawn = [[anchor.to_xy(ring) for ring in rings] for rings in parts]
        return [polygon for rings in drawn for polygon in cleaned(rings, what, notes)]

    outline = metres(level.outline, f"level {level.name}")
    if not outline:
        return None
    units, closed, walled = [], [], []
    for properties, parts in level.units:
        category = str(properties.get("wayfuse:category") or properties.get("category") or "unspecified")
        kind = str(properties.get("category"))
        name, ident = _label(properties.get("name"), language), properties["id"]
        for polygon in metres(parts, f"unit {ident}"):
            units.append(Unit(str(properties.get("wayfuse:id") or ident), name, category, polygon))
            if properties.get("wayfuse:closed", kind in CLOSED) is True:
                closed.append(polygon)
            if properties.get("wayfuse:enclosed", kind not in OPEN) is True:
                walled.append(polygon)
    openings = [shapely.LineString(anchor.to_xy(line)) for _, line, _ in level.openings]
    gaps = [opening.buffer(OPENING_DEPTH, cap_style="flat") for opening in openings]
    drawn = [ring for polygon in [*outline, *(unit.polygon for unit in units)] for ring in polygon.rings]
    doors: list[Array] = []
    for (ident, _, mark), line, door in zip(level.openings, openings, chords(drawn, gaps), strict=True):
        if mark is True:
            doors.append(np.asarray(line.coords)[[0, -1]].ravel())
        elif mark is None and door is None:
            notes.add("door-on-no-wall", f"opening {ident}", "a door on no wall: it opens nothing")
        elif mark is None and door is not None:
            doors.append(door)
    floor = build_floor(
        level.name,
        ordinal,
        outline,
        units,
        walls=cut_walls([*outline, *walled], [], gaps),
        closed=closed,
        width=float(size[0]),
        height=float(size[1]),
        elevation=nominal_elevation(ordinal, has_ground=has_ground)
        if level.elevation is None
        else level.elevation,
        anchor=anchor,
        doors=np.array(doors).reshape(-1, 4),
    )
    return floor, FloorReport(floor.name, anchor_residual(anchor, size), tuple(notes))
