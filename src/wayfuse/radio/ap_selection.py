"""A survey with fewer access points: those heard at most of its places."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from wayfuse.core.errors import ConfigError
from wayfuse.radio.survey import Survey

__all__ = ["most_heard"]


def most_heard(survey: Survey, n: int) -> Survey:
    """The survey with its n access points of most readings (the first by identifier where equal); places stay."""
    if n < 1:
        raise ConfigError(f"n must be at least 1, got {n}", where="most_heard")
    if n >= len(survey.bssid):
        return survey
    count = np.bincount(survey.indices, minlength=len(survey.bssid))
    columns = np.sort(np.argsort(-count, kind="stable")[:n])
    kept = np.isin(survey.indices, columns)
    rows = np.repeat(np.arange(len(survey)), np.diff(survey.indptr))[kept]
    indptr = np.concatenate([[0], np.cumsum(np.bincount(rows, minlength=len(survey)))]).astype(np.int64)
    return replace(
        survey,
        bssid=survey.bssid[columns],
        frequency=survey.frequency[columns],
        indptr=indptr,
        indices=np.searchsorted(columns, survey.indices[kept]).astype(np.int32),
        rssi=survey.rssi[kept],
    )
