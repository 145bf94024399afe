"""Import the floors of the HCU Hamburg data set: GeoJSON areas in UTM metres, one file per floor.

`DIR/PlanEG.geojson`, `Plan1OG.geojson`, ...: every polygon has a `Type`, spelled as the draughtsman liked. Walls are
areas; rooms, corridors, doors and stairs fill the space between them and are walked in. The frame is UTM less the
south-west corner of the building (`provenance.origin`), so that waypoints of the set, which are UTM too, need only a
shift. UTM metres are up to 0.04 % short of true ones.

Stairs and lifts are drawn floor by floor and joined where they overlap (`joining`). A lift shaft is plumb: an area of
another floor with the outline of a lift is that lift, whatever its `Type` (the lift to the 4th floor is drawn as a
room on the floors below).
"""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from wayfuse.core.errors import MapError
from wayfuse.core.frames import GeoAnchor
from wayfuse.core.types import Array
from wayfuse.core.utm import utm_to_lonlat
from wayfuse.maps.build import build_floor, nominal_elevation
from wayfuse.maps.connectors import ConnectorKind
from wayfuse.maps.geometry import edges, free_space, from_shapely
from wayfuse.maps.importers.joining import KINDS, Piece, join_pieces
from wayfuse.maps.importers.plan_file import parse_json, read_limited
from wayfuse.maps.importers.report import FloorReport, ImportReport, Notes
from wayfuse.maps.importers.rooms import cleaned, outline_of, to_shapely
from wayfuse.maps.problems import KEY, problems_text
from wayfuse.maps.site import Floor, Polygon, Site, Unit
from wayfuse.maps.walls import LARGEST

__all__ = ["import_site", "level_of"]

CATEGORIES = {
    "balcony": "balcony",
    "bdoor": "door",
    "corridor": "corridor",
    "door": "door",
    "elevator": "elevator",
    "fassade": "wall",
    "furniture": "furniture",
    "furnitures": "furniture",
    "gallery": "corridor",
    "lift": "elevator",
    "nans": "void",
    "room": "room",
    "rooms": "room",
    "staircase": "stairs",
    "stairs": "stairs",
    "stairscase": "stairs",
    "wa": "wall",
    "wall": "wall",
}  # of the types in the files, letters only
CLOSED = ("wall", "furniture", "void")  # nobody walks in these
UNNAMED = ("wall", "door")  # drawn as walls and the gaps between them, not as units
PLUMB = 0.9  # of the union of two areas they must share to be the same shaft
SEAM = 0.05  # m, neighbouring areas may be drawn this far apart
_CRS = re.compile(r"EPSG:+32([67])(\d\d)$")


@dataclass(slots=True)
class _Plan:
    """Areas of one file: category and rings (UTM m) of each."""

    path: Path
    level: int
    zone: tuple[int, bool]
    areas: list[tuple[str, str, list[Array]]] = field(default_factory=list)
    notes: Notes = field(default_factory=Notes)


def level_of(name: str) -> int | None:
    """Level of a German floor name: EG is 0, 4OG is 4, 2UG is -2; None where it does not say.

    >>> level_of("EG"), level_of("4OG"), level_of("UG"), level_of("Dach")
    (0, 4, -1, None)
    """
    found = re.fullmatch(r"(\d{0,3})(EG|OG|UG)", name.upper())
    if found is None or (found[2] == "EG" and found[1]):
        return None
    return {"EG": 0, "OG": 1, "UG": -1}[found[2]] * int(found[1] or 1)


