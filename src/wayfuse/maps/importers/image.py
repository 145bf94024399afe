"""Import pictures of floor plans with a scale and traced walls, described by a TOML or JSON file beside them.

```toml
name = "office"
[[floors]]
name = "F1"                       # says the level, unless `level` does
image = "f1.png"                  # PNG or JPEG, beside this file
width_m = 42.0                    # of the whole picture; or control points
control = [{ pixel = [10, 20], lonlat = [13.1, 51.2] }, { pixel = [800, 20], lonlat = [13.2, 51.2] }]
outline = [[0, 0], [900, 0], [900, 500], [0, 500]]       # pixels; without it the whole picture
walls = [[[100, 0], [100, 200]], [[100, 240], [100, 500]]]   # lines of pixels; leave doors open
doors = [[[300, 100], [330, 100]]]                           # or draw walls through and doors on them

[[connectors]]
id = "main stairs"
kind = "stairs"                   # stairs, lift, escalator or ramp
landings = [{ floor = "F1", pixel = [700, 90] }, { floor = "F2", pixel = [705, 120] }]
n_steps = [24]                    # between each landing and the next; may be left out
direction = 0                     # 1 up only, -1 down only
footprint = [[690, 80], [740, 80], [740, 130], [690, 130]]   # pixels of the lowest floor; may be left out
```
Pixels count right and down from the upper left corner, as drawing programs show them; the floor's frame is metres
right and up from the lower left corner. Two or more control points fix scale, turn and place on the earth by the
similarity that fits them best; its worst misfit is the residual of the floor.
"""

from __future__ import annotations

import struct
import tomllib
from pathlib import Path
from typing import Any

import numpy as np

from wayfuse.core.errors import MapError
from wayfuse.core.frames import GeoAnchor
from wayfuse.core.types import Array
from wayfuse.maps.build import build_floor, nominal_elevation
from wayfuse.maps.connector_entries import read_connector
from wayfuse.maps.connectors import Connector
from wayfuse.maps.importers.plan_file import parse_json, read_limited
from wayfuse.maps.importers.report import FloorReport, ImportReport, Notes
from wayfuse.maps.importers.rooms import chords, cleaned, cut_walls
from wayfuse.maps.levels import parse_level
from wayfuse.maps.problems import KEY, Problem, problems_text
from wayfuse.maps.site import Floor, Site
from wayfuse.maps.walls import LARGEST

__all__ = ["image_size", "import_site"]

MISFIT_LIMIT = 1.0  # m, control points further off are reported
DOOR_DEPTH = 0.1  # m, a door opens walls this near its line
SCALE_LIMIT = 0.02  # share by which width_m and control points may disagree


def import_site(path: Path) -> tuple[Site, ImportReport]:
    """Site of a description, and what was met on the way.

    Raises
    ------
    MapError : description or picture cannot be read, or a field is missing or wrong; names floor and field.
    """
    path = Path(path)
    document = _document(path)
    entries = document.get("floors") if isinstance(document, dict) else None
    if not isinstance(entries, list) or not entries or not all(isinstance(e, dict) for e in entries):
        raise MapError("has no floors", where=path, remedy="add [[floors]] with name, image and width_m")
    levels = [_level(path, entry) for entry in entries]
    built = []
    problems: list[Problem] = []
    for level, i in sorted((level, i) for i, level in enumerate(levels)):
        elevation = nominal_elevation(level, has_ground=0 in levels)
        notes = Notes(str(entries[i]["name"]))
        built.append(_floor(path, entries[i], level, elevation, notes))
        problems += notes.problems
    name = document.get("name", path.stem)
    provenance = {
        "importer": "image",
        "source": path.name,
        "images": ", ".join(str(entry["image"]) for entry in entries),
        "frame": "metres right and up from the lower left corner of each picture",
        KEY: problems_text(problems),
    }
    floors = tuple(floor for floor, _, _ in built)
    rows = {floor.name: (scale, floor.height) for floor, _, scale in built}
    site = Site(str(name), floors, provenance, _connectors(path, document, rows))
    return site, ImportReport(tuple(report for _, report, _ in built))


def _connectors(
    path: Path, document: dict[str, Any], frames: dict[str, tuple[float, float]]
) -> tuple[Connector, ...]:
    """Connectors of a description; ``frames`` holds metres per pixel and height (m) of each floor, bottom up."""
    entries = document.get("connectors", [])
    if not isinstance(entries, list):
        raise MapError("connectors is no list", where=path, remedy="write [[connectors]]")
    found = []
    for entry in entries:
        try:
            found.append(read_connector(_in_metres(entry, frames), list(frames)))
        except MapError as error:
            raise MapError(error.what, where=path, remedy=error.remedy) from error
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            ident = entry.get("id", "?") if isinstance(entry, dict) else "?"
            raise MapError(
                f"connector {ident}: {error!r}",
                where=path,
                remedy="landings are { floor = NAME, pixel = [x, y] }, footprint a list of [x, y]",
            ) from error
    return tuple(found)


