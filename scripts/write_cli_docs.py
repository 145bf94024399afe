"""Write docs/cli.md from the help of the commands: ``python scripts/write_cli_docs.py``.

``tests/docs/test_docs.py`` fails where the page is stale.
"""

from __future__ import annotations

import inspect
from pathlib import Path

import click

from wayfuse.cli.main import COMMANDS, cli

__all__ = ["PAGE", "command_names", "page", "section"]

PAGE = Path(__file__).resolve().parent.parent / "docs" / "cli.md"
_HEAD = """\
# Command line

This page is written from the help of the commands: `python scripts/write_cli_docs.py`. `wayfuse COMMAND --help` says
the same.

Exit status: 0 done; 1 done in part (a recording could not be read, a checksum differs); 2 an error of use, said in one
line on standard error; 130 stopped by Ctrl-C. Results go to standard output, progress and notes to standard error.
"""


def command_names() -> list[str]:
    """Names of the top-level commands, in the order of the help."""
    return list(COMMANDS)


def page() -> str:
    """The whole page."""
    return "\n".join([_HEAD, *(section(name) for name in command_names())])


def section(name: str) -> str:
    """The section of one top-level command and its subcommands."""
    context = click.Context(cli, info_name="wayfuse")
    command = cli.get_command(context, name)
    if command is None:
        raise KeyError(name)
    return "\n".join(_sections(command, click.Context(command, info_name=name, parent=context), 2))


def _sections(command: click.Command, context: click.Context, level: int) -> list[str]:
    usage = " ".join([context.command_path, *command.collect_usage_pieces(context)])
    lines = [f"{'#' * level} {context.command_path}", "", "```", usage, "```", ""]
    for paragraph in inspect.cleandoc(command.help or "").split("\n\n"):
        lines += [_escaped(" ".join(paragraph.split())), ""]
    rows = [
        record for p in command.get_params(context) if (record := p.get_help_record(context)) and record[1]
    ]
    if options := [row for row in rows if "--help" not in row[0]]:
        lines += ["| option | meaning |", "|---|---|"]
        lines += [f"| `{_code(option)}` | {_cell(text)} |" for option, text in options] + [""]
    if isinstance(command, click.Group):
        for name in command.list_commands(context):
            below = command.get_command(context, name)
            if below is not None:
                lines += _sections(below, click.Context(below, info_name=name, parent=context), level + 1)
    return lines


def _cell(text: str) -> str:
    return _escaped(" ".join(text.split())).replace("|", "\\|")


def _code(text: str) -> str:
    return text.replace("|", "\\|")


def _escaped(text: str) -> str:
    return text.replace("<", "&lt;")


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
