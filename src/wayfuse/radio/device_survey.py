"""A survey made with several phones, brought to the levels of one of them.

Fingerprints of two phones at the same places differ by the phones' offset (`device_offset`). It is the median
difference, per band, over all readings of one access point by both within a few metres; phones that share no places
with the reference, directly, keep their levels, and are named.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.errors import RadioMapError
from wayfuse.core.types import Array
from wayfuse.radio.device_offset import N_BANDS, band_of
from wayfuse.radio.survey import Survey

__all__ = ["Levels", "device_shifts", "normalised"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Levels:
    """How phones are compared: within ``reach`` m on one floor, over at least ``least`` pairs of readings per band."""

    reach: float = 2.0
    least: int = 100


def device_shifts(
    survey: Survey, devices: Sequence[str], how: Levels | None = None
) -> tuple[str, Mapping[str, Array]]:
    """The reference phone, and what to add (N_BANDS,) dB to the levels of each phone.

    Parameters
    ----------
    devices : of each of ``survey.walks``, such as the model; a walk with an empty name is a phone of its own. The
    reference is the one with most fingerprints.

    Raises
    ------
    RadioMapError : there is not one device per walk.
    """
    if len(devices) != len(survey.walks):
        raise RadioMapError(f"{len(devices)} devices for {len(survey.walks)} walks")
    how = how or Levels()
    names = [device or f"? {walk}" for device, walk in zip(devices, survey.walks, strict=True)]
    known, code = np.unique(names, return_inverse=True)
    owner = code[survey.walk]
    reference = int(np.argmax(np.bincount(owner, minlength=len(known))))
    shifts = {
        str(name): np.zeros(N_BANDS)
        if c == reference
        else _shift(survey, owner == c, owner == reference, how)
        for c, name in enumerate(known)
    }
    return str(known[reference]), shifts


def normalised(survey: Survey, devices: Sequence[str], shifts: Mapping[str, Array]) -> Survey:
    """The survey with every walk's levels moved by its phone's shift."""
    of_walk = np.array(
        [shifts[device or f"? {walk}"] for device, walk in zip(devices, survey.walks, strict=True)]
    )
    row = np.repeat(np.arange(len(survey)), np.diff(survey.indptr))
    moved = of_walk[survey.walk[row], band_of(survey.frequency)[survey.indices]]
    return replace(survey, rssi=(survey.rssi + moved).astype(np.float32))


def _shift(survey: Survey, mine: NDArray[np.bool_], theirs: NDArray[np.bool_], how: Levels) -> Array:
    """Median over pairs of readings, of the reference less mine."""
    difference: list[list[Array]] = [[] for _ in range(N_BANDS)]
    band = band_of(survey.frequency)
    for i in np.flatnonzero(mine):
        near = np.flatnonzero(theirs & (survey.floor == survey.floor[i]))
        if not len(near):
            continue
        d2 = np.sum((survey.xy[near] - survey.xy[i]) ** 2, axis=1)
        j = near[np.argmin(d2)]
        if d2.min() > how.reach**2:
            continue
        a, b = (slice(survey.indptr[k], survey.indptr[k + 1]) for k in (i, j))
        both, at, to = np.intersect1d(survey.indices[a], survey.indices[b], return_indices=True)
        apart = survey.rssi[b][to].astype(np.float64) - survey.rssi[a][at]
        for k in range(N_BANDS):
            difference[k].append(apart[band[both] == k])
    pooled = [np.concatenate(parts) if parts else np.empty(0) for parts in difference]
    return np.array([float(np.median(p)) if len(p) >= how.least else 0.0 for p in pooled])
