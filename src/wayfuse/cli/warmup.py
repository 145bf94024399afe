"""``wayfuse warmup``: compile the kernels once, so that tracking starts at once."""

from __future__ import annotations

import click

__all__ = ["warmup"]


@click.command(context_settings={"help_option_names": ["-h", "--help"]})
def warmup() -> None:
    """Compile the kernels into the cache, by tracking a small simulated walk."""
    import tempfile
    import time
    from pathlib import Path

    from wayfuse.cli.demo import run_demo
    from wayfuse.simulator.demo import smallest

    start = time.process_time()
    with tempfile.TemporaryDirectory() as folder:
        run_demo(Path(folder), 0, scenario=smallest(), quiet=True, pictures=False)
    click.echo(f"kernels compiled ({time.process_time() - start:.1f} s CPU)")
