r"""Phones differ: the RSS offset of a device, per band, estimated while it is tracked.

Two phones at one place read levels several decibels apart (a Galaxy A5 and an S7 of ipin2023: about 8 dB at
2.4 GHz, 2 to 4 dB at 5 GHz), by an amount that hardly depends on the place. So the offset is a state of the track:
for each band a grid of shifts, and for each shift a cost, the signal distance of the nearest fingerprints to the
scan so shifted, summed over scans. The posterior of a shift is

.. math:: p(s) \propto \exp\Big(-\frac{s^2}{2 \sigma_b^2} - \frac{1}{T} \sum_i \bar d_i(s)\Big)

and its mean is what scans are corrected by. A wrong shift makes every place look unlike the scan, the right one
makes one place look like it: no position is needed, and no calibration walk.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.errors import ConfigError
from wayfuse.core.types import Array, Array32
from wayfuse.radio.sparse_knn import SparseKnn
from wayfuse.radio.survey import Fingerprint

__all__ = ["N_BANDS", "DeviceOffset", "OffsetState", "band_of", "shifted"]

N_BANDS = 2  # 2.4 GHz, and 5 GHz with 6 GHz
_HIGH_BAND = 3000  # MHz


def band_of(frequency: NDArray[np.integer]) -> NDArray[np.int64]:
    """0 for 2.4 GHz (and unknown channels), 1 for those above, shape of ``frequency`` (MHz)."""
    return (np.asarray(frequency) >= _HIGH_BAND).astype(np.int64)


def shifted(fingerprint: Fingerprint, shift: Array) -> Fingerprint:
    """The fingerprint with the levels of each band moved by ``shift`` (N_BANDS,) dB."""
    moved: Array32 = (fingerprint.rssi + shift[band_of(fingerprint.frequency)]).astype(np.float32)
    return fingerprint._replace(rssi=moved)


class OffsetState(NamedTuple):
    """What is known of a device: cost (N_BANDS, n_shifts), scans seen. A value."""

    cost: Array
    n_seen: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class DeviceOffset:
    """Estimates the shift that makes a device read like the survey.

    Parameters
    ----------
    reach, spacing : dB, the grid of shifts goes from -reach to reach. prior : dB, standard deviation of the shift
    before the first scan, per band. same_phone : nats in favour of no shift at all: many a phone is the surveyor's.
    temperature : T, signal distance that counts one nat. k : fingerprints whose mean
    distance is the cost. strongest : readings of a scan that are looked at, for more only take time. burn_in : scans
    that are all judged; then one in ``every``, to spare time. memory : scans after which old costs have faded to 1/e;
    a hand over the antenna changes the offset within a walk.
    """

    reach: float = 14.0
    spacing: float = 2.0
    prior: tuple[float, float] = (6.0, 3.0)
    same_phone: float = 2.0
    temperature: float = 0.03
    k: int = 5
    burn_in: int = 8
    strongest: int = 40
    every: int = 4
    memory: float = 60.0
    grid: Array = field(
        init=False, repr=False, compare=False
    )  # shifts (n_shifts,) dB, ascending, zero among them
    _prior: Array = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        if not (self.reach >= self.spacing > 0.0 and min(self.prior) > 0.0 and self.temperature > 0.0):
            raise ConfigError("reach, spacing, prior and temperature must be positive", where="DeviceOffset")
        if min(self.k, self.every, self.strongest) < 1 or not self.memory > 0.0:
            raise ConfigError("k, every, strongest and memory must be positive", where="DeviceOffset")
        n = int(self.reach / self.spacing)
        s = np.arange(-n, n + 1, dtype=np.float64) * self.spacing
        cost = np.stack([0.5 * (s / sigma) ** 2 for sigma in self.prior])
        cost[:, s == 0.0] -= self.same_phone
        for name, value in (("grid", s), ("_prior", cost)):
            value.flags.writeable = False
            object.__setattr__(self, name, value)

    def init(self) -> OffsetState:
        """State before the first scan: the prior."""
        return OffsetState(self._prior)

    def shift(self, state: OffsetState) -> Array:
        """Posterior mean of the shift (N_BANDS,) dB to add to the device's levels."""
        p = np.exp(state.cost.min(axis=1, keepdims=True) - state.cost)
        return np.asarray((p @ self.grid) / p.sum(axis=1))

    def step(self, state: OffsetState, radio_map: SparseKnn, fingerprint: Fingerprint) -> OffsetState:
        """Judge a scan (or, after the burn-in, let most pass)."""
        state = state._replace(n_seen=state.n_seen + 1)
        if state.n_seen > self.burn_in and state.n_seen % self.every:
            return state
        column = radio_map.survey.columns(fingerprint.bssid)
        used = np.flatnonzero(column >= 0)  # strangers must not crowd out the others
        if not len(used):  # a scan of unknown access points says nothing
            return state
        if len(used) > self.strongest:
            used = used[np.sort(np.argsort(-fingerprint.rssi[used], kind="stable")[: self.strongest])]
        band, n = band_of(fingerprint.frequency[used]), len(self.grid)
        heard = np.unique(band)
        # versions of the scan: each band in turn at every shift, the other at its mean
        trial = np.repeat(self.shift(state)[band][:, None], len(heard) * n, axis=1)
        for row, b in enumerate(heard.tolist()):
            trial[band == b, row * n : (row + 1) * n] = self.grid
        levels = (fingerprint.rssi[used][:, None] + trial).astype(np.float32)
        added = np.zeros_like(state.cost)
        added[heard] = radio_map.mean_distances(column[used], levels, self.k).reshape(-1, n)
        fade = np.exp(-1.0 / self.memory)
        gain = (added - added.min(axis=1, keepdims=True)) / self.temperature
        return state._replace(cost=self._prior + fade * (state.cost - self._prior) + gain)
