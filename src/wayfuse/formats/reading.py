"""Which format a file is of, and which files an argument means."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from wayfuse.core.errors import DataMissingError, FormatError, UsageError
from wayfuse.sensors.recording import Recording

__all__ = ["FORMATS", "expand", "read", "sniff"]

FORMATS = ("ms-indoor", "getsensordata", "sensor-logger")
_HEAD_BYTES = 1 << 16


def read(path: str | Path, *, format: str | None = None, platform: str | None = None) -> Recording:  # noqa: A002
    """Read a recording.

    Parameters
    ----------
    path : a log file, a Sensor Logger folder or ZIP.
    format : one of `FORMATS`; found from the content where not given.
    platform : ``"android"`` or ``"ios"`` for Sensor Logger files that do not say it themselves.

    Raises
    ------
    DataMissingError : there is no such file.
    FormatError : the content is of none of the formats.
    """
    path = Path(path)
    if not path.exists():
        raise DataMissingError("no such file or folder", where=path)
    kind = format if format is not None else sniff(path)
    if kind == "ms-indoor":
        from wayfuse.formats import ms_indoor

        return ms_indoor.read(path)
    if kind == "getsensordata":
        from wayfuse.formats import getsensordata

        return getsensordata.read(path)
    if kind == "sensor-logger":
        from wayfuse.formats import sensor_logger

        return sensor_logger.read(path, platform=platform)
    raise UsageError(f"unknown format {kind!r}", where="format", remedy=f"use one of {', '.join(FORMATS)}")


def sniff(path: str | Path) -> str:
    """Name of the format of a file or folder, found from its content.

    Raises
    ------
    FormatError : it is of none of `FORMATS`.
    """
    kind = _sniff(Path(path))
    if kind is None:
        raise FormatError(
            "not a recording of a known format", where=path, remedy=f"known formats: {', '.join(FORMATS)}"
        )
    return kind


def expand(arguments: Sequence[str | Path]) -> list[Path]:
    """Paths of the recordings that arguments mean: a file, a folder (all recordings below it) or ``@FILE``.

    ``@FILE`` lists a path per line, relative to the current folder; blank lines and lines with ``#`` are skipped.
    Files of a folder that are no recordings are skipped; an argument that yields nothing is an error.
    """
    paths: list[Path] = []
    for argument in arguments:
        text = str(argument)
        if text.startswith("@"):
            listed = [s.strip() for s in Path(text[1:]).read_text(encoding="utf-8").splitlines()]
            paths += expand([s for s in listed if s and not s.startswith("#")])
            continue
        path = Path(argument)
        if not path.exists():
            raise DataMissingError("no such file or folder", where=path)
        if path.is_file() or _sniff(path):
            paths.append(path)
            continue
        found = sorted(p for p in path.rglob("*") if p.is_file() and _sniff(p))
        if not found:
            raise DataMissingError("no recording in this folder", where=path)
        paths += found
    return paths


def _sniff(path: Path) -> str | None:
    if path.is_dir():
        return None
    with path.open("rb") as file:
        head = file.read(_HEAD_BYTES)
    if head.startswith(b"#\tstartTime:") or b"\tTYPE_" in head[:4096]:
        return "ms-indoor"
    return None
