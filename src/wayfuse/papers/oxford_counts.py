"""Step counters of the papers on the counted validation walks of oxford-steps, by how the phone was carried."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from wayfuse.formats.oxford_steps import validation_walks
from wayfuse.papers.reproduction import Interval, Table
from wayfuse.sensors.recording import Series

__all__ = ["step_count_table"]


def step_count_table(root: Path, count: Callable[[Series], int], note: str) -> Table:
    """Mean absolute error of the counts, and the mean with its sign; or that there are no data."""
    title = "Real data: step counts on the validation walks of oxford-steps"
    if not (root / "oxford-steps").is_dir():
        return Table(
            title, ("not measured",), (("`wayfuse datasets fetch oxford-steps` gets the data set",),)
        )
    errors: dict[str, list[float]] = {}
    for walk in validation_walks(root / "oxford-steps"):
        errors.setdefault(walk.position, []).append(count(walk.recording.acceleration) / walk.steps - 1.0)
    groups = {
        **{name: errors[name] for name in sorted(errors)},
        "all": [e for of in errors.values() for e in of],
    }
    rows: list[tuple[str | float | Interval, ...]] = [
        (name, str(len(of)), f"{100.0 * np.mean(np.abs(of)):.1f} %", f"{100.0 * np.mean(of):+.1f} %")
        for name, of in groups.items()
    ]
    return Table(title, ("carried", "walks", "mean absolute error", "mean error"), tuple(rows), note)
