"""The methods by name: what each is, what it needs, and what it makes nothing of. No numbers, no imports: it is asked
by the command line before anything heavy is loaded.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

__all__ = ["METHODS", "NEEDS", "PAPERS", "Method"]

# what a method may need besides a site -> the option that gives it
NEEDS: Mapping[str, str] = {
    "survey": "--radio-map",
    "start": "--start",
    "places": "--access-points",  # or estimated from a survey
    "anchors": "--access-points",  # measured: ranges are as good as their anchors
}


class Method(NamedTuple):
    """A method of ``track``.

    what : one line. needs : keys of `NEEDS`. hears : the
    kinds of records it goes by besides the accelerometer; it must have one of them, except from a start. may_start :
    a start that is told helps.
    """

    what: str
    needs: tuple[str, ...] = ("survey",)
    hears: tuple[str, ...] = ("scans",)
    may_start: bool = False

    @property
    def takes_start(self) -> bool:
        """Whether a start that is told makes a difference."""
        return self.may_start or "start" in self.needs


METHODS: Mapping[str, Method] = {
    "fused": Method(
        "steps, Wi-Fi and floor plan in a particle filter; ranges, where --access-points says of what",
        hears=("scans", "pressure"),
    ),
    "fused-no-wifi": Method(
        "steps, stairs, lifts and floor plan from a known start (--start)", ("start",), ("pressure",)
    ),
    "fused-ranges": Method(
        "steps, ranges to anchors and floor plan, without a radio map", ("anchors",), ("ranges", "pressure")
    ),
    "fused-no-barometer": Method("fused as on a phone without one"),
    "fused-no-offset": Method(
        "fused that takes the phone's levels for the survey's", hears=("scans", "pressure")
    ),
    "fused-no-map": Method("fused without the floor plan", hears=("scans", "pressure")),
    "fused-no-steps": Method("fused without steps", hears=("scans", "pressure")),
    "fused-2.4ghz": Method("fused with the 2.4 GHz band alone", hears=("scans", "pressure")),
    "fused-5ghz": Method("fused with the 5 GHz band alone", hears=("scans", "pressure")),
    "random-walk": Method("particle filter without motion sensors, tuned for itself"),
    "wknn": Method("weighted k nearest neighbours, scan by scan"),
    "nnss": Method("nearest neighbour in signal space, scan by scan"),
    "pdr": Method("steps from a known start (--start)", ("start",), ()),
    "chu2009": Method(
        "Chu 2009: interpolated fingerprints, steps, walls, stairs and lifts",
        hears=("scans", "pressure"),
        may_start=True,
    ),
    "he2014": Method("He 2014: Gaussian-process radio map, adaptive motion model", may_start=True),
    "karlsson2015": Method(
        "Karlsson 2015: path loss of both bands, steps, heading unknown", ("places",), may_start=True
    ),
    "li2015": Method(
        "Li 2015: ranges to anchors with exponents 1/d, velocity", ("anchors",), ("ranges",), may_start=True
    ),
    "liu2017": Method("Liu 2017: order of access points, steps; no radio map", ("places",), may_start=True),
}
PAPERS = ("chu2009", "he2014", "karlsson2015", "li2015", "liu2017")
