r"""From channel state to the power of the direct path (li2015, Section 5.1).

The inverse Fourier transform takes the channel over frequency to the impulse response over delay; the strongest tap is
taken for the direct path. Channel state of an Intel 5300 is levelled by its gain control, so it is first normalised
and then given the received power, which is measured before the gain (``CsiFrame.rss`` has the gain taken off).

At 20 MHz a tap is 50 ns, 15 m of path, wide: indoors the strongest tap holds the direct path and most echoes, and in
line of sight its power is the received power but for a few tenths of a dB. It can shed far echoes only.

References
----------
.. [1] Li, Burbano, Zhao, Carrera, Braun, Fine-grained Indoor Tracking by Fusing Inertial Sensor and Physical Layer
   Information in WLANs, University of Bern, INF-15-004, 2015.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.errors import ConfigError
from wayfuse.core.types import Array, IntArray
from wayfuse.sensors.records import CsiFrame

__all__ = ["INTEL5300_20MHZ", "direct_path_power", "fourier_order", "impulse_response", "subcarriers_of"]

# subcarriers of the 30 groups at 20 MHz (IEEE 802.11n, grouping 2)
INTEL5300_20MHZ: IntArray = np.array([*range(-28, -1, 2), -1, *range(1, 28, 2), 28])
_TRANSFORMS = (64, 128, 256, 512)  # values of 20, 40, 80 and 160 MHz
_OVERSAMPLING = 4  # taps per 1 / bandwidth: between two of 1 / bandwidth a peak would lose up to 3.9 dB


def fourier_order(n: int) -> IntArray:
    """Subcarriers of n values in the order of a Fourier transform: 0, 1, ..., n/2 - 1, -n/2, ..., -1 (Nexmon, ESP32).

    >>> fourier_order(4).tolist()
    [0, 1, -2, -1]
    """
    return np.asarray((np.arange(n) + n // 2) % n - n // 2)


def subcarriers_of(n: int) -> IntArray:
    """Subcarriers of channel state of n values: the groups of an Intel 5300, else the order of a Fourier transform.

    Raises
    ------
    ConfigError : no card that is known gives so many.
    """
    if n == len(INTEL5300_20MHZ):
        return INTEL5300_20MHZ
    if n not in _TRANSFORMS:
        raise ConfigError(
            f"channel state of {n} subcarriers", remedy=f"30 (Intel 5300) and {_TRANSFORMS} are known"
        )
    return fourier_order(n)


def impulse_response(
    csi: NDArray[np.complexfloating], subcarriers: IntArray = INTEL5300_20MHZ
) -> NDArray[np.complex128]:
    """Channel impulse response (..., m) of channel state (..., n) at ``subcarriers`` (n,).

    m is four times the subcarriers of the channel: 256 taps at 20 MHz, 12.5 ns apart over the 3.2 µs of a symbol, in
    any rotation, for a receiver's timing is arbitrary. Of a channel with one path the greatest magnitude is that of
    the channel.

    Raises
    ------
    ConfigError : the last axis is not that of the subcarriers.
    """
    if csi.shape[-1] != len(subcarriers):
        raise ConfigError(f"channel state of {csi.shape[-1]} subcarriers, {len(subcarriers)} expected")
    n = _OVERSAMPLING * (
        1 << int(2 * np.abs(subcarriers).max() - 1).bit_length()
    )  # 64, 128, 256 of 20, 40, 80 MHz
    spectrum = np.zeros((*csi.shape[:-1], n), dtype=np.complex128)
    spectrum[..., subcarriers % n] = csi
    return np.asarray(np.fft.ifft(spectrum, axis=-1) * (n / len(subcarriers)))


def direct_path_power(frame: CsiFrame, subcarriers: IntArray = INTEL5300_20MHZ) -> Array:
    """Power of the direct path at each receive antenna (n_rx,), dBm; NaN where an antenna heard nothing.

    Powers of several transmit antennas are added.
    """
    csi = frame.csi.astype(np.complex128)
    mean_square = float((np.abs(csi) ** 2).sum()) / csi.shape[-1]
    if mean_square == 0.0 or not np.isfinite(frame.rss):
        return np.full(csi.shape[0], np.nan)
    taps = np.abs(impulse_response(csi, subcarriers)) ** 2
    relative = taps.max(axis=-1).sum(axis=-1) / mean_square
    with np.errstate(divide="ignore"):
        power = frame.rss + 10.0 * np.log10(relative)
    return np.where(relative > 0.0, power, np.nan)