def _in_metres(entry: dict[str, Any], frames: dict[str, tuple[float, float]]) -> dict[str, Any]:
    """Entry of a connector with its pixels in metres."""

    def place(floor: str, pixel: Any) -> tuple[float, float]:
        scale, height = frames[floor]
        return float(pixel[0]) * scale, height - float(pixel[1]) * scale

    landings = sorted(entry["landings"], key=lambda at: list(frames).index(at["floor"]))
    places = [(at["floor"], *place(at["floor"], at["pixel"])) for at in landings]
    ring = entry.get("footprint")
    return {
        **entry,
        "landings": [{"floor": floor, "x": x, "y": y} for floor, x, y in places],
        "footprint": None if ring is None else [place(places[0][0], pixel) for pixel in ring],
    }


def _document(path: Path) -> Any:
    content = read_limited(path)
    if path.suffix.casefold() == ".json":
        return parse_json(content, path)
    if path.suffix.casefold() != ".toml":
        raise MapError("neither .toml nor .json", where=path, remedy="describe the pictures in such a file")
    try:
        return tomllib.loads(content.decode("utf-8-sig"))
    except (ValueError, RecursionError) as error:
        raise MapError(f"is not TOML: {error}", where=path, remedy="mend the description") from error


def _wrong(path: Path, entry: dict[str, Any], what: str, remedy: str) -> MapError:
    return MapError(f"floor {entry.get('name', '?')}: {what}", where=path, remedy=remedy)


def _level(path: Path, entry: dict[str, Any]) -> int:
    name, level = entry.get("name"), entry.get("level")
    if not isinstance(name, str) or not name:
        raise _wrong(path, entry, "has no name", 'add name = "F1"')
    found = parse_level(name) if level is None else level
    if not isinstance(found, int) or isinstance(found, bool) or abs(found) > 200:
        raise _wrong(path, entry, "its level is not known", "add level = 1")
    return found


def _floor(
    path: Path, entry: dict[str, Any], level: int, elevation: float, notes: Notes
) -> tuple[Floor, FloorReport, float]:
    """Floor, report, and metres per pixel."""
    image = entry.get("image")
    if not isinstance(image, str) or Path(image).name != image:
        raise _wrong(path, entry, f"image {image!r} is no file name", "put the picture beside this file")
    columns, rows = image_size(path.parent / image)
    scale, anchor, residual = _frame(path, entry, columns, rows, notes)
    if max(columns, rows) * scale > LARGEST:
        raise _wrong(path, entry, f"is wider than {LARGEST:.0f} m", "mend width_m or control")

    def metres(points: Any, field: str) -> Array:
        pixels = _pixels(points)
        if pixels is None:
            raise _wrong(path, entry, f"{field} holds no points", "give pixels as [[x, y], [x, y], ...]")
        inside = np.all((pixels >= -0.5) & (pixels <= (columns + 0.5, rows + 0.5)))
        if not inside:
            raise _wrong(path, entry, f"{field} leaves the picture", f"it has {columns} x {rows} pixels")
        return np.column_stack([pixels[:, 0], rows - pixels[:, 1]]) * scale

    whole = [[0, 0], [columns, 0], [columns, rows], [0, rows]]
    outline = cleaned([metres(entry.get("outline", whole), "outline")], "outline", notes)
    traced, opened = entry.get("walls", []), entry.get("doors", [])
    if not outline:
        raise _wrong(path, entry, "outline encloses nothing", "trace it anew")
    for key, drawn in (("walls", traced), ("doors", opened)):
        if not isinstance(drawn, list):
            raise _wrong(path, entry, f"{key} is no list", "give lines of pixels")
    walls = [metres(wall, f"wall {i}") for i, wall in enumerate(traced, 1)]
    gaps = [_gap(metres(door, f"door {i}")) for i, door in enumerate(opened, 1)]
    doors = chords([*walls, *(ring for polygon in outline for ring in polygon.rings)], gaps)
    for i, door in enumerate(doors, 1):
        if door is None:
            notes.add("door-on-no-wall", f"door {i}", "a door on no wall: it opens nothing")
    floor = build_floor(
        entry["name"],
        level,
        outline,
        walls=cut_walls(outline, walls, gaps),
        closed=[],
        width=columns * scale,
        height=rows * scale,
        elevation=elevation,
        anchor=anchor,
        doors=np.array([door for door in doors if door is not None]).reshape(-1, 4),
    )
    return floor, FloorReport(floor.name, residual, tuple(notes)), scale


