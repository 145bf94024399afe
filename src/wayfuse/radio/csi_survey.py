"""From the channel state of a walk to ranges: regressions fitted on surveyed walks, then a range per anchor and packet.

The regression of `radio.ranging` is of distance on power. Fitted to single frames it would draw all ranges towards the
mean distance, for the power of a frame fades by many dB (errors in the regressor). The paper surveys points with many
packets each; on walks, frames of one anchor at about one distance are that: their median power is fitted.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from wayfuse.core.errors import RadioMapError
from wayfuse.core.types import Array, IntArray
from wayfuse.radio.csi import INTEL5300_20MHZ, direct_path_power
from wayfuse.radio.packet_groups import GroupCounts, PacketGrouper, group, group_ranges
from wayfuse.radio.ranging import RangeRegression, fit_antennas
from wayfuse.sensors.records import CsiFrame, Range, bssid_text

__all__ = ["channel_ranges", "fit_anchors"]

_BIN = 1.0  # m of distance whose frames are one point
_LEAST = 5  # frames of a point


class _Heard(NamedTuple):
    """A frame whose packet is known by its time only."""

    frame: CsiFrame
    target: int = 0
    sequence: int = -1


def fit_anchors(
    frames: Sequence[CsiFrame], distances: Array, subcarriers: IntArray = INTEL5300_20MHZ
) -> dict[int, tuple[RangeRegression, ...]]:
    """Regressions of each anchor, one per receive antenna.

    Parameters
    ----------
    frames : of surveyed walks, any anchors. distances : (n,) m, to the anchor of each frame when it was heard.

    Raises
    ------
    RadioMapError : an anchor was surveyed at fewer than two distances.
    """
    out = {}
    for anchor in sorted({frame.anchor for frame in frames}):
        mine = [k for k, frame in enumerate(frames) if frame.anchor == anchor]
        power = np.array([direct_path_power(frames[k], subcarriers) for k in mine])
        points, at = _points(power, distances[mine])
        if len(at) < 2:
            raise RadioMapError(
                f"anchor {bssid_text(anchor)} has {len(at)} surveyed distances of {_LEAST} frames and more",
                where="fit_anchors",
                remedy="survey it near and far",
            )
        out[anchor] = fit_antennas(points, at)
    return out


def channel_ranges(
    frames: Sequence[CsiFrame],
    models: Mapping[int, Sequence[RangeRegression]],
    grouper: PacketGrouper | None = None,
    subcarriers: IntArray = INTEL5300_20MHZ,
) -> tuple[tuple[Range, ...], GroupCounts]:
    """Ranges of the packets of a walk in time order, and what was late or missing.

    frames : in the order of their arrival. grouper : the default knows packets of 100 a second by their times; give one
    with a wider window for slower ones.
    """
    grouper = grouper or PacketGrouper(anchors=tuple(sorted(models)))
    packets, counts = group(grouper, [_Heard(frame) for frame in frames])
    return tuple(r for packet in packets for r in group_ranges(packet, models, subcarriers)), counts


def _points(power: Array, distances: Array) -> tuple[Array, Array]:
    """Median powers (k, antennas) dBm and mean distances (k,) m of the bins with enough frames heard."""
    heard = np.isfinite(power).any(axis=1) & np.isfinite(distances)
    power, distances = power[heard], distances[heard]
    number = np.floor(distances / _BIN)
    kept = [number == k for k in np.unique(number) if np.sum(number == k) >= _LEAST]
    powers = [[_median(column[b]) for column in power.T] for b in kept]
    return np.array(powers).reshape(-1, power.shape[1]), np.array([distances[b].mean() for b in kept])


def _median(values: Array) -> float:
    known = values[np.isfinite(values)]
    return float(np.median(known)) if len(known) else float("nan")