def import_site(folder: Path) -> tuple[Site, ImportReport]:
    """Site of a folder with Plan*.geojson (or of the data set's folder above it), and what was met.

    Raises
    ------
    MapError : there is no plan, or a plan cannot be read or is not in UTM metres.
    """
    folder = Path(folder)
    paths = sorted(folder.glob("Plan*.geojson")) or sorted((folder / "MapMaterial").glob("Plan*.geojson"))
    if not paths:
        raise MapError(
            "holds no Plan*.geojson", where=folder, remedy="name the folder with PlanEG.geojson, ..."
        )
    plans = sorted((_read(path) for path in paths), key=lambda plan: plan.level)
    if len({plan.zone for plan in plans}) > 1:
        raise MapError("floors lie in different UTM zones", where=folder, remedy="export all in one")
    points = np.concatenate([rings[0] for plan in plans for _, _, rings in plan.areas])
    corner, size = points.min(axis=0), np.ptp(points, axis=0)
    if float(size.max()) > LARGEST:
        raise MapError(f"spans more than {LARGEST:.0f} m", where=folder, remedy="mend the outliers")
    if float(size.min()) <= 0.0:
        raise MapError("its areas enclose nothing", where=folder, remedy="fetch the data anew")
    zone, south = plans[0].zone
    ends = corner + np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]]) * size
    origin, east, north, far = utm_to_lonlat(ends, zone, south=south)
    across, along = (east - origin) / size[0], (north - origin) / size[1]
    anchor = GeoAnchor(
        (float(origin[0]), float(origin[1])),
        ((float(across[0]), float(along[0])), (float(across[1]), float(along[1]))),
    )
    residual = float(np.max(np.abs(anchor.to_xy(far) - size)))
    has_ground = any(plan.level == 0 for plan in plans)
    floors = [
        _floor(plan, corner, size, anchor, nominal_elevation(plan.level, has_ground=has_ground))
        for plan in plans
    ]
    notes = Notes()
    connectors = join_pieces(floors, _pieces(floors), notes)
    problems = [problem for plan in plans for problem in plan.notes.problems] + notes.problems
    provenance = {
        "importer": "hcu",
        "source": ", ".join(plan.path.name for plan in plans),
        "frame": f"UTM zone {zone}{'S' if south else 'N'} less origin, m",
        "origin": f"{corner[0]:.3f} {corner[1]:.3f}",
        KEY: problems_text(problems),
    }
    site = Site(folder.resolve().name, tuple(floors), provenance, connectors)
    reports = [FloorReport(f.name, residual, tuple(p.notes)) for f, p in zip(floors, plans, strict=True)]
    return site, ImportReport(tuple(reports), tuple(notes))


def _pieces(floors: list[Floor]) -> list[Piece]:
    """Stairs and lifts of all floors, and the areas of other floors that a lift shaft passes through."""
    shapes = [[(unit, to_shapely([unit.polygon])) for unit in floor.units] for floor in floors]
    found = [
        Piece(f"{floors[k].name}/{unit.id}", KINDS[unit.category], shape, (k,))
        for k, drawn in enumerate(shapes)
        for unit, shape in drawn
        if unit.category in KINDS
    ]
    lifts = [piece for piece in found if piece.kind is ConnectorKind.LIFT]
    for k, drawn in enumerate(shapes):
        for unit, shape in drawn:
            if unit.category not in KINDS and any(_is_same(shape, lift.shape) for lift in lifts):
                found.append(Piece(f"{floors[k].name}/{unit.id}", ConnectorKind.LIFT, shape, (k,)))
    return found


def _is_same(a: Any, b: Any) -> bool:
    return bool(a.intersects(b) and a.intersection(b).area > PLUMB * a.union(b).area)


