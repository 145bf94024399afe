"""How many phones one core can follow: motion sensors at 50 Hz, a second at a time or record by record.

    python -m benchmarks.streaming [--seconds 6]

Each of many phones has a state of its own and sends acceleration, rotation rate and magnetic field; they take turns, so
that no state stays in a cache. The signals are made up: a gait of two steps a second with noise.
"""

from __future__ import annotations

import argparse

import numpy as np

from benchmarks.report import Table, Target
from benchmarks.timing import race
from wayfuse.inertial.front_end import InertialFrontEnd
from wayfuse.inertial.vertical_front_end import VerticalFrontEnd
from wayfuse.sensors.recording import Recording, Series

__all__ = ["measure"]

PHONES = 400
RATE = 50.0  # Hz, each sensor
SPAN = 60.0  # s of signal


def made_up_phone(seed: int) -> Recording:
    """A minute of a phone in the hand of somebody who walks, with a barometer."""
    rng = np.random.default_rng(seed)

    def series(mean: tuple[float, ...], noise: float, rate: float = RATE) -> Series:
        t = np.arange(0.0, SPAN, 1.0 / rate) + 1e-3 * rng.random()
        return Series(t, np.array(mean) + noise * rng.standard_normal((len(t), len(mean))))

    acceleration = series((0.0, 4.7, 8.6), 0.3)
    gait = 3.0 * np.sin(2 * np.pi * 2.0 * acceleration.t + rng.uniform(0, 6))
    moving = Series(acceleration.t, acceleration.values + gait[:, None] * np.array([0.0, 0.48, 0.88]))
    return Recording(
        f"phone {seed}",
        acceleration=moving,
        rotation_rate=series((0.0, 0.0, 0.0), 0.05),
        magnetic_field=series((0.0, 22.0, -40.0), 0.5),
        pressure=series((1000.0,), 0.02, 5.0),
    )


def measure(seconds: float) -> tuple[list[Table], list[Target]]:
    """The table of front ends and the goal."""
    walks = [made_up_phone(seed) for seed in range(8)]
    steps, vertical = InertialFrontEnd(), VerticalFrontEnd()
    states = [steps.init() for _ in range(PHONES)]
    levels = [vertical.init() for _ in range(PHONES)]
    feet = [steps.run(steps.init(), walk)[1] for walk in walks]
    assert min(len(f.t) for f in feet) > 0.8 * 2.0 * SPAN
    clock = {"seconds": 0, "levels": 0, "records": 0}

    def one_second() -> None:
        k = clock["seconds"]
        clock["seconds"] += 1
        phone, at = k % PHONES, float((k // PHONES) % SPAN)
        start = states[phone] if at else steps.init()
        states[phone], _ = steps.run(start, walks[phone % len(walks)], at - 1e-9, at + 1.0 - 1e-9)

    def one_second_of_levels() -> None:
        k = clock["levels"]
        clock["levels"] += 1
        phone, at = k % PHONES, float((k // PHONES) % SPAN)
        start = levels[phone] if at else vertical.init()
        walk = phone % len(walks)
        levels[phone], _ = vertical.run(start, walks[walk], feet[walk], at - 1e-9, at + 1.0 - 1e-9)

    records = [list(walk.records())[: int(3 * RATE)] for walk in walks]

    def record_by_record() -> None:
        state = steps.init()
        for record in records[clock["records"] % len(walks)]:
            state, _ = steps.step(state, record)
        clock["records"] += 1

    taken = race(
        {"steps and heading, a second at a time": one_second,
         "stairs and lifts, a second at a time": one_second_of_levels,
         "steps and heading, record by record": record_by_record},
        seconds=seconds,
    )  # fmt: skip
    rows = []
    for name, t in taken.items():
        rows.append(
            (
                name,
                f"{t.least * 1e6:,.0f} ({t.median * 1e6:,.0f})",
                f"{1 / t.least:,.0f} ({1 / t.median:,.0f})",
            )
        )
    first = taken["steps and heading, a second at a time"]
    note = f"CPU of a phone-second (150 samples) and the phones that fill a core; {PHONES} phones take turns."
    goal = Target("phones at 50 Hz per core, steps and heading, median", 5000.0, 1.0 / first.median, "phones")
    return [Table("Streaming front ends", note, ("front end", "us", "phones per core"), tuple(rows))], [goal]


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seconds", type=float, default=6.0)
    tables, goals = measure(parser.parse_args().seconds)
    print(*tables[0].rows, *goals, sep="\n")


if __name__ == "__main__":
    main()
