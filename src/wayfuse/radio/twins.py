"""Twin BSSIDs: one radio that sends several networks, each under an address of its own.

Twins say the same thing several times, so a product over access points that takes them for independent is too sure
of itself. Two addresses are twins when they are on one channel, differ only in the first octet or the last (how
makers number the networks of a radio), and are heard alike: the median of the difference of their strengths, over the
fingerprints that hold both, is small.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.types import Array32
from wayfuse.radio.survey import Survey

__all__ = ["twin_groups", "twin_shares"]

_MIDDLE = np.uint64(0x00FFFFFFFF00)  # octets 2 to 5 of an address
_HASHED = np.uint64(1) << np.uint64(63)  # digests of tokens have no octets to compare


def twin_groups(survey: Survey, *, tolerance: float = 2.0, min_common: int = 5) -> NDArray[np.int64]:
    """(m,) group of each access point of a survey; twins share one, access points on their own have their own.

    Parameters
    ----------
    tolerance : dB, greatest median difference of twins. min_common : fingerprints that must hold both.
    """
    m = len(survey.bssid)
    group = np.arange(m)
    rows, strength = _columns(survey)
    key = (survey.bssid & _MIDDLE) ^ (survey.frequency.astype(np.uint64) << np.uint64(48))
    order = np.lexsort((survey.bssid, key))
    order = order[(survey.frequency[order] > 0) & (survey.bssid[order] < _HASHED)]
    for family in np.split(order, np.flatnonzero(np.diff(key[order]) != 0) + 1):
        for i, a in enumerate(family):
            for b in family[i + 1 :]:
                if group[b] != b:
                    continue
                _, at_a, at_b = np.intersect1d(rows[a], rows[b], assume_unique=True, return_indices=True)
                if len(at_a) < min_common:
                    continue
                if float(np.median(np.abs(strength[a][at_a] - strength[b][at_b]))) <= tolerance:
                    group[b] = group[a]
    return group


def twin_shares(survey: Survey) -> Array32:
    """(m,) 1 / size of each access point's twin group: weights under which a radio counts once."""
    _, inverse, size = np.unique(twin_groups(survey), return_inverse=True, return_counts=True)
    shares: Array32 = (1.0 / size[inverse]).astype(np.float32)
    return shares


def _columns(survey: Survey) -> tuple[list[NDArray[np.int64]], list[Array32]]:
    """Of each access point the fingerprints that heard it (ascending) and how strongly."""
    order = np.argsort(survey.indices, kind="stable")
    row = np.repeat(np.arange(len(survey)), np.diff(survey.indptr))[order]
    cuts = np.cumsum(np.bincount(survey.indices, minlength=len(survey.bssid)))[:-1]
    return np.split(row, cuts), np.split(survey.rssi[order], cuts)
