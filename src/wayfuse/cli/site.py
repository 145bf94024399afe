"""``wayfuse site``: import a building, draw its floors, check it, find ways through it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from wayfuse.cli.site_route import route_command
from wayfuse.cli.site_validate import validate_command
from wayfuse.maps.importers.catalogue import IMPORTERS, floor_rows, import_plan

if TYPE_CHECKING:
    from wayfuse.maps.importers.report import ImportReport
    from wayfuse.maps.site import Site

__all__ = ["site"]


@click.group(context_settings={"help_option_names": ["-h", "--help"]})
def site() -> None:
    """Import, check and draw buildings, and find ways through them."""


site.add_command(route_command)
site.add_command(validate_command)


@site.command("import")
@click.argument("plan_format", metavar="FORMAT", type=click.Choice(sorted(IMPORTERS)))
@click.argument("path", metavar="PATH", type=click.Path(path_type=Path))
@click.option("--out", required=True, type=click.Path(path_type=Path), help="Folder to write the site into.")
@click.option("--overwrite", is_flag=True, help="Replace a site that is there already.")
@click.option("--json", "as_json", is_flag=True, help="Print the floors as JSON.")
def import_command(plan_format: str, path: Path, out: Path, overwrite: bool, as_json: bool) -> None:
    """Build a site from the floor plans in PATH.

    FORMAT ms-indoor: PATH is a folder that holds one folder per floor (B1, F1, ...) with floor_info.json
    and geojson_map.json.

    FORMAT hcu: PATH is a folder with PlanEG.geojson, Plan1OG.geojson, ... of the HCU Hamburg data set.

    FORMAT image: PATH is a TOML or JSON file that names a picture of each floor, its width in metres or
    control points, and traced walls.

    FORMAT imdf: PATH is a ZIP archive of the Indoor Mapping Data Format 1.0.0.

    FORMAT ipin2023: PATH is the folder of GetSensorData logs of IPIN 2023 Track 3.

    FORMAT osm: PATH is a building of OpenStreetMap with Simple Indoor Tagging, .osm or .geojson.

    FORMAT simpleloc: PATH is the building.xml of a simpleLoc data set.
    """
    from wayfuse.maps.store import check_target

    check_target(out, overwrite)
    built, report = import_plan(plan_format, path)
    built.save(out, overwrite=overwrite)
    _render(built, report, out, as_json)


@site.command("show")
@click.argument("folder", metavar="SITE", type=click.Path(path_type=Path))
@click.option("--floor", "names", multiple=True, metavar="NAME", help="Only this floor; may be repeated.")
@click.option(
    "--out", type=click.Path(path_type=Path), help="Folder for the pictures (default: SITE/pictures)."
)
@click.option("--svg", is_flag=True, help="Write SVG instead of PNG.")
@click.option(
    "--graph", "with_graph", is_flag=True, help="Draw the cells of the building graph and its portals."
)
def show_command(folder: Path, names: tuple[str, ...], out: Path | None, svg: bool, with_graph: bool) -> None:
    """Draw each floor of SITE with its stairs and lifts, and print the paths of the pictures."""
    from wayfuse.evaluation.plot_connectors import draw_connectors
    from wayfuse.evaluation.plot_graph import draw_graph
    from wayfuse.evaluation.plot_site import floor_figure, save_figure
    from wayfuse.maps.graph import build_graph
    from wayfuse.maps.site import Site
    from wayfuse.maps.store import file_stems

    loaded = Site.load(folder)
    chosen = [loaded.floor_index(name) for name in names] or range(len(loaded.floors))
    target = out or folder / "pictures"
    _make_folder(target)
    stems = file_stems(loaded.floor_names)
    graph = build_graph(loaded) if with_graph else None
    for i in chosen:
        title = f"{loaded.name}  {loaded.floors[i].name}"
        path = target / f"{stems[i]}{'.svg' if svg else '.png'}"
        figure = floor_figure(loaded.floors[i], title)
        if graph is not None:
            draw_graph(figure.axes[0], graph, i)
        draw_connectors(figure.axes[0], loaded, i)
        click.echo(save_figure(figure, path))


def _make_folder(folder: Path) -> None:
    from wayfuse.core.errors import UsageError

    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UsageError(
            f"cannot make the folder: {error.strerror}", where=folder, remedy="name another"
        ) from error


def _render(built: Site, report: ImportReport, out: Path, as_json: bool) -> None:
    import json

    rows = floor_rows(built, report)
    if as_json:
        document = {"site": built.name, "path": str(out), "floors": rows, "warnings": list(report.warnings)}
        click.echo(json.dumps(document, indent=1, ensure_ascii=False))
        return
    heads = ("units", "walls", "doors", "connectors", "walkable")
    click.echo(
        f"{'floor':<8}{'level':>6}{'size (m)':>17}"
        + "".join(f"{h:>{len(h) + 2}}" for h in heads)
        + f"{'anchor off':>13}"
    )
    for row in rows:
        size = f"{row['width_m']:.1f} x {row['height_m']:.1f}"
        residual = row["anchor_residual_m"]
        off = "no anchor" if residual is None else f"{residual * 1000:.1f} mm"
        share = f"{100 * row['walkable_share']:.1f} %"
        counts = "".join(f"{row[head]:>{len(head) + 2}}" for head in heads[:-1])
        click.echo(f"{row['floor']:<8}{row['level']:>6}{size:>17}{counts}{share:>10}{off:>13}")
    for warning in report.warnings:
        click.echo(f"warning: {warning}", err=True)
    for row in rows:
        for warning in row["warnings"]:
            click.echo(f"warning: floor {row['floor']}: {warning}", err=True)
    click.echo(f"site {built.name} written to {out}")
