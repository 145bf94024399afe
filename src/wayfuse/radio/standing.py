"""A phone that stands hears the same place again: its scans are averaged.

The levels of successive scans at one place vary by several decibels and some access points are missed each time.
While no step is made, the fingerprint of now is therefore the mean, access point by access point, over the scans since
the person stopped, the last ``memory`` of them counting most.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.types import Array32, IdArray
from wayfuse.radio.survey import Fingerprint

__all__ = ["Standing"]

_HEARD_AT_LEAST = 0.25  # share of the scans' weight below which a reading is chance


class Standing(NamedTuple):
    """Sums over the scans since the last step. bssid : (n,) ascending; weight, level : (n,) of and weighted dBm."""

    bssid: IdArray
    frequency: NDArray[np.int32]
    weight: Array32
    level: Array32
    total: float

    @classmethod
    def of(cls, fingerprint: Fingerprint) -> Standing:
        """After the first scan, its access points ascending as `radio.scans.ScanBuffer` gives them."""
        bssid, rssi, frequency = fingerprint
        return cls(bssid, frequency, np.ones(len(bssid), np.float32), rssi, 1.0)

    def add(self, fingerprint: Fingerprint, memory: float = 5.0) -> Standing:
        """After another scan; older ones fade with 1/``memory`` per scan."""
        new, fade = Standing.of(fingerprint), np.float32(1.0 - 1.0 / memory)
        bssid = np.union1d(self.bssid, new.bssid)
        i, j = np.searchsorted(bssid, self.bssid), np.searchsorted(bssid, new.bssid)
        frequency = np.zeros(len(bssid), np.int32)
        weight, level = np.zeros(len(bssid), np.float32), np.zeros(len(bssid), np.float32)
        frequency[i], frequency[j] = self.frequency, new.frequency
        weight[i], level[i] = fade * self.weight, fade * self.level
        weight[j] += new.weight
        level[j] += new.level
        return Standing(bssid, frequency, weight, level, float(fade) * self.total + 1.0)

    @property
    def fingerprint(self) -> Fingerprint:
        """The mean of the scans; what was heard in too few of them is left out."""
        if self.total == 1.0:  # of one scan
            return Fingerprint(self.bssid, self.level, self.frequency)
        often = self.weight >= _HEARD_AT_LEAST * self.total
        return Fingerprint(self.bssid[often], self.level[often] / self.weight[often], self.frequency[often])
