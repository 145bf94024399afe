"""Many recordings on all cores, with a progress bar; and saying at the end what was wrong with them."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import TypeVar

import click

from wayfuse.core.cores import usable_cores
from wayfuse.core.errors import UsageError

__all__ = ["check_target", "map_recordings", "progress_bar", "report_faults"]

T = TypeVar("T")

_SERIAL = 3  # so few recordings are done before a second process has started
_SHOWN = 20  # faults shown on the terminal; more are counted
_worker: Callable[[Path], object] | None = None


def map_recordings(
    work: Callable[[Path], T], paths: Sequence[Path], label: str, jobs: int | None
) -> Iterator[T]:
    """``work`` of each path, in the order of the paths, with a progress bar on standard error.

    ``work`` must be picklable: it is sent once to each process.
    """
    n = min(jobs or usable_cores(), len(paths))
    with click.progressbar(length=len(paths), label=label, file=sys.stderr) as bar:
        if n <= 1 or len(paths) <= _SERIAL:
            for path in paths:
                yield work(path)
                bar.update(1)
            return
        from concurrent.futures import ProcessPoolExecutor

        # the first one here: kernels that are not in the cache yet are then compiled once, not in every process
        yield work(paths[0])
        bar.update(1)
        with ProcessPoolExecutor(n, initializer=_start, initargs=(work,)) as pool:
            for result in pool.map(_run, paths[1:], chunksize=1):
                yield result  # type: ignore[misc]  # what ``work`` returned
                bar.update(1)


def progress_bar(label: str) -> Callable[[Iterable[T], int], Iterator[T]]:
    """Passes results on as they come, told how many there will be, with a progress bar on standard error."""

    def shown(results: Iterable[T], n: int) -> Iterator[T]:
        with click.progressbar(results, length=n, label=label, file=sys.stderr) as bar:
            yield from bar

    return shown


def report_faults(notes: Sequence[str]) -> None:
    """Say on standard error what was wrong with the input, the first lines of it."""
    for note in notes[:_SHOWN]:
        click.echo(f"note: {note}", err=True)
    if len(notes) > _SHOWN:
        click.echo(
            f"note: and {len(notes) - _SHOWN} more; `wayfuse inspect RECORDING` tells all of one", err=True
        )


def check_target(out: Path) -> None:
    """Fail before the work, not after it, when the result cannot be written."""
    if out.is_dir():
        raise UsageError("is a folder", where=out, remedy="name a file")
    if not out.parent.is_dir():
        raise UsageError(f"there is no folder {out.parent}", where=out, remedy="create it first")


def _start(work: Callable[[Path], object]) -> None:
    global _worker  # noqa: PLW0603 (a pool's processes have no other place for what they were given)
    _worker = work


def _run(path: Path) -> object:
    assert _worker is not None  # noqa: S101
    return _worker(path)
