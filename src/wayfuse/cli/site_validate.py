"""``wayfuse site validate``: name what is wrong with a site."""

from __future__ import annotations

from pathlib import Path

import click

__all__ = ["validate_command"]


@click.command("validate")
@click.argument("folder", metavar="SITE", type=click.Path(path_type=Path))
@click.option("--json", "as_json", is_flag=True, help="Print the problems as JSON.")
def validate_command(folder: Path, as_json: bool) -> None:
    """Name every problem of SITE with the id of its feature: what nobody can reach, doors on no wall, stairs to
    nowhere, crossing polygons, repeated ids.

    Ends with 1 where there are errors. Warnings, among them what the importer has repaired already, do not count.
    """
    import json

    from wayfuse.maps.problems import Severity
    from wayfuse.maps.site import Site
    from wayfuse.maps.validate import validate_site

    site = Site.load(folder)
    problems = validate_site(site)
    errors = sum(problem.severity is Severity.ERROR for problem in problems)
    if as_json:
        document = {
            "site": site.name,
            "errors": errors,
            "warnings": len(problems) - errors,
            "problems": [problem._asdict() for problem in problems],
        }
        click.echo(json.dumps(document, indent=1, ensure_ascii=False))
    else:
        for problem in problems:
            click.echo(str(problem))
        click.echo(f"site {site.name}: {errors} errors, {len(problems) - errors} warnings")
    if errors:
        raise SystemExit(1)