def _read(path: Path) -> _Plan:
    name = path.stem.removeprefix("Plan")
    level = level_of(name)
    if level is None:
        raise MapError(f"floor name {name!r} does not say its level", where=path, remedy="EG, 1OG, 1UG, ...")
    document = parse_json(read_limited(path), path)
    features = document.get("features") if isinstance(document, dict) else None
    if not isinstance(features, list):
        raise MapError("is not a FeatureCollection", where=path, remedy="fetch the data anew")
    plan = _Plan(path, level, _zone(path, document), notes=Notes(name))
    skipped: Counter[str] = Counter()
    for number, feature in enumerate(features):
        kind = _type(feature)
        category = CATEGORIES.get(re.sub("[^a-z]", "", kind.casefold()))
        drawn = _rings(feature)
        if category is None or not drawn:
            skipped["no polygon" if not drawn else f"type {kind or 'missing'}"] += 1
            continue
        plan.areas += [(str(number), category, rings) for rings in drawn]
    plan.notes += [f"{count} areas left out: {why}" for why, count in sorted(skipped.items())]
    if not plan.areas:
        raise MapError("holds no area of a known Type", where=path, remedy="fetch the data anew")
    return plan


def _zone(path: Path, document: dict[str, Any]) -> tuple[int, bool]:
    try:
        found = _CRS.search(str(document["crs"]["properties"]["name"]))
    except (KeyError, TypeError):
        found = None
    if found is None or not 1 <= int(found[2]) <= 60:
        raise MapError("its crs is not UTM (EPSG:326xx)", where=path, remedy="export it in UTM metres")
    return int(found[2]), found[1] == "7"


def _type(feature: Any) -> str:
    held = feature.get("properties") if isinstance(feature, dict) else None
    return str(held.get("Type") or "") if isinstance(held, dict) else ""


def _rings(feature: Any) -> list[list[Array]]:
    """Rings (m) of each polygon of a feature, empty where it has none or they are no UTM metres."""
    try:
        geometry = feature["geometry"]
        drawn = geometry["coordinates"]
        parts = {"Polygon": [drawn], "MultiPolygon": drawn}[geometry["type"]]
        found = [[np.array([p[:2] for p in ring], dtype=np.float64) for ring in part] for part in parts]
    except (KeyError, TypeError, ValueError, IndexError, OverflowError):
        return []
    sound = all(
        part
        and all(ring.ndim == 2 and ring.shape[1] == 2 and bool(np.all(np.abs(ring) < 1e7)) for ring in part)
        for part in found
    )
    return found if sound else []


def _floor(plan: _Plan, corner: Array, size: Array, anchor: GeoAnchor, elevation: float) -> Floor:
    name = plan.path.stem.removeprefix("Plan")
    units: list[Unit] = []
    closed: list[Polygon] = []
    drawn: list[Polygon] = []
    doors: list[Array] = []
    for ident, category, rings in plan.areas:
        for polygon in cleaned([ring - corner for ring in rings], f"area {ident} ({category})", plan.notes):
            drawn.append(polygon)
            if category in CLOSED:
                closed.append(polygon)
            if category == "door":
                doors.append(_across(polygon))
            if category not in UNNAMED:
                units.append(Unit(ident, "", category, polygon))
    outline = outline_of(drawn, SEAM)
    if not outline:
        raise MapError("its areas enclose nothing", where=plan.path, remedy="fetch the data anew")
    free = free_space(outline, closed, widening=0.0)
    apart = sorted(part.area for part in from_shapely(free))[:-1]
    if apart:
        plan.notes.append(f"{len(apart)} parts ({sum(apart):.0f} m2) have no door to the largest")
    return build_floor(
        name,
        plan.level,
        outline,
        units,
        walls=edges(free),
        closed=closed,
        width=float(size[0]),
        height=float(size[1]),
        elevation=elevation,
        anchor=anchor,
        doors=np.array(doors).reshape(-1, 4),
    )


def _across(door: Polygon) -> Array:
    """Clear width (4,) m of a door drawn as an area: the longer middle line of its smallest rectangle."""
    import shapely

    corners = shapely.get_coordinates(shapely.minimum_rotated_rectangle(to_shapely([door])))
    middles = 0.5 * (corners[:-1] + corners[1:])
    lines = np.hstack([middles[:2], middles[2:]])
    return np.asarray(lines[np.argmax(np.hypot(lines[:, 2] - lines[:, 0], lines[:, 3] - lines[:, 1]))])
