"""The regressions of a site's anchors from the power of the direct path to range, fitted on surveyed walks, on disk."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from os import PathLike

import numpy as np

from wayfuse.core.errors import RadioMapError
from wayfuse.core.types import Array, IntArray
from wayfuse.radio.archive import read_archive, write_archive
from wayfuse.radio.csi import subcarriers_of
from wayfuse.radio.csi_survey import fit_anchors
from wayfuse.radio.ranging import RangeRegression
from wayfuse.sensors.records import CsiFrame

__all__ = ["ChannelModel", "fit_channel_model", "load_channel_model"]

_KIND, _VERSION = "channel-model", 1


@dataclass(frozen=True, slots=True, eq=False)
class ChannelModel:
    """What ``wayfuse survey channel`` saves.

    Parameters
    ----------
    anchors : regressions of each, one per receive antenna. subcarriers : (n,) of the frames. site : its name.
    """

    anchors: Mapping[int, tuple[RangeRegression, ...]]
    subcarriers: IntArray
    site: str = ""

    def save(self, path: str | PathLike[str]) -> None:
        """Write one versioned archive."""
        width = max((len(antennas) for antennas in self.anchors.values()), default=0)
        table = np.full((len(self.anchors), width, 2), np.nan)
        for row, antennas in zip(table, self.anchors.values(), strict=True):
            row[: len(antennas)] = antennas
        ids = np.array(list(self.anchors), np.uint64)
        arrays = {"anchor": ids, "regressions": table, "subcarriers": np.asarray(self.subcarriers, np.int64)}
        write_archive(path, _KIND, _VERSION, {"site": self.site}, arrays)


def fit_channel_model(frames: Sequence[CsiFrame], distances: Array, site: str = "") -> ChannelModel:
    """Fit all anchors of frames (n) of surveyed walks, heard at distances (n,) m; NaN where that is unknown.

    Raises
    ------
    RadioMapError : no frame, frames of several kinds of card, or an anchor surveyed at fewer than two distances.
    """
    widths = {frame.csi.shape[-1] for frame in frames}
    if len(widths) != 1:
        what = "no channel state" if not widths else f"channel state of {sorted(widths)} subcarriers"
        raise RadioMapError(
            what, where="fit_channel_model", remedy="give recordings with channel state of one kind of card"
        )
    subcarriers = subcarriers_of(widths.pop())
    return ChannelModel(fit_anchors(frames, distances, subcarriers), subcarriers, site)


def load_channel_model(path: str | PathLike[str], of: str = "") -> ChannelModel:
    """Read a channel model; RadioMapError on a damaged, foreign or newer file, or one not of the site ``of``."""
    _, header, arrays = read_archive(path, _KIND, version=_VERSION)
    try:
        ids, table, subcarriers = arrays["anchor"], arrays["regressions"], arrays["subcarriers"]
        if ids.ndim != 1 or table.shape[:1] != ids.shape or table.shape[2:] != (2,) or subcarriers.ndim != 1:
            raise ValueError
        if ids.dtype != np.uint64 or table.dtype.kind != "f" or subcarriers.dtype.kind != "i":
            raise ValueError
        site = str(header["site"])
    except (KeyError, ValueError) as fault:
        raise RadioMapError(
            "not a channel model of this version",
            where=path,
            remedy="make it again: `wayfuse survey channel`",
        ) from fault
    if of and site != of:
        raise RadioMapError(
            f"channel model of site {site}, not of {of}", where=path, remedy="make one with this site"
        )
    anchors = {
        int(anchor): tuple(
            RangeRegression(*antenna) for antenna in row.tolist() if np.isfinite(antenna).all()
        )
        for anchor, row in zip(ids.tolist(), table, strict=True)
    }
    return ChannelModel(anchors, subcarriers, site)
