"""Fitted radio maps of any kind on disk."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any

from numpy.typing import NDArray

from wayfuse.core.errors import ConfigError, RadioMapError
from wayfuse.radio.archive import AGAIN, read_archive, write_archive
from wayfuse.radio.radio_map import RadioMap
from wayfuse.radio.survey_file import survey_from_parts

__all__ = ["load", "save"]

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
            f"the parts of the {kind} map do not fit: {fault}", where=path, remedy=AGAIN
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