def _gap(door: Array) -> Any:
    """Area a door opens in the walls."""
    import shapely

    return shapely.LineString(door).buffer(DOOR_DEPTH, cap_style="flat")


def _frame(
    path: Path, entry: dict[str, Any], columns: int, rows: int, warnings: list[str]
) -> tuple[float, GeoAnchor | None, float | None]:
    """Metres per pixel, anchor and residual (m) of a picture."""
    width, control = entry.get("width_m"), entry.get("control")
    if width is not None and not (_is_number(width) and 0.0 < width < 1e6):
        raise _wrong(path, entry, f"width_m {width!r} is no width", "metres, above 0")
    if control is None:
        if width is None:
            raise _wrong(path, entry, "has neither width_m nor control", "add width_m = 42.0")
        return float(width) / columns, None, None
    points = control if isinstance(control, list) else []
    tables = [c if isinstance(c, dict) else {} for c in points]
    pixels, lonlat = _pixels([c.get("pixel") for c in tables]), _pixels([c.get("lonlat") for c in tables])
    if pixels is None or lonlat is None or np.any(np.abs(lonlat) > (180.0, 89.0)):
        raise _wrong(
            path,
            entry,
            "control needs two or more points",
            "give { pixel = [x, y], lonlat = [lon, lat] } of each",
        )
    fit = _similarity(np.column_stack([pixels[:, 0], rows - pixels[:, 1]]), lonlat)
    if fit is None:
        raise _wrong(path, entry, "control points coincide", "take points far apart")
    scale, anchor, residual = fit
    if residual > MISFIT_LIMIT:
        warnings.append(f"control points are off by up to {residual:.1f} m")
    if width is not None and abs(columns * scale / width - 1.0) > SCALE_LIMIT:
        warnings.append(f"control points make it {columns * scale:.1f} m wide, width_m says {width:g} m")
    return scale, anchor, residual


def _similarity(pixels: Array, lonlat: Array) -> tuple[float, GeoAnchor, float] | None:
    """Least-squares similarity of pixels (y up) to degrees: metres per pixel, anchor, worst misfit (m)."""
    local = GeoAnchor.from_origin(*(float(v) for v in lonlat.mean(axis=0)))
    east_north = local.to_xy(lonlat)
    # In complex numbers a similarity is z = a p + b, and least squares gives a at once.
    p, z = pixels @ (1.0, 1.0j), east_north @ (1.0, 1.0j)
    spread = float(np.sum(np.abs(p - p.mean()) ** 2))
    a = np.sum(np.conj(p - p.mean()) * (z - z.mean())) / spread if spread > 0.0 else 0.0
    scale = float(np.abs(a))
    if scale < 1e-6:
        return None
    b = z.mean() - a * p.mean()
    lon, lat = local.to_lonlat([b.real, b.imag])
    anchor = GeoAnchor.from_origin(float(lon), float(lat), float(np.angle(a)))
    return scale, anchor, float(np.max(np.abs(a * p + b - z)))


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _pixels(points: Any) -> Array | None:
    """(k, 2) of two or more points, None where they are not."""
    pairs = points if isinstance(points, list) else []
    sound = all(isinstance(p, list) and len(p) == 2 and all(_is_number(v) for v in p) for p in pairs)
    if not sound or len(pairs) < 2:
        return None
    try:
        found = np.array(pairs, dtype=np.float64)
    except OverflowError:
        return None
    return found if bool(np.all(np.isfinite(found))) else None


def image_size(path: Path) -> tuple[int, int]:
    """Width and height in pixels of a PNG or JPEG file, read from its header.

    Raises
    ------
    MapError : the file cannot be read, or is neither.
    """
    content = read_limited(path)
    size = _png_size(content) if content.startswith(b"\x89PNG\r\n\x1a\n") else _jpeg_size(content)
    if size is None or min(size) < 1:
        raise MapError("is no PNG or JPEG picture", where=path, remedy="convert the plan to PNG")
    return size


def _png_size(content: bytes) -> tuple[int, int] | None:
    if content[12:16] != b"IHDR" or len(content) < 24:
        return None
    width, height = struct.unpack(">II", content[16:24])
    return width, height


def _jpeg_size(content: bytes) -> tuple[int, int] | None:
    """Size in the first frame header (SOF0-15, but not DHT, JPG and DAC, which lie between)."""
    at = 2
    while content.startswith(b"\xff\xd8") and at + 9 <= len(content) and content[at] == 0xFF:
        marker = content[at + 1]
        if 0xC0 <= marker <= 0xCF and marker not in (0xC4, 0xC8, 0xCC):
            height, width = struct.unpack(">HH", content[at + 5 : at + 9])
            return width, height
        at += 2 + struct.unpack(">H", content[at + 2 : at + 4])[0]
    return None
