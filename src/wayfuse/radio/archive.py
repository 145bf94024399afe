"""Files of arrays: one ``.npz`` of plain arrays with a JSON header, versioned, never pickle.

A file is an uncompressed zip of ``.npy`` members; the member ``header.json`` says the format, its version,
the kind of content, free parameters, and of each array its dtype, shape and SHA-256. `read_archive` trusts
none of it: it checks the declared sizes against the zip directory before it allocates, the checksums after,
and refuses newer versions, other people's files and object arrays with an error that says what to do. What
the arrays mean is the business of the caller: surveys (`survey_file`), radio maps (`map_file`), and others.
"""

from __future__ import annotations

import hashlib
import io
import json
import math
import os
import struct
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.errors import RadioMapError

__all__ = ["AGAIN", "FORMAT", "read_archive", "write_archive"]

FORMAT = "wayfuse-archive"
_FORMAT_VERSION = 1  # of the container; each kind of content has its own version besides
_HEADER = "header.json"
_HEADER_BYTES = 1 << 20  # a header is a few kilobytes: more is not ours
_MAX_BYTES = 4 << 30  # an array larger than this is refused before anything is allocated
_MAX_MEMBERS = 256
_NPY_PREAMBLE = 4096  # bytes a .npy member may have beyond its data
_EPOCH = (1980, 1, 1, 0, 0, 0)  # zip date of every member, so that equal content gives equal bytes
_KINDS = "biuf"  # bool, int, uint, float: what an array may hold

# What zipfile lets through on flipped bytes: unknown zip versions and methods, encryption flags, odd names.
_ZIP_FAULTS = (NotImplementedError, RuntimeError, ValueError, KeyError, EOFError, OverflowError, struct.error)
AGAIN = "save it again from its source"  # the remedy of a damaged file


def _digest(array: NDArray[Any]) -> str:
    return hashlib.sha256(np.ascontiguousarray(array).tobytes()).hexdigest()


def write_archive(
    path: str | os.PathLike[str],
    kind: str,
    version: int,
    header: Mapping[str, Any],
    arrays: Mapping[str, NDArray[Any]],
) -> None:
    """Write arrays and a JSON header as one file, replacing it whole or not at all.

    Parameters
    ----------
    path : file to write, by custom ``.npz``.
    kind, version : what the content is, and the version of that kind (>= 1).
    header : parameters that JSON can hold (finite numbers, strings, lists, objects).
    arrays : by name (identifiers); bool, integer or float of any shape.

    Raises
    ------
    RadioMapError : a name, dtype or header value cannot be stored.
    """
    target = Path(path)
    described: dict[str, dict[str, Any]] = {}
    for name, array in arrays.items():
        if not name.isidentifier() or array.dtype.kind not in _KINDS:
            raise RadioMapError(f"array {name!r} of {array.dtype} cannot be stored", where=target)
        described[name] = {"dtype": array.dtype.str, "shape": list(array.shape), "sha256": _digest(array)}
    top = {"format": FORMAT, "format_version": _FORMAT_VERSION, "kind": kind, "version": version}
    try:
        whole = {**top, "header": dict(header), "arrays": described}
        text = json.dumps(whole, allow_nan=False, sort_keys=True)
    except (TypeError, ValueError) as fault:
        raise RadioMapError(f"header cannot be stored as JSON: {fault}", where=target) from fault
    part = target.with_name(target.name + ".part")
    with zipfile.ZipFile(part, "w", zipfile.ZIP_STORED) as archive:
        archive.writestr(zipfile.ZipInfo(_HEADER, _EPOCH), text)
        for name, array in arrays.items():
            buffer = io.BytesIO()
            np.lib.format.write_array(
                buffer, np.ascontiguousarray(array).reshape(array.shape), allow_pickle=False
            )
            archive.writestr(zipfile.ZipInfo(name + ".npy", _EPOCH), buffer.getbuffer())
    part.replace(target)


def read_archive(
    path: str | os.PathLike[str], kind: str | None = None, *, version: int | None = None
) -> tuple[str, dict[str, Any], dict[str, NDArray[Any]]]:
    """Read a file written by `write_archive`.

    Parameters
    ----------
    path : file.
    kind : what the content has to be; None takes any.
    version : newest version of that kind the caller understands; None takes any.

    Returns
    -------
    kind, header (with the key ``version`` added), arrays by name.

    Raises
    ------
    RadioMapError : absent, foreign, newer, damaged or too large file, with the remedy.
    """
    source = Path(path)
    try:
        with zipfile.ZipFile(source) as archive:
            top = _read_top(archive, source)
            _check_top(top, source, kind, version)
            arrays = {name: _read_array(archive, name, top["arrays"][name], source) for name in top["arrays"]}
    except FileNotFoundError as fault:
        raise RadioMapError("no such file", where=source, remedy="check the path") from fault
    except zipfile.BadZipFile as fault:
        raise RadioMapError(f"not a whole zip file: {fault}", where=source, remedy=AGAIN) from fault
    except _ZIP_FAULTS as fault:
        raise RadioMapError(f"damaged zip: {fault}", where=source, remedy=AGAIN) from fault
    except OSError as fault:
        raise RadioMapError(f"cannot be read: {fault}", where=source, remedy="check the file") from fault
    return top["kind"], {**top["header"], "version": top["version"]}, arrays


