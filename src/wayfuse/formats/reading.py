"""Which format a file is of, and which files an argument means."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

from wayfuse.core.errors import DataMissingError, FormatError, UsageError
from wayfuse.sensors.recording import Recording

__all__ = ["FORMATS", "expand", "read", "sniff"]

FORMATS = (
    "ms-indoor", "getsensordata", "sensor-logger", "hcu", "wifi-rtt", "intel5300", "nexmon", "esp32-csi",
    "wayfuse",
)  # fmt: skip
_OF_FOLDERS = {"sensor-logger", "hcu"}
_HEAD_BYTES = 1 << 16
_WAYFUSE = b'{"wayfuse-log":'  # how `wayfuse.formats.wayfuse_log` begins
_MS_INDOOR = re.compile(rb"^\d{13}\tTYPE_[A-Z]", re.MULTILINE)
_GETSENSORDATA = re.compile(
    rb"^% LogFile created by the 'GetSensorData'|^(?:ACCE|GYRO|MAGN|PRES|AHRS|WIFI|BLE4|BLUE|POSI|GNSS);\d",
    re.MULTILINE,
)


def read(path: str | Path, *, format: str | None = None, platform: str | None = None) -> Recording:  # noqa: A002
    """Read a recording.

    Parameters
    ----------
    path : a log file, a Sensor Logger folder or ZIP, a folder of HCU Hamburg.
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
    if path.is_dir() and kind in FORMATS and kind not in _OF_FOLDERS:
        raise FormatError(f"a folder, where {kind} is a file", where=path)
    if kind == "wayfuse":
        from wayfuse.formats import wayfuse_log

        return wayfuse_log.read(path)
    if kind == "ms-indoor":
        from wayfuse.formats import ms_indoor

        return ms_indoor.read(path)
    if kind == "getsensordata":
        from wayfuse.formats import getsensordata

        return getsensordata.read(path)
    if kind == "sensor-logger":
        from wayfuse.formats import sensor_logger

        return sensor_logger.read(path, platform=platform)
    if kind == "hcu":
        from wayfuse.formats import hcu

        return hcu.read(path)
    if kind in FORMATS:
        return _read_ranging(path, kind)
    raise UsageError(f"unknown format {kind!r}", where="format", remedy=f"use one of {', '.join(FORMATS)}")


def _read_ranging(path: Path, kind: str) -> Recording:
    """Read a recording of ranges or channel state."""
    from wayfuse.formats import esp32_csi, intel5300, nexmon, wifi_rtt

    readers: Mapping[str, Callable[[Path], Recording]] = {
        "wifi-rtt": wifi_rtt.read,
        "intel5300": intel5300.read,
        "nexmon": nexmon.read,
        "esp32-csi": esp32_csi.read,
    }
    return readers[kind](path)


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

    ``@FILE`` lists a path per line, relative to the current folder; blank lines and lines with ``#`` are
    skipped. A folder of Sensor Logger or HCU Hamburg is itself a recording. Files of a folder that are no
    recordings are skipped.

    Raises
    ------
    DataMissingError : a path does not exist, or a folder or list holds no recording.
    """
    paths: list[Path] = []
    for argument in arguments:
        text = str(argument)
        if text.startswith("@"):
            listed = _listed(Path(text[1:]))
            if not listed:
                raise DataMissingError("no path in this list", where=text)
            paths += expand(listed)
            continue
        path = Path(argument)
        if not path.exists():
            raise DataMissingError("no such file or folder", where=path)
        if path.is_file() or _sniff(path):
            paths.append(path)
            continue
        found = sorted(_below(path))
        if not found:
            raise DataMissingError("no recording in this folder", where=path)
        paths += found
    return paths


def _listed(path: Path) -> list[str]:
    if not path.is_file():
        raise DataMissingError(
            "no such list of recordings", where=path, remedy="give @FILE with a path per line"
        )
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise FormatError(
            f"not a list of recordings: {error}", where=path, remedy="give a path per line"
        ) from error
    lines = (line.strip() for line in text.splitlines())
    return [line for line in lines if line and not line.startswith("#")]


def _below(folder: Path) -> Iterator[Path]:
    """Recordings in a folder and the folders below, hidden ones left out."""
    for path in folder.iterdir():
        if path.name.startswith("."):
            continue
        if path.is_dir() and not _sniff(path):
            yield from _below(path)
        elif path.is_dir() or _sniff(path):
            yield path


def _sniff(path: Path) -> str | None:
    if not path.is_dir():
        with path.open("rb") as file:
            head = file.read(_HEAD_BYTES)
        if head.startswith(_WAYFUSE):
            return "wayfuse"
        if head.startswith(b"#\tstartTime:") or _MS_INDOOR.search(head):
            return "ms-indoor"
        if _GETSENSORDATA.search(head):
            return "getsensordata"
        ranging = _sniff_ranging(head)
        if ranging is not None:
            return ranging
    from wayfuse.formats import hcu
    from wayfuse.formats.sensor_logger_tables import is_recording

    if is_recording(path):
        return "sensor-logger"
    return "hcu" if hcu.is_recording(path) else None


def _sniff_ranging(head: bytes) -> str | None:
    from wayfuse.formats import esp32_csi, intel5300, nexmon, wifi_rtt

    if wifi_rtt.is_table(head):
        return "wifi-rtt"
    if nexmon.is_capture(head):
        return "nexmon"
    if esp32_csi.is_log(head):
        return "esp32-csi"
    return "intel5300" if intel5300.is_log(head) else None
