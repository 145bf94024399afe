"""Figures of the inertial front end on real walks: step lengths, heading sources, step counts, speed.

``python -m benchmarks.inertial [DATA_ROOT]`` reads the survey walks of ms-indoor (those whose digest of the
file stem modulo 10 is at least 2), all logs of ipin2023-track3 and the validation walks of oxford-steps, and
prints the tables quoted in `wayfuse.inertial`. Coefficients are fitted on ms-indoor alone.
"""

from __future__ import annotations

import argparse
import os
import time
from dataclasses import replace
from hashlib import sha256
from pathlib import Path

import numpy as np

from wayfuse.core.angles import circular_mean, wrap
from wayfuse.core.frames import GeoAnchor
from wayfuse.evaluation.step_counts import score
from wayfuse.formats.reading import read
from wayfuse.inertial.calibration import straight_segments
from wayfuse.inertial.front_end import InertialConfig, InertialFrontEnd
from wayfuse.inertial.step_length import MODELS, fit
from wayfuse.sensors.recording import Recording, Series


def survey_walks(root: Path) -> list[Recording]:
    paths = sorted((root / "ms-indoor").glob("site1/*/path_data_files/*.txt"))
    return [read(p) for p in paths if int(sha256(p.stem.encode()).hexdigest(), 16) % 10 >= 2]


def museum_walks(root: Path) -> list[Recording]:
    anchor = GeoAnchor.from_origin(11.11, 49.46)
    walks = [read(p) for p in sorted((root / "ipin2023-track3").rglob("*Trial*.txt"))]
    for i, walk in enumerate(walks):
        places = [anchor.to_xy((w.lon, w.lat)) for w in walk.waypoints]
        points = [w._replace(x=p[0], y=p[1]) for w, p in zip(walk.waypoints, places, strict=True)]
        walks[i] = replace(walk, waypoints=tuple(points))
    return walks


def step_lengths(survey: list[Recording], museum: list[Recording]) -> None:
    print("step length: model, median / 90 % error of held-out walks, of ipin2023-track3, coefficients")
    for name in MODELS:
        near, far = straight_segments(survey, name), straight_segments(museum, name)
        error = np.empty(len(near.distance))
        for fold in range(5):
            out = near.walk % 5 == fold
            model = fit(name, near.summed[~out], near.distance[~out])
            error[out] = near.summed[out] @ np.asarray(model.coefficients) / near.distance[out] - 1
        model = fit(name, near.summed, near.distance)
        other = far.summed @ np.asarray(model.coefficients) / far.distance - 1
        e, o = (100 * np.percentile(np.abs(v), (50, 90)) for v in (error, other))
        print(
            f"  {name:11s}{e[0]:5.1f} /{e[1]:5.1f} ({len(error)})   {o[0]:5.1f} /{o[1]:5.1f} ({len(other)}), "
            f"mean {100 * other.mean():+.1f}   {tuple(round(c, 4) for c in model.coefficients)}"
        )


def headings(label: str, walks: list[Recording]) -> None:
    print(f"heading, deg, {label}: error median, 90 % | between, within walks | turn error median, 90 %")
    bare = [replace(w, orientation=Series.empty(4)) for w in walks]
    still = [replace(w, rotation_rate=Series.empty(3)) for w in bare]
    relative = [replace(w, magnetic_field=Series.empty(3)) for w in bare]
    direct = InertialConfig(heading_source="orientation")
    taus = (5.0, 10.0, 20.0, 40.0)
    sources = [
        ("rotation vector", walks, direct),
        *((f"pulled, {tau:.0f} s", walks, InertialConfig(heading_tau=tau)) for tau in taus),
        ("pulled, no bias", walks, InertialConfig(bias_drift=1e9)),
        ("own 9-axis", bare, direct),
        ("own 9-axis, pulled", bare, InertialConfig()),
        ("magnetometer", still, direct),
        ("gyro alone, relative", relative, InertialConfig()),
    ]
    for name, recordings, config in sources:
        s = straight_segments(recordings, "constant", config)
        error = wrap(s.heading - s.direction)
        turn = np.abs(wrap(np.diff(error)))[np.diff(s.walk) == 0]
        groups = [g for w in np.unique(s.walk) if len(g := error[s.walk == w]) > 1]
        means = np.array([circular_mean(g) for g in groups])
        within = [wrap(g - m) * np.sqrt(len(g) / (len(g) - 1)) for g, m in zip(groups, means, strict=True)]
        spread = (means.std(), np.concatenate(within).std())
        absolute = np.percentile(np.abs(error), (50, 90))
        d = np.degrees([*absolute, *spread, *np.percentile(turn, (50, 90))])
        print(f"  {name:22s}{d[0]:6.1f}{d[1]:6.1f} |{d[2]:6.1f}{d[3]:6.1f} |{d[4]:6.1f}{d[5]:6.1f}")


def speed(walks: list[Recording]) -> None:
    front_end = InertialFrontEnd()
    best = []
    for _ in range(3):
        start = time.perf_counter()
        for walk in walks:
            front_end.run(front_end.init(), walk)
        best.append(time.perf_counter() - start)
    seconds = sum(w.span[1] - w.span[0] for w in walks)
    walk, state = walks[0], front_end.init()
    records = [r for r in walk.records() if r.t < walk.span[0] + 30]
    start = time.perf_counter()
    for record in records:
        state, _ = front_end.step(state, record)
    each = (time.perf_counter() - start) / len(records)
    print(f"speed: {1e3 * min(best) / seconds:.3f} ms per second of walk, {1e6 * each:.1f} us per record")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    default = os.environ.get("WAYFUSE_DATA") or Path.home() / ".cache" / "wayfuse-data"
    parser.add_argument("root", nargs="?", type=Path, default=Path(default))
    root = parser.parse_args().root
    survey, museum = survey_walks(root), museum_walks(root)
    step_lengths(survey, museum)
    headings("ms-indoor survey walks", survey)
    headings("ipin2023-track3", museum)
    print("steps of the oxford-steps validation walks")
    print("\n".join(f"  {line}" for line in score(root / "oxford-steps").describe()))
    speed(survey)


if __name__ == "__main__":
    main()
