"""``wayfuse datasets``: list, fetch and verify the public data sets."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from wayfuse.formats.fetching import Outcome

__all__ = ["datasets"]

_JSON = click.option("--json", "as_json", is_flag=True, help="Write JSON for machines.")
_SHOWN = 10  # paths of a kind printed one by one


@click.group()
def datasets() -> None:
    """List, fetch and verify public data sets.

    They lie under $WAYFUSE_DATA, by default ~/.cache/wayfuse-data. Their licences are their authors'.
    """


@datasets.command("list")
@_JSON
def list_(as_json: bool) -> None:
    """Show the data sets: origin, licence, size and whether they are here."""
    from wayfuse.formats.datasets import CATALOGUE, data_root, manifest

    root = data_root()
    rows = []
    for data in CATALOGUE.values():
        entries = manifest(data.name)
        here = sum((root / data.name / e.path).is_file() for e in entries)
        rows.append(
            {
                "name": data.name,
                "title": data.title,
                "origin": data.origin,
                "licence": data.licence,
                "citation": data.citation,
                "files": len(entries),
                "bytes": sum(e.size for e in entries),
                "here": here,
                "without_address": sum(not e.url for e in entries),
                "remark": data.remark,
            }
        )
    if as_json:
        click.echo(json.dumps({"root": str(root), "datasets": rows}, indent=2, ensure_ascii=False))
        return
    click.echo(f"data root: {root}")
    for row in rows:
        state = "here" if row["here"] == row["files"] else f"{row['here']} of {row['files']} files here"
        click.echo(
            f"\n{row['name']}  ({_megabytes(sum(e.size for e in manifest(str(row['name']))))}, {state})"
        )
        click.echo(f"  {row['title']}")
        click.echo(f"  {row['origin']}  licence: {row['licence']}")
        if row["remark"]:
            click.echo(f"  {row['remark']}")


@datasets.command()
@click.argument("name")
@click.option(
    "--from",
    "source",
    type=click.Path(path_type=Path),
    help="Copy from a local folder: the data set, a data root or a clone of its repository.",
)
@click.option(
    "--mirror", default="", help="Download from this address, which has the layout of the data root."
)
@_JSON
@click.pass_context
def fetch(context: click.Context, name: str, source: Path | None, mirror: str, as_json: bool) -> None:
    """Bring a data set here; an interrupted download goes on where it stopped."""
    from wayfuse.core.errors import UsageError
    from wayfuse.formats import fetching
    from wayfuse.formats.datasets import data_root, find, manifest

    data, root = find(name), data_root()
    if source is not None and mirror:
        raise UsageError(
            "--from and --mirror exclude each other", where="datasets fetch", remedy="give one of them"
        )
    total = sum(e.size for e in manifest(name))
    with _bar(total, f"{name} ({_megabytes(total)})", hidden=as_json) as update:
        if source is not None:
            outcome = fetching.copy(name, root, source, progress=update)
        else:
            outcome = fetching.fetch(name, root, mirror=mirror, progress=update)
    if as_json:
        fields = {f: getattr(outcome, f) for f in ("brought", "present", "failed", "without_address")}
        click.echo(json.dumps({"name": name, "root": str(root), **fields}, indent=2, ensure_ascii=False))
    else:
        _tell(outcome, data.remark)
        click.echo(f"licence: {data.licence}; cite: {data.citation}")
    if outcome.failed:
        context.exit(1)


@datasets.command()
@click.argument("names", nargs=-1, metavar="[NAME]...")
@_JSON
@click.pass_context
def verify(context: click.Context, names: tuple[str, ...], as_json: bool) -> None:
    """Check the local copies against their checksums (by default of all sets that are here).

    The exit status is 1 if a file is missing or differs.
    """
    from wayfuse.core.errors import DataMissingError
    from wayfuse.formats import datasets as sets

    root = sets.data_root()
    chosen = names or tuple(n for n in sets.CATALOGUE if (root / n).is_dir())
    if not chosen:
        raise DataMissingError("no data set is here", where=root, remedy="wayfuse datasets fetch NAME")
    checks = {}
    for name in chosen:
        total = sum(e.size for e in sets.manifest(name))
        with _bar(total, name, hidden=as_json) as update:
            checks[name] = sets.verify(name, root, update)
    if as_json:
        report = {
            n: {"good": c.n_good, "missing": c.missing, "changed": c.changed} for n, c in checks.items()
        }
        click.echo(json.dumps({"root": str(root), "datasets": report}, indent=2, ensure_ascii=False))
    else:
        for name, check in checks.items():
            click.echo(
                f"{name}: {check.n_good} good, {len(check.missing)} missing, {len(check.changed)} changed"
            )
            _paths("missing", check.missing)
            _paths("changed", check.changed)
    if not all(check.is_whole for check in checks.values()):
        context.exit(1)


def _tell(outcome: Outcome, remark: str) -> None:
    click.echo(f"{len(outcome.brought)} files brought, {len(outcome.present)} were here")
    _paths("failed", [f"{path}: {reason}" for path, reason in outcome.failed.items()])
    _paths("no public address", outcome.without_address)
    if outcome.without_address and remark:
        click.echo(f"  {remark}")


def _paths(what: str, paths: list[str]) -> None:
    for path in paths[:_SHOWN]:
        click.echo(f"  {what}: {path}")
    if len(paths) > _SHOWN:
        click.echo(f"  {what}: {len(paths) - _SHOWN} more")


def _megabytes(size: int) -> str:
    return f"{size / 1e6:.1f} MB"


@contextmanager
def _bar(total: int, label: str, *, hidden: bool) -> Iterator[Callable[[int], None]]:
    """Progress in bytes on standard error, unless machines read."""
    with click.progressbar(length=total, label=label, file=sys.stderr, hidden=hidden) as bar:
        yield bar.update
