"""Reading a whole file that must not be larger than any real one of its kind."""

from __future__ import annotations

from pathlib import Path

from wayfuse.core.errors import DataMissingError, FormatError

__all__ = ["read_bounded"]


def read_bounded(path: Path, most: int) -> bytes:
    """Bytes of a file of at most ``most`` bytes.

    Raises
    ------
    DataMissingError : there is no such file. FormatError : it is a folder, or larger.
    """
    if not path.exists():
        raise DataMissingError("there is no such file", where=path)
    if not path.is_file():
        raise FormatError("a folder, where a file is due", where=path)
    with path.open("rb") as file:
        data = file.read(most + 1)  # not by its size: it may grow, or be no plain file
    if len(data) > most:
        raise FormatError(
            f"larger than {most / 2**20:.0f} MiB", where=path, remedy="split the capture into shorter ones"
        )
    return data
