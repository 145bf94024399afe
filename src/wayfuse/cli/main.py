"""The command ``wayfuse``: a group whose subcommands are imported only when they run.

``wayfuse --help`` and ``wayfuse track --help`` load neither numpy nor numba: start-up time is a feature.
"""

from __future__ import annotations

import atexit
import gc
import importlib
import sys
from typing import Any

import click

from wayfuse import __version__
from wayfuse.core.errors import WayfuseError

__all__ = ["LazyGroup", "cli", "collect_seldom", "main"]

_YOUNG = 50_000  # objects made before the collector looks

# name -> (module:attribute, the line that help shows)
COMMANDS: dict[str, tuple[str, str]] = {
    "site": ("wayfuse.cli.site:site", "Import, check and draw buildings; find ways through them."),
    "survey": ("wayfuse.cli.survey:survey", "Build radio maps from recordings with waypoints."),
    "track": ("wayfuse.cli.track:track", "Track recordings through a site."),
    "serve": ("wayfuse.cli.serve:serve", "Serve live positions: phones and anchors in, positions out."),
    "send": ("wayfuse.cli.send:send", "Send recordings to a server, as phones would."),
    "evaluate": ("wayfuse.cli.evaluate:evaluate", "Score estimates against the waypoints of recordings."),
    "datasets": ("wayfuse.cli.datasets:datasets", "List, fetch and verify public data sets."),
    "inspect": ("wayfuse.cli.inspect:inspect", "Say what a recording holds and what was wrong with it."),
    "simulate": (
        "wayfuse.cli.simulate:simulate",
        "Simulate walks of a scenario, with the truth beside them.",
    ),
    "demo": ("wayfuse.cli.demo:demo", "Run the whole pipeline on a simulated site."),
    "reproduce": (
        "wayfuse.cli.reproduce:reproduce",
        "Run the experiments of the papers, paper against ours.",
    ),
    "results": ("wayfuse.cli.results:results", "Measure every figure of docs/results.md anew."),
    "warmup": ("wayfuse.cli.warmup:warmup", "Compile the kernels once, so that tracking starts at once."),
}


class LazyGroup(click.Group):
    """A click group that knows its commands by name and help line, and imports one when it is used."""

    def __init__(self, *args: Any, commands_by_name: dict[str, tuple[str, str]], **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._lazy = commands_by_name

    def list_commands(self, ctx: click.Context) -> list[str]:  # noqa: ARG002 (click's signature)
        """Names in the order of the table."""
        return list(self._lazy)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:  # noqa: ARG002
        """Import and return one command."""
        if cmd_name not in self._lazy:
            return None
        module, attribute = self._lazy[cmd_name][0].split(":")
        command: click.Command = getattr(importlib.import_module(module), attribute)
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:  # noqa: ARG002
        """Write the list of commands without importing any."""
        with formatter.section("Commands"):
            formatter.write_dl([(name, line) for name, (_, line) in self._lazy.items()])


@click.group(
    cls=LazyGroup, commands_by_name=COMMANDS, context_settings={"help_option_names": ["-h", "--help"]}
)
@click.version_option(__version__, prog_name="wayfuse")
def cli() -> None:
    """Indoor tracking: Wi-Fi and phone motion sensors fused on floor plans."""


def collect_seldom() -> None:
    """Look for cycles of garbage seldom: imports, recordings and tracks make many objects and hardly a cycle."""
    gc.set_threshold(_YOUNG)


def main() -> None:
    """Run the command line; errors a user can mend are one line and exit status 2."""
    collect_seldom()
    atexit.register(gc.freeze)  # no last look through all that the compiler has made
    try:
        status = cli.main(prog_name="wayfuse", standalone_mode=False)
        if isinstance(status, int) and status:  # what a command gave to `Exit` comes back as a value
            sys.exit(status)
    except WayfuseError as error:
        click.echo(f"wayfuse: {error}", err=True)
        sys.exit(2)
    except click.ClickException as error:
        error.show()
        sys.exit(error.exit_code)
    except click.exceptions.Exit as stop:
        sys.exit(stop.exit_code)
    except (click.Abort, KeyboardInterrupt):
        click.echo("wayfuse: stopped", err=True)
        sys.exit(130)
    except BrokenPipeError:
        sys.stderr.close()
        sys.exit(141)
