"""Channel state as an Intel 5300 card reports it: 30 groups of subcarriers of a 20 MHz channel, levelled, in 8 bits.

The card's gain control brings the strongest part to the same size whatever the level; RSSI per antenna and the gain
say what the level was. Its sampling starts at a random moment and phase. Every ``coherence_m`` of the walk the channel
is drawn anew (`wayfuse.simulator.multipath`), or taken anew from the rays where they were traced
(`wayfuse.simulator.rays`); packets are lost where no ray arrives.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.types import Array, IntArray
from wayfuse.sensors.records import CsiFrame
from wayfuse.simulator.multipath import MultipathModel, Taps, draw_taps, response
from wayfuse.simulator.radio_field import RadioField
from wayfuse.simulator.scanner import level_at
from wayfuse.simulator.toml_tables import no_negative, require
from wayfuse.simulator.walker import Walk

__all__ = ["GROUPS", "ChannelModel", "measure_channels", "through_card"]

GROUPS: IntArray = np.array(
    [*range(-28, -1, 2), -1, *range(1, 28, 2), 28]
)  # IEEE 802.11n, 20 MHz, grouping 2
_SPACING = 312_500.0  # Hz between subcarriers
_OFFSETS: Array = _SPACING * GROUPS.astype(np.float64)
_FULL = 100.0  # of the 8-bit numbers: what the gain control aims at, some room left
_AIM = 36.0  # the card's RSSI units that its gain aims at
_OFFSET = 44.0  # from RSSI units to dBm, with the gain
_MOST_GAIN = 90.0  # dB


@dataclass(frozen=True, slots=True, kw_only=True)
class ChannelModel:
    """Packets and card."""

    period_s: float = 0.0  # s between packets of each access point; 0: no channel state
    n_antennas: int = 3  # that receive
    band: int = 1  # 0: 2.4 GHz, 1: 5 GHz
    noise_dbm: float = -92.0  # at each of them
    weakest_dbm: float = -85.0  # packets below are lost
    timing_ns: float = 50.0  # largest error of the start of sampling
    coherence_m: float = 0.5  # m of way after which the channel is drawn anew
    multipath: MultipathModel = field(default_factory=MultipathModel)

    def __post_init__(self) -> None:
        no_negative(self, but=("noise_dbm", "weakest_dbm"))
        require("n_antennas", 1 <= self.n_antennas <= 3, self.n_antennas, "1, 2 or 3")
        require("band", self.band in (0, 1), self.band, "0 for 2.4 GHz or 1 for 5 GHz")
        require("coherence_m", self.coherence_m > 0.0, self.coherence_m, "a positive length in m")


def through_card(
    h: NDArray[np.complex128],
    level: float,
    t: float,
    anchor: int,
    model: ChannelModel,
    rng: np.random.Generator,
) -> CsiFrame:
    """The record of a channel h (n_rx, 30) of mean power 1 over places, at a mean level (dBm)."""
    milliwatt, noise = 10.0 ** (0.1 * level), 10.0 ** (0.1 * model.noise_dbm)
    white = rng.normal(size=(2, *h.shape)) * np.sqrt(0.5 * noise)
    late = rng.uniform(-model.timing_ns, model.timing_ns)
    turn = np.exp(-2j * np.pi * (1e-9 * late * _OFFSETS + rng.random()))
    received = np.sqrt(milliwatt) * h * turn + white[0] + 1j * white[1]
    per_antenna = 10.0 * np.log10(np.mean(np.abs(received) ** 2, axis=1))
    agc = float(np.clip(np.round(_AIM - _OFFSET - per_antenna.max()), 0.0, _MOST_GAIN))
    units = np.maximum(np.round(per_antenna + _OFFSET + agc), 1.0)
    rss = float(10.0 * np.log10(np.sum(10.0 ** (0.1 * units)))) - _OFFSET - agc
    scale = _FULL / max(float(np.abs(received.real).max()), float(np.abs(received.imag).max()))
    whole = np.round(received.real * scale) + 1j * np.round(received.imag * scale)
    return CsiFrame(t, anchor, whole[:, None, :].astype(np.complex64), rss, agc, model.noise_dbm)


def measure_channels(
    walk: Walk, radios: RadioField, model: ChannelModel, rng: np.random.Generator
) -> tuple[CsiFrame, ...]:
    """The channel state a card gathers on a walk, in order of time (s from the walk's start)."""
    sending = np.flatnonzero(radios.band == model.band)
    if not model.period_s or not len(sending):
        return ()
    rounds = np.arange(rng.uniform(0.0, model.period_s), walk.duration, model.period_s)
    frames: list[CsiFrame] = []
    for radio in sending.tolist():
        t = np.round(rounds + rng.uniform(0.0, 0.5 * model.period_s), 6)
        frames += _packets(walk, radios, radio, t[t <= walk.duration], model, rng)
    return tuple(sorted(frames, key=lambda frame: frame.t))


def _packets(
    walk: Walk, radios: RadioField, radio: int, t: Array, model: ChannelModel, rng: np.random.Generator
) -> list[CsiFrame]:
    """Packets of one radio at times t (n,)."""
    xy = np.column_stack([np.interp(t, walk.t, walk.xy[:, k]) for k in (0, 1)])
    every = np.full(len(t), radio)
    level = level_at(walk, radios, every, xy, t)
    grid = np.clip(np.searchsorted(walk.t, t), 0, len(walk.t) - 1)
    floor = np.zeros(len(t), dtype=np.int64) if walk.climb is None else walk.climb.floor[grid]
    gone = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(walk.xy, axis=0).T))])[grid]
    anchor = int(radios.bssid[np.searchsorted(radios.radio, radio)])
    frames, taps, drawn_at = [], None, -np.inf
    for k in np.flatnonzero(level >= model.weakest_dbm).tolist():
        if taps is None or gone[k] - drawn_at >= model.coherence_m:
            taps, drawn_at = _taps(radios, radio, xy[k], int(floor[k]), model, rng), gone[k]
        if taps is None:
            continue
        h = response(taps, _OFFSETS, 1e6 * float(radios.frequency[radio]), model.n_antennas)
        frames.append(through_card(h, float(level[k]), float(t[k]), anchor, model, rng))
    return frames


def _taps(
    radios: RadioField, radio: int, xy: Array, floor: int, model: ChannelModel, rng: np.random.Generator
) -> Taps | None:
    """The channel at a place: the direct path is weaker behind walls. None: no ray arrives."""
    if radios.rays is not None:
        taps = radios.rays.channels[floor].taps(radio, xy)
        return None if taps is None else taps._replace(delay=taps.delay - taps.delay.min())
    ap = int(radios.ap[radio])
    one = np.array([ap])
    n_walls = float(radios.walls_between(one, xy[None], floor).sum() + radios.slabs(one, xy[None], floor)[0])
    to = radios.ap_xy[ap] - xy
    rice = model.multipath.rice_db - model.multipath.wall_rice_db * n_walls
    return draw_taps(model.multipath, rice, float(np.arctan2(to[1], to[0])), rng)
