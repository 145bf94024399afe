"""The development walks of ms-indoor through HTTP, in a phone's batches, against the same walks tracked at once.

    python -m benchmarks.server_replay [--page]

Every number of every estimate that the server gives out is compared with `Tracker.run` (what `wayfuse track` does with
a recording) under the track's name: equal means the same bits. Every second walk is sent again with batches exchanged
and repeated, as bad networks do it.
"""

from __future__ import annotations

import argparse
import csv
import http.client
import io
import json
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from benchmarks.report import machine
from benchmarks.server_page import table, write_section
from benchmarks.server_process import Process, Scene, development, serving
from wayfuse.presets.methods import build_method
from wayfuse.sensors.recording import Recording
from wayfuse.service.replay import envelopes
from wayfuse.service.wire import encode
from wayfuse.tracking.estimate import Estimate

__all__ = ["Compared", "compare", "exported", "posted", "said_of", "wait_applied"]

_SEED = 11
_COLUMNS = ("t", "x", "y", "floor", "cov_xx", "cov_xy", "cov_yy", "radius_68", "radius_95")
_SWAPPED = 0.2  # share of batches that overtake the one before, in the walks sent badly
_REPEATED = 0.1


@dataclass(frozen=True, slots=True)
class Compared:
    """Counts of one way of sending. differing : estimates that are missing, too many, or have another bit."""

    walks: int
    batches: int
    records: int
    estimates: int
    differing: int


def posted(server: Process, bodies: Sequence[bytes]) -> tuple[str, int, int]:
    """Post bodies one after the other; the track, the last place in the log, and records taken."""
    connection = http.client.HTTPConnection(server.host, server.port, timeout=60.0)
    headers = {"Authorization": f"Bearer {server.token}", "Content-Type": "application/json"}
    track, seq, records = "", 0, 0
    for body in bodies:
        connection.request("POST", "/api/v1/in/own", body, headers)
        answer = connection.getresponse()
        said = answer.read()
        if answer.status != 200:
            raise RuntimeError(f"{answer.status}: {said[:200]!r}")
        accepted = json.loads(said)["accepted"][0]
        track, seq = accepted["track"], accepted["seq"]
        records += accepted["records"]
    connection.close()
    return track, seq, records


def compare(scene: Scene, walks: Sequence[Recording], server: Process, *, badly: bool) -> Compared:
    """Send walks and compare what comes out."""
    tracker = build_method("fused", scene.site, scene.survey)
    draw = np.random.default_rng(_SEED)
    batches = records = estimates = differing = 0
    for walk in walks:
        bodies = [encode(e) for e in envelopes(walk, f"phone {badly}", walk.name, 1.0)]
        track, seq, taken = posted(server, _shuffled(bodies, draw) if badly else bodies)
        wait_applied(server, seq)
        expected = [said_of(e) for e in tracker.run(replace(walk, name=track)).estimates]
        got = exported(server, track)
        batches, records = batches + len(bodies), records + taken
        estimates += len(expected)
        differing += sum(a != b for a, b in zip(got, expected, strict=False)) + abs(len(got) - len(expected))
    return Compared(len(walks), batches, records, estimates, differing)


def _shuffled(bodies: Sequence[bytes], draw: np.random.Generator) -> list[bytes]:
    """Neighbours exchanged and batches sent twice; the last stays last, for it ends the track."""
    out = list(bodies)
    for n in range(1, len(out) - 2):
        if draw.random() < _SWAPPED:
            out[n], out[n + 1] = out[n + 1], out[n]
    doubled = []
    for body in out[:-1]:
        doubled += [body] * (1 + int(draw.random() < _REPEATED))
    return [*doubled, out[-1]]


def wait_applied(server: Process, seq: int) -> None:
    """Until an entry of the log is in the tracks."""
    end = time.monotonic() + 60.0
    while json.loads(server.get("/health"))["applied"] < seq:
        if time.monotonic() > end:
            raise RuntimeError("the server does not take what it accepted")
        time.sleep(0.01)


def exported(server: Process, track: str) -> list[tuple[object, ...]]:
    """All estimates of a track as the server gives them out."""
    rows = csv.DictReader(io.StringIO(server.get(f"/api/v1/tracks/{track}/export?format=csv").decode()))
    return [
        (*(float(r[n]) for n in _COLUMNS), r["state"], int(r["steps"]), int(r["access_points"])) for r in rows
    ]


def said_of(e: Estimate) -> tuple[object, ...]:
    """An estimate in the order of `exported`."""
    return (*map(float, e[:9]), e.state.value, e.n_steps, e.n_aps)


def main(arguments: list[str] | None = None) -> list[Compared]:
    """Compare, print, and write the section of the page."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--page", action="store_true", help="write docs/server-performance.md")
    options = parser.parse_args(arguments)
    before = machine()
    with tempfile.TemporaryDirectory() as folder:
        scene = development(Path(folder))
        with serving(scene, Path(folder) / "data") as server:
            done = [
                compare(scene, scene.walks, server, badly=False),
                compare(scene, scene.walks[::2], server, badly=True),
            ]
    rows = [
        (how, c.walks, c.batches, c.records, c.estimates, c.differing)
        for how, c in zip(("in order", "overtaken and repeated"), done, strict=True)
    ]
    text = (
        "Exactness: the same bits over HTTP\n\nDevelopment walks of ms-indoor (share 1), posted to a server in batches "
        "of one second; each estimate compared with `Tracker.run`: time, place, covariance, radii, state, steps and "
        f"access points. Of the walks sent badly, {100 * _SWAPPED:.0f} % of batches come after the next and "
        f"{100 * _REPEATED:.0f} % twice (seed {_SEED}).\n\n"
        + table(("batches sent", "walks", "batches", "records", "estimates", "estimates that differ"), rows)
    )
    print(text)
    if options.page:
        write_section("replay", "python -m benchmarks.server_replay --page", before, text)
    return done


if __name__ == "__main__":
    sys.exit(int(any(c.differing for c in main())))
