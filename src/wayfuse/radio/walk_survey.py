"""A survey from walks with waypoints: fingerprints every second along the walked lines.

Between two waypoints the surveyor walks a straight line at an even pace, so a place is linear in time. A fingerprint
at a moment is the weighted mean of the readings heard around it: from ``before`` seconds earlier to ``after`` seconds
later, weighted by exp(-|dt| / ``decay``). Readings later than the moment are used too: a survey is made offline.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, dataclass, replace
from os import PathLike
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.errors import RadioMapError
from wayfuse.core.types import Array
from wayfuse.radio.archive import read_archive, write_archive
from wayfuse.radio.device_survey import device_shifts, normalised
from wayfuse.radio.novelty import usual_distances
from wayfuse.radio.scans import Readings, readings
from wayfuse.radio.survey import Survey
from wayfuse.radio.survey_accuracy import survey_accuracy
from wayfuse.radio.survey_file import survey_from_parts, survey_parts
from wayfuse.sensors.records import WifiScan

__all__ = ["SurveyParameters", "SurveyWalk", "WalkRadioMap", "load", "survey_from_walks"]

KIND = "walk-radio-map"
VERSION = 1


@dataclass(frozen=True, slots=True, kw_only=True)
class SurveyParameters:
    """How readings become fingerprints (chosen on the ms-indoor survey; accuracy notes in docs/results.md)."""

    spacing: float = 1.0  # s between fingerprints
    before: float = 4.0  # s
    after: float = 2.0  # s
    decay: float = 1.5  # s
    min_readings: int = 3  # access points; fewer say nothing about a place
    normalise_devices: bool = True  # bring all phones to the levels of the commonest (`device_survey`)


class SurveyWalk(NamedTuple):
    """A walk whose places are known: waypoint times (k,) s ascending, places (k, 2) m, floors (k,), and its scans.

    ``device`` is the phone's model, empty where not known.

    Between waypoints on different floors the place is not known: nothing is taken from there.
    """

    name: str
    t: Array
    xy: Array
    floor: NDArray[np.int32]
    scans: tuple[WifiScan, ...]
    device: str = ""


def survey_from_walks(
    walks: Iterable[SurveyWalk], floors: tuple[str, ...], parameters: SurveyParameters | None = None
) -> Survey:
    """Build a survey; walks without two waypoints or without Wi-Fi give nothing.

    Raises
    ------
    RadioMapError : no walk gave a fingerprint.
    """
    p = parameters or SurveyParameters()
    rows: list[tuple[NDArray[np.uint64], NDArray[np.float32]]] = []
    places: list[Array] = []
    floor: list[int] = []
    owner: list[int] = []
    names: list[str] = []
    devices: list[str] = []
    channel: dict[int, dict[int, int]] = {}
    for walk in walks:
        if len(walk.t) < 2 or not walk.scans:
            continue
        heard = readings(walk.scans)
        _count_channels(heard, channel)
        names.append(walk.name)
        devices.append(walk.device)
        for t in np.arange(walk.t[0], walk.t[-1] + 1e-9, p.spacing):
            leg = min(int(np.searchsorted(walk.t, t, side="right")) - 1, len(walk.t) - 2)
            if walk.floor[leg] != walk.floor[leg + 1]:
                continue
            row = _fingerprint(heard, float(t), p)
            if row is None:
                continue
            rows.append(row)
            places.append(
                np.array([np.interp(t, walk.t, walk.xy[:, 0]), np.interp(t, walk.t, walk.xy[:, 1])])
            )
            floor.append(int(walk.floor[leg]))
            owner.append(len(names) - 1)
    if not rows:
        raise RadioMapError(
            "no fingerprint: no recording has both Wi-Fi scans and two waypoints",
            remedy="give survey recordings",
        )
    bssid = np.unique(np.concatenate([ids for ids, _ in rows]))
    survey = Survey(
        bssid=bssid,
        frequency=np.array([_commonest(channel[int(b)]) for b in bssid], np.int32),
        xy=np.array(places),
        floor=np.array(floor, np.int32),
        walk=np.array(owner, np.int32),
        indptr=np.concatenate([[0], np.cumsum([len(ids) for ids, _ in rows])]).astype(np.int64),
        indices=np.searchsorted(bssid, np.concatenate([ids for ids, _ in rows])).astype(np.int32),
        rssi=np.concatenate([values for _, values in rows]),
        floors=floors,
        walks=tuple(names),
    )
    if p.normalise_devices:
        survey = normalised(survey, devices, device_shifts(survey, devices)[1])
    return replace(survey, accuracy=survey_accuracy(survey), usual=usual_distances(survey))


def _fingerprint(
    heard: Readings, t: float, p: SurveyParameters
) -> tuple[NDArray[np.uint64], NDArray[np.float32]] | None:
    i, j = np.searchsorted(heard.t, (t - p.before, t + p.after))
    if j - i < p.min_readings:
        return None
    ids, inverse = np.unique(heard.bssid[i:j], return_inverse=True)
    if len(ids) < p.min_readings:
        return None
    weight = np.exp(-np.abs(heard.t[i:j] - t) / p.decay)
    mean = np.bincount(inverse, weight * heard.rssi[i:j]) / np.bincount(inverse, weight)
    return ids, mean.astype(np.float32)


def _count_channels(heard: Readings, channel: dict[int, dict[int, int]]) -> None:
    frequency = np.maximum(heard.frequency, 0).astype(np.uint64)  # a negative channel is an unknown one
    pairs, counts = np.unique(np.stack([heard.bssid, frequency]), axis=1, return_counts=True)
    for (b, f), n in zip(pairs.T.tolist(), counts.tolist(), strict=True):
        of = channel.setdefault(b, {})
        of[f] = of.get(f, 0) + n


def _commonest(counts: dict[int, int]) -> int:
    return max(counts.items(), key=lambda item: (item[1], -item[0]))[0]


@dataclass(frozen=True, slots=True, eq=False)
class WalkRadioMap:
    """What ``wayfuse survey build`` saves: a survey, how it was made, and for which site."""

    survey: Survey
    parameters: SurveyParameters
    site: str = ""

    def save(self, path: str | PathLike[str]) -> None:
        """Write one versioned archive (npz of plain arrays with a JSON header)."""
        header, arrays = survey_parts(self.survey)
        made = {"site": self.site, "parameters": asdict(self.parameters), "survey": header}
        write_archive(path, KIND, VERSION, made, arrays)


def load(path: str | PathLike[str]) -> WalkRadioMap:
    """Read a radio map; RadioMapError on a damaged, foreign or newer file."""
    _, header, arrays = read_archive(path, KIND, version=VERSION)
    try:
        made = SurveyParameters(**header["parameters"])
        site = str(header["site"])
        survey_header = dict(header["survey"])
    except (KeyError, TypeError) as fault:
        raise RadioMapError(
            f"header lacks {fault}", where=path, remedy="build the radio map anew with `wayfuse survey build`"
        ) from fault
    return WalkRadioMap(survey_from_parts(survey_header, arrays, path), made, site)
