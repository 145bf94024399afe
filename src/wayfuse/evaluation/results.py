"""Every figure of docs/results.md, measured afresh: one section per data set.

A section whose data are not there whole is not measured, and says why; nothing stands in for them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from wayfuse.core.errors import UsageError
from wayfuse.evaluation.report import plain
from wayfuse.evaluation.results_folds import FOLDS, Folds, Mapper, gather, in_turn
from wayfuse.evaluation.results_ms_indoor import measure_ms_indoor
from wayfuse.evaluation.results_speed import measure_speed
from wayfuse.evaluation.results_static import measure_static
from wayfuse.evaluation.results_steps import measure_steps
from wayfuse.formats.datasets import manifest

__all__ = ["SECTIONS", "absent", "measure"]

# section -> the data set it needs
SECTIONS: Mapping[str, str] = {
    "ms-indoor": "ms-indoor",
    "speed": "ms-indoor",
    "sodindoorloc": "sodindoorloc",
    "oxford-steps": "oxford-steps",
}
_NEEDED = (".txt", ".json", ".csv")  # pictures and sheets of a data set are not measured on


def measure(root: Path, only: Sequence[str] = (), mapper: Mapper = in_turn) -> dict[str, dict[str, Any]]:
    """Figures of the sections (all, or those named) as plain values, strict JSON.

    Parameters
    ----------
    root : folder of the data sets. mapper : how recordings are worked through.

    Returns
    -------
    By section; ``measured`` tells whether the data were there, ``why`` what is missing where they were not.

    Raises
    ------
    UsageError : there is no section of a name given.
    """
    unknown = [name for name in only if name not in SECTIONS]
    if unknown:
        raise UsageError(f"no section {unknown[0]!r}", where="--only", remedy=f"one of {', '.join(SECTIONS)}")
    read: list[Folds] = []

    def folds() -> Folds:
        if not read:
            read.append(gather(root / "ms-indoor" / "site1", FOLDS, mapper))
        return read[0]

    work: dict[str, Callable[[], dict[str, Any]]] = {
        "ms-indoor": lambda: measure_ms_indoor(folds(), mapper=mapper),
        "speed": lambda: measure_speed(folds()),
        "sodindoorloc": lambda: measure_static(root / "sodindoorloc", mapper=mapper),
        "oxford-steps": lambda: measure_steps(root / "oxford-steps"),
    }
    out: dict[str, dict[str, Any]] = {}
    for name, data in SECTIONS.items():
        if only and name not in only:
            continue
        why = absent(data, root)
        out[name] = {"measured": False, "why": why} if why else {"measured": True, **plain(work[name]())}
    return out


def absent(name: str, root: Path) -> str:
    """What is missing of a data set below the root, in a sentence; empty where it is whole."""
    needed = [entry.path for entry in manifest(name) if entry.path.endswith(_NEEDED)]
    missing = sum(not (root / name / path).is_file() for path in needed)
    if not missing:
        return ""
    some = "all" if missing == len(needed) else f"{missing} of {len(needed)}"
    return f"{some} files of the data set {name} are missing; fetch them with `wayfuse datasets fetch {name}`"
