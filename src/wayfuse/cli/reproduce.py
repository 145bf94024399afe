"""``wayfuse reproduce``: run the experiments of the papers, paper against ours."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from wayfuse.papers.reproduction import Reproduction, Table

__all__ = ["reproduce"]


@click.command(context_settings={"help_option_names": ["-h", "--help"]})
@click.argument("preset", metavar="PRESET")
@click.option(
    "--seeds", type=click.IntRange(1), help="Number of seeds (default: the paper's own, 20 or more)."
)
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    help="Folder to write PRESET.md and its pictures into, as docs/papers.",
)
@click.option("--json", "json_file", type=click.Path(path_type=Path), help="Also write all figures as JSON.")
@click.option("--jobs", type=click.IntRange(1), help="Processes (default: all cores).")
def reproduce(
    preset: str, seeds: int | None, out: Path | None, json_file: Path | None, jobs: int | None
) -> None:
    """Run the experiments of a published system and print the paper's figures against ours.

    PRESET is chu2009, he2014, karlsson2015, li2015, liu2017, comparison (all of them and `fused` on the same walks), or
    `all`. The exit status is 1 when a bar does not hold.
    """
    import json

    from wayfuse.cli.results import make_mapper
    from wayfuse.papers.reproduction import EXPERIMENTS, page, paper, write_pictures

    done = []
    for name in EXPERIMENTS if preset == "all" else (preset,):
        module = paper(name)
        result = module.reproduce(tuple(range(seeds or module.SEEDS)), make_mapper(jobs))
        done.append(result)
        for line in _lines(result):
            click.echo(line)
        if out is not None:
            out.mkdir(parents=True, exist_ok=True)
            (out / f"{name}.md").write_text(page(name).rstrip() + "\n\n" + _page(result), encoding="utf-8")
            for file in (out / f"{name}.md", *write_pictures(module, result, out)):
                click.echo(f"written to {file}")
    if json_file is not None:
        document = json.dumps([r.plain() for r in done], indent=1, allow_nan=False)
        json_file.write_text(document + "\n", encoding="utf-8")
    if not all(bar.met for r in done for bar in r.bars):
        raise click.exceptions.Exit(1)


def _cells(table: Table) -> list[list[str]]:
    return [[f"{cell:.2f}" if isinstance(cell, float) else str(cell) for cell in row] for row in table.rows]


def _lines(result: Reproduction) -> list[str]:
    out = []
    for table in result.tables:
        rows = [list(table.columns), *_cells(table)]
        widths = [max(len(row[k]) for row in rows) for k in range(len(table.columns))]
        out += ["", f"{result.preset}: {table.title}"]
        out += [
            "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
            for row in rows
        ]
        out += [table.note] if table.note else []
    out += [
        "",
        f"{sum(bar.met for bar in result.bars)} of {len(result.bars)} bars hold, {len(result.seeds)} seeds",
    ]
    out += [f"does not hold: {b.what} {b.bound}: {b.value:.3g}" for b in result.bars if not b.met]
    return [*out, *(f"lost: {line}" for line in result.lost)]


def _page(result: Reproduction) -> str:
    written = f"Written by `wayfuse reproduce {result.preset} --out docs/papers`: {len(result.seeds)} seeds"
    parts = [f"## Figures\n\n{written}, 90 % intervals of the mean.\n"]
    for table in result.tables:
        head = f"### {table.title}\n\n| {' | '.join(table.columns)} |\n|{'---|' * len(table.columns)}\n"
        body = "".join(f"| {' | '.join(row)} |\n" for row in _cells(table))
        parts.append(head + body + (f"\n{table.note}\n" if table.note else ""))
    bars = "".join(
        f"| {b.what} | {b.bound} | {b.value:.3g} | {'holds' if b.met else 'does not hold'} |\n"
        for b in result.bars
    )
    parts.append("### Bars\n\n| what | bound | value | verdict |\n|---|---|---|---|\n" + bars)
    if result.lost:
        parts.append("### Lost runs\n\n" + "".join(f"- {line}\n" for line in result.lost))
    return "\n".join(parts)
