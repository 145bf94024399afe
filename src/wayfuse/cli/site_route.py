"""``wayfuse site route``: the quickest way between two places of a site, told and drawn."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from wayfuse.maps.graph import BuildingGraph
    from wayfuse.maps.route import Place, Ride, Route
    from wayfuse.maps.site import Site

__all__ = ["route_command"]

NEAR = 5.0  # m, a unit people do not walk in (a shop) is reached at the walkable place this near


@click.command("route", context_settings={"ignore_unknown_options": True})
@click.argument("folder", metavar="SITE", type=click.Path(path_type=Path))
@click.argument("start", metavar="A")
@click.argument("goal", metavar="B")
@click.option("--json", "as_json", is_flag=True, help="Print the route as JSON.")
@click.option("--out", type=click.Path(path_type=Path), help="Picture of the route (.png or .svg).")
@click.option("--geojson", type=click.Path(path_type=Path), help="Write the legs as GeoJSON (WGS84).")
def route_command(
    folder: Path, start: str, goal: str, as_json: bool, out: Path | None, geojson: Path | None
) -> None:
    """Print the quickest way from A to B in SITE.

    A and B are X,Y,FLOOR in metres of that floor, or the id or name of a unit (FLOOR/NAME where several floors have
    one).
    """
    import json

    from wayfuse.maps.graph import build_graph
    from wayfuse.maps.route import find_route
    from wayfuse.maps.site import Site

    site = Site.load(folder)
    graph = build_graph(site)
    route = find_route(site, graph, _place(site, graph, start), _place(site, graph, goal))
    if as_json:
        click.echo(json.dumps(_document(site, route), indent=1, ensure_ascii=False))
    else:
        _tell(site, route)
    if geojson is not None:
        _write(geojson, json.dumps(_geojson(site, route), ensure_ascii=False) + "\n")
    if out is not None:
        from wayfuse.evaluation.plot_graph import route_figure
        from wayfuse.evaluation.plot_site import save_figure

        if out.suffix not in (".png", ".svg"):
            raise click.BadParameter(f"{out} is neither .png nor .svg", param_hint="--out")
        picture = save_figure(route_figure(site, route, title=f"{site.name}: {start} to {goal}"), out)
        click.echo(picture, err=as_json)


def _place(site: Site, graph: BuildingGraph, text: str) -> Place:
    """Place that a user names."""
    from wayfuse.maps.route import Place

    parts = text.split(",", 2)
    if len(parts) == 3:
        try:
            x, y = float(parts[0]), float(parts[1])
        except ValueError:
            return _unit_place(site, graph, text)
        return Place(site.floor_index(parts[2].strip()), x, y)
    return _unit_place(site, graph, text)


def _unit_place(site: Site, graph: BuildingGraph, text: str) -> Place:
    from wayfuse.core.errors import UsageError

    wanted, only = text, None
    names = [name.casefold() for name in site.floor_names]
    head, slash, tail = text.partition("/")
    if slash and head.casefold() in names:
        wanted, only = tail, names.index(head.casefold())
    found = [
        (k, unit.id)
        for k, floor in enumerate(site.floors)
        for unit in floor.units
        if only in (None, k) and wanted.casefold() in (unit.id.casefold(), unit.name.casefold())
    ]
    found = list(dict.fromkeys(found))
    if not found and only is not None:
        wanted, only = text, None  # an id may hold a slash: way/123
        found = [(k, u.id) for k, floor in enumerate(site.floors) for u in floor.units if u.id == text]
        found = list(dict.fromkeys(found))
    if not found:
        raise UsageError(
            f"no unit has the id or name {text!r}",
            where=site.name,
            remedy="give X,Y,FLOOR, or look for names with `wayfuse site show`",
        )
    if len(found) > 1:
        where = ", ".join(f"{site.floors[k].name}/{ident}" for k, ident in found[:6])
        raise UsageError(f"{len(found)} units are called {text!r}", where=site.name, remedy=f"one of {where}")
    return _in_unit(site, graph, *found[0])


def _in_unit(site: Site, graph: BuildingGraph, floor: int, ident: str) -> Place:
    """Middle of a unit, or else of its largest cell, or else (nobody walks in it) the nearest walkable place."""
    import numpy as np
    import shapely

    from wayfuse.core.errors import UsageError
    from wayfuse.maps.route import Place

    storey = site.floors[floor]
    numbers = [i for i, unit in enumerate(storey.units) if unit.id == ident]
    cells = np.nonzero((graph.cell_floor == floor) & np.isin(graph.cell_unit, numbers))[0]
    shape = shapely.union_all([shapely.Polygon(storey.units[i].polygon.exterior) for i in numbers])
    if graph.areas[cells].sum() > 0.5 * shape.area:
        largest = shapely.Polygon(graph.polygon(int(cells[np.argmax(graph.areas[cells])])))
        middles = [shapely.centroid(shape), shapely.centroid(largest)]
        inside = graph.cell_of(floor, [[middle.x, middle.y] for middle in middles])
        spot = middles[0] if inside[0] in cells else middles[1]
        return Place(floor, float(spot.x), float(spot.y))
    centres = storey.walkable.centres()
    centres = centres[graph.cell_of(floor, centres) >= 0]
    away = shapely.distance(shape, shapely.points(centres)) if len(centres) else np.array([np.inf])
    if float(away.min()) > NEAR:
        raise UsageError(
            f"nothing walkable lies in or near unit {ident}", where=site.name, remedy="give X,Y,FLOOR"
        )
    close = centres[away <= away.min() + 0.5]
    spot = shapely.centroid(shape)
    x, y = close[np.argmin(np.hypot(close[:, 0] - spot.x, close[:, 1] - spot.y))].tolist()
    return Place(floor, x, y)


def _ride_text(site: Site, ride: Ride) -> str:
    way = "up" if ride.end > ride.start else "down"
    steps = f", {ride.steps} steps" if ride.steps else ""
    name = ride.connector.name or ride.connector.id
    kind = "" if name.startswith(ride.connector.kind) else f"{ride.connector.kind} "
    return f"{kind}{name} {way} to floor {site.floors[ride.end].name}{steps}"


def _tell(site: Site, route: Route) -> None:
    from wayfuse.maps.route import Leg

    for part in route.parts:
        if isinstance(part, Leg):
            (x0, y0), (x1, y1) = part.path[0], part.path[-1]
            where = f"floor {site.floors[part.floor].name}: walk from ({x0:.1f}, {y0:.1f}) to ({x1:.1f}, {y1:.1f})"
            click.echo(f"{where}, {part.length:.1f} m, {part.seconds:.0f} s")
        else:
            click.echo(f"  {_ride_text(site, part)}, {part.seconds:.0f} s")
    click.echo(f"{route.length:.1f} m on foot, {route.seconds:.0f} s in all")


def _document(site: Site, route: Route) -> dict[str, Any]:
    from wayfuse.maps.route import Leg

    parts: list[dict[str, Any]] = []
    for part in route.parts:
        if isinstance(part, Leg):
            parts.append(
                {
                    "floor": site.floors[part.floor].name,
                    "length_m": round(part.length, 3),
                    "seconds": round(part.seconds, 2),
                    "path_m": part.path.round(3).tolist(),
                }
            )
        else:
            parts.append(
                {
                    "connector": part.connector.id,
                    "kind": part.connector.kind.value,
                    "name": part.connector.name,
                    "from": site.floors[part.start].name,
                    "to": site.floors[part.end].name,
                    "steps": part.steps or None,
                    "seconds": round(part.seconds, 2),
                }
            )
    total = {"length_m": round(route.length, 3), "seconds": round(route.seconds, 2)}
    return {"site": site.name, **total, "parts": parts}


def _geojson(site: Site, route: Route) -> dict[str, Any]:
    from wayfuse.maps.route import Leg

    features = []
    for part in route.parts:
        if isinstance(part, Leg):
            floor = site.floors[part.floor]
            features.append(
                {
                    "type": "Feature",
                    "properties": {"floor": floor.name, "length_m": round(part.length, 3)},
                    "geometry": {
                        "type": "LineString",
                        "coordinates": floor.to_lonlat(part.path).round(9).tolist(),
                    },
                }
            )
    return {"type": "FeatureCollection", "features": features}


def _write(path: Path, text: str) -> None:
    from wayfuse.core.errors import UsageError

    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise UsageError(f"cannot write: {error.strerror}", where=path, remedy="name another file") from error
