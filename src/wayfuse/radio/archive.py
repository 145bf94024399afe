"""Surveys and radio maps on disk: one ``.npz`` of plain arrays with a JSON header, versioned, never pickle.

A file is an uncompressed zip of ``.npy`` members; the member ``header.json`` says the format, its version,
the kind of content, free parameters, and of each array its dtype, shape and SHA-256. `read_archive` trusts
none of it: it checks the declared sizes against the zip directory before it allocates, the checksums after,
and refuses newer versions, other people's files and object arrays with an error that says what to do. What
the arrays mean is the business of the caller, so other kinds of content can use the same container. `save`
and `load` are for fitted radio maps, `save_survey` and `load_survey` for surveys.
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

from wayfuse.core.errors import ConfigError, RadioMapError
from wayfuse.radio.radio_map import RadioMap
from wayfuse.radio.survey import Survey

__all__ = [
    "FORMAT",
    "load",
    "load_survey",
    "read_archive",
    "save",
    "save_survey",
    "survey_from_parts",
    "survey_parts",
    "write_archive",
]

FORMAT = "wayfuse-archive"
_FORMAT_VERSION = 1  # of the container; each kind of content has its own version besides
_HEADER = "header.json"
_HEADER_BYTES = 1 << 20  # a header is a few kilobytes: more is not ours
_MAX_BYTES = 4 << 30  # an array larger than this is refused before anything is allocated
_MAX_MEMBERS = 256
_NPY_PREAMBLE = 4096  # bytes a .npy member may have beyond its data
_EPOCH = (1980, 1, 1, 0, 0, 0)  # zip date of every member, so that equal content gives equal bytes
_KINDS = "biuf"  # bool, int, uint, float: what an array may hold
_SURVEY_VERSION = 1

# What zipfile lets through on flipped bytes: unknown zip versions and methods, encryption flags, odd names.
_ZIP_FAULTS = (NotImplementedError, RuntimeError, ValueError, KeyError, EOFError, OverflowError, struct.error)
_AGAIN = "save it again from its source"


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
        raise RadioMapError(f"not a whole zip file: {fault}", where=source, remedy=_AGAIN) from fault
    except _ZIP_FAULTS as fault:
        raise RadioMapError(f"damaged zip: {fault}", where=source, remedy=_AGAIN) from fault
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
        raise RadioMapError(f"damaged header: {fault}", where=source, remedy=_AGAIN) from fault
    if not isinstance(top, dict) or top.get("format") != FORMAT:
        raise foreign
    return top


def _check_top(top: dict[str, Any], source: Path, kind: str | None, version: int | None) -> None:
    """Refuse newer versions, other kinds and malformed headers."""
    newer = "update wayfuse"
    if not isinstance(top.get("format_version"), int) or not isinstance(top.get("version"), int):
        raise RadioMapError("damaged header: no version", where=source, remedy=_AGAIN)
    if top["format_version"] > _FORMAT_VERSION:
        raise RadioMapError(
            f"format version {top['format_version']} is newer than {_FORMAT_VERSION}",
            where=source,
            remedy=newer,
        )
    if not isinstance(top.get("header"), dict) or not isinstance(top.get("arrays"), dict):
        raise RadioMapError("damaged header: no arrays", where=source, remedy=_AGAIN)
    if not isinstance(top.get("kind"), str) or (kind is not None and top["kind"] != kind):
        raise RadioMapError(
            f"holds {top.get('kind')!r}, not {kind!r}", where=source, remedy=f"give a {kind} file"
        )
    if version is not None and top["version"] > version:
        raise RadioMapError(
            f"{top['kind']} version {top['version']} is newer than {version}", where=source, remedy=newer
        )
    if len(top["arrays"]) > _MAX_MEMBERS:
        raise RadioMapError(f"{len(top['arrays'])} arrays are too many", where=source, remedy=_AGAIN)


def _read_array(archive: zipfile.ZipFile, name: str, declared: object, source: Path) -> NDArray[Any]:
    """One member, its size checked before and its checksum after it is read."""
    dtype, shape, digest = _declared(name, declared, source)
    try:
        info = archive.getinfo(name + ".npy")
    except KeyError:
        raise RadioMapError(f"array {name!r} is missing", where=source, remedy=_AGAIN) from None
    size = math.prod(shape) * dtype.itemsize
    if size > _MAX_BYTES:
        raise RadioMapError(
            f"array {name!r} declares {size} bytes", where=source, remedy="the file is not sound"
        )
    stored = info.compress_type == zipfile.ZIP_STORED
    if not stored or not size <= info.file_size <= size + _NPY_PREAMBLE:
        raise RadioMapError(f"array {name!r} is not of its declared size", where=source, remedy=_AGAIN)
    try:
        array = np.load(io.BytesIO(archive.read(info)), allow_pickle=False)
    except (ValueError, EOFError, zipfile.BadZipFile) as fault:
        raise RadioMapError(f"array {name!r} is damaged: {fault}", where=source, remedy=_AGAIN) from fault
    if (
        not isinstance(array, np.ndarray)
        or array.dtype != dtype
        or array.shape != shape
        or _digest(array) != digest
    ):
        raise RadioMapError(f"array {name!r} does not match its checksum", where=source, remedy=_AGAIN)
    return array


def _declared(name: str, declared: object, source: Path) -> tuple[np.dtype[Any], tuple[int, ...], str]:
    """dtype, shape and checksum that the header gives for an array."""
    fault = RadioMapError(f"damaged header of array {name!r}", where=source, remedy=_AGAIN)
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


def save_survey(survey: Survey, path: str | os.PathLike[str]) -> None:
    """Save a survey; `load_survey` gives it back bit for bit."""
    header, arrays = survey_parts(survey)
    write_archive(path, "survey", _SURVEY_VERSION, header, arrays)


def load_survey(path: str | os.PathLike[str]) -> Survey:
    """Load a survey; a damaged, foreign or newer file is a `RadioMapError`."""
    _, header, arrays = read_archive(path, "survey", version=_SURVEY_VERSION)
    return survey_from_parts(header, arrays, path)


_SURVEY_ARRAYS = {
    "bssid": np.uint64,
    "frequency": np.int32,
    "xy": np.float64,
    "floor": np.int32,
    "walk": np.int32,
    "indptr": np.int64,
    "indices": np.int32,
    "rssi": np.float32,
}


def survey_parts(survey: Survey) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
    """Header and arrays of a survey, for files that hold one besides other things."""
    arrays = {name: np.asarray(getattr(survey, name), dtype) for name, dtype in _SURVEY_ARRAYS.items()}
    header: dict[str, Any] = {"floors": list(survey.floors), "walks": list(survey.walks)}
    if math.isfinite(survey.accuracy):
        header["accuracy"] = survey.accuracy
    return header, arrays


def survey_from_parts(
    header: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]], where: str | os.PathLike[str]
) -> Survey:
    """Survey of what `survey_parts` gave, its sparse structure checked."""
    absent = [name for name in _SURVEY_ARRAYS if name not in arrays]
    names = (header.get("floors"), header.get("walks"))
    if absent or not all(isinstance(n, list) and all(isinstance(s, str) for s in n) for n in names):
        raise RadioMapError(
            f"no whole survey (missing {', '.join(absent) or 'names'})", where=where, remedy=_AGAIN
        )
    parts = {name: arrays[name] for name in _SURVEY_ARRAYS}
    _check_survey(parts, len(header["floors"]), len(header["walks"]), where)
    accuracy = header.get("accuracy", math.nan)
    if not isinstance(accuracy, float):
        raise RadioMapError(f"accuracy {accuracy!r} is no number", where=where, remedy=_AGAIN)
    return Survey(**parts, floors=tuple(header["floors"]), walks=tuple(header["walks"]), accuracy=accuracy)


def _check_survey(
    parts: Mapping[str, NDArray[Any]], floors: int, walks: int, where: str | os.PathLike[str]
) -> None:
    """Refuse arrays that would index out of bounds later: a checksum says whole, not sound."""
    typed = all(parts[name].dtype == dtype for name, dtype in _SURVEY_ARRAYS.items())
    flat = all(parts[name].ndim == (2 if name == "xy" else 1) for name in _SURVEY_ARRAYS)
    sound = typed and flat and parts["xy"].shape[1:] == (2,)
    if sound:
        indptr, indices, k = parts["indptr"], parts["indices"], len(parts["rssi"])
        sound = (
            len(indptr) == len(parts["xy"]) + 1
            and len(parts["floor"]) == len(parts["walk"]) == len(parts["xy"])
            and len(parts["frequency"]) == len(parts["bssid"])
            and len(indices) == k
            and int(indptr[0]) == 0
            and int(indptr[-1]) == k
            and bool(np.all(np.diff(indptr) >= 0))
            and _within(indices, len(parts["bssid"]))
            and _within(parts["floor"], floors)
            and _within(parts["walk"], walks)
            and bool(np.all(parts["bssid"][1:] > parts["bssid"][:-1]))
            and bool(np.all(np.isfinite(parts["xy"])))
        )
    if not sound:
        raise RadioMapError("the survey's arrays do not fit together", where=where, remedy=_AGAIN)


def _within(index: NDArray[Any], n: int) -> bool:
    return bool(np.all((index >= 0) & (index < n)))


_MAP_VERSION = 1


def save(radio_map: RadioMap, path: str | os.PathLike[str]) -> None:
    """Save a fitted radio map; `load` gives a map with the same answers."""
    kind, header, arrays = radio_map.parts()
    write_archive(path, kind, _MAP_VERSION, header, arrays)


def load(path: str | os.PathLike[str]) -> RadioMap:
    """Load a radio map of any kind; a damaged, foreign or newer file is a `RadioMapError`."""
    kind, header, arrays = read_archive(path, version=_MAP_VERSION)
    try:
        return _rebuilt(kind, header, arrays, path)
    except (KeyError, TypeError, ValueError, IndexError, ConfigError) as fault:
        raise RadioMapError(
            f"the parts of the {kind} map do not fit: {fault}", where=path, remedy=_AGAIN
        ) from fault


def _rebuilt(
    kind: str, header: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]], path: str | os.PathLike[str]
) -> RadioMap:
    """The map of a kind from its parts; the modules of other kinds are not imported."""
    if kind == "knn":
        from wayfuse.radio.knn import KnnMap

        return KnnMap.from_parts(survey_from_parts(header, arrays, path), header)
    if kind == "nnss":
        from wayfuse.radio.nnss import NnssMap

        return NnssMap.from_parts(survey_from_parts(header, arrays, path), header)
    if kind == "horus":
        from wayfuse.radio.horus import HorusMap

        return HorusMap.from_parts(header, arrays)
    if kind == "gaussian_kernel":
        from wayfuse.radio.gaussian_kernel import GaussianKernelMap

        return GaussianKernelMap.from_parts(header, arrays)
    if kind == "gaussian_process":
        from wayfuse.radio.gaussian_process import GaussianProcessMap

        return GaussianProcessMap.from_parts(header, arrays)
    raise RadioMapError(f"holds {kind!r}, not a radio map", where=path, remedy="give a radio map file")
