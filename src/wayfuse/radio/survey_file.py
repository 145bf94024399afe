"""Surveys on disk, alone (`save_survey`) or within other files (`survey_parts`); checked before they are believed."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.errors import RadioMapError
from wayfuse.radio.archive import AGAIN, read_archive, write_archive
from wayfuse.radio.survey import Survey

__all__ = ["load_survey", "save_survey", "survey_from_parts", "survey_parts"]

_SURVEY_VERSION = 1


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
_USUAL = "usual"  # may be absent


def survey_parts(survey: Survey) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
    """Header and arrays of a survey, for files that hold one besides other things."""
    arrays = {name: np.asarray(getattr(survey, name), dtype) for name, dtype in _SURVEY_ARRAYS.items()}
    header: dict[str, Any] = {"floors": list(survey.floors), "walks": list(survey.walks)}
    if math.isfinite(survey.accuracy):
        header["accuracy"] = survey.accuracy
    if len(survey.usual):
        arrays[_USUAL] = np.asarray(survey.usual, np.float32)
    return header, arrays


def survey_from_parts(
    header: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]], where: str | os.PathLike[str]
) -> Survey:
    """Survey of what `survey_parts` gave, its sparse structure checked."""
    absent = [name for name in _SURVEY_ARRAYS if name not in arrays]
    names = (header.get("floors"), header.get("walks"))
    if absent or not all(isinstance(n, list) and all(isinstance(s, str) for s in n) for n in names):
        raise RadioMapError(
            f"no whole survey (missing {', '.join(absent) or 'names'})", where=where, remedy=AGAIN
        )
    parts = {name: arrays[name] for name in _SURVEY_ARRAYS}
    usual = arrays.get(_USUAL, np.empty(0, np.float32))  # files of before have none
    _check_survey(parts, len(header["floors"]), len(header["walks"]), where)
    accuracy = header.get("accuracy", math.nan)
    if not isinstance(accuracy, float):
        raise RadioMapError(f"accuracy {accuracy!r} is no number", where=where, remedy=AGAIN)
    if usual.dtype != np.float32 or usual.shape not in {(0,), (len(parts["xy"]),)}:
        raise RadioMapError("the survey's arrays do not fit together", where=where, remedy=AGAIN)
    names = tuple(header["floors"]), tuple(header["walks"])
    return Survey(**parts, floors=names[0], walks=names[1], accuracy=accuracy, usual=usual)


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
        raise RadioMapError("the survey's arrays do not fit together", where=where, remedy=AGAIN)


def _within(index: NDArray[Any], n: int) -> bool:
    return bool(np.all((index >= 0) & (index < n)))