def _read_top(archive: zipfile.ZipFile, source: Path) -> dict[str, Any]:
    """The JSON header, checked for shape only."""
    foreign = RadioMapError("not a wayfuse archive", where=source, remedy="give a file that wayfuse saved")
    try:
        info = archive.getinfo(_HEADER)
    except KeyError:
        raise foreign from None
    if info.file_size > _HEADER_BYTES or info.compress_type != zipfile.ZIP_STORED:
        raise foreign
    try:
        top = json.loads(archive.read(info))
    except (ValueError, RecursionError) as fault:
        raise RadioMapError(f"damaged header: {fault}", where=source, remedy=AGAIN) from fault
    if not isinstance(top, dict) or top.get("format") != FORMAT:
        raise foreign
    return top


def _check_top(top: dict[str, Any], source: Path, kind: str | None, version: int | None) -> None:
    """Refuse newer versions, other kinds and malformed headers."""
    newer = "update wayfuse"
    if not isinstance(top.get("format_version"), int) or not isinstance(top.get("version"), int):
        raise RadioMapError("damaged header: no version", where=source, remedy=AGAIN)
    if top["format_version"] > _FORMAT_VERSION:
        raise RadioMapError(
            f"format version {top['format_version']} is newer than {_FORMAT_VERSION}",
            where=source,
            remedy=newer,
        )
    if not isinstance(top.get("header"), dict) or not isinstance(top.get("arrays"), dict):
        raise RadioMapError("damaged header: no arrays", where=source, remedy=AGAIN)
    if not isinstance(top.get("kind"), str) or (kind is not None and top["kind"] != kind):
        raise RadioMapError(
            f"holds {top.get('kind')!r}, not {kind!r}", where=source, remedy=f"give a {kind} file"
        )
    if version is not None and top["version"] > version:
        raise RadioMapError(
            f"{top['kind']} version {top['version']} is newer than {version}", where=source, remedy=newer
        )
    if len(top["arrays"]) > _MAX_MEMBERS:
        raise RadioMapError(f"{len(top['arrays'])} arrays are too many", where=source, remedy=AGAIN)


def _read_array(archive: zipfile.ZipFile, name: str, declared: object, source: Path) -> NDArray[Any]:
    """One member, its size checked before and its checksum after it is read."""
    dtype, shape, digest = _declared(name, declared, source)
    try:
        info = archive.getinfo(name + ".npy")
    except KeyError:
        raise RadioMapError(f"array {name!r} is missing", where=source, remedy=AGAIN) from None
    size = math.prod(shape) * dtype.itemsize
    if size > _MAX_BYTES:
        raise RadioMapError(
            f"array {name!r} declares {size} bytes", where=source, remedy="the file is not sound"
        )
    stored = info.compress_type == zipfile.ZIP_STORED
    if not stored or not size <= info.file_size <= size + _NPY_PREAMBLE:
        raise RadioMapError(f"array {name!r} is not of its declared size", where=source, remedy=AGAIN)
    try:
        array = np.load(io.BytesIO(archive.read(info)), allow_pickle=False)
    except (ValueError, EOFError, zipfile.BadZipFile) as fault:
        raise RadioMapError(f"array {name!r} is damaged: {fault}", where=source, remedy=AGAIN) from fault
    if (
        not isinstance(array, np.ndarray)
        or array.dtype != dtype
        or array.shape != shape
        or _digest(array) != digest
    ):
        raise RadioMapError(f"array {name!r} does not match its checksum", where=source, remedy=AGAIN)
    return array


def _declared(name: str, declared: object, source: Path) -> tuple[np.dtype[Any], tuple[int, ...], str]:
    """dtype, shape and checksum that the header gives for an array."""
    fault = RadioMapError(f"damaged header of array {name!r}", where=source, remedy=AGAIN)
    if not isinstance(declared, dict):
        raise fault
    text, shape, digest = declared.get("dtype"), declared.get("shape"), declared.get("sha256")
    if not isinstance(text, str) or not isinstance(digest, str) or not isinstance(shape, list):
        raise fault
    if len(text) > 4 or text[1:2] not in list(_KINDS) or not all(type(n) is int and n >= 0 for n in shape):
        raise fault
    try:
        return np.dtype(text), tuple(shape), digest
    except TypeError:
        raise fault from None
