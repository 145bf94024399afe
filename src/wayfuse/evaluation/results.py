"""Every figure of docs/results.md, measured afresh: one section per question and data set.

A section whose data are not there whole is not measured, and says why; nothing stands in for them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from wayfuse.core.errors import UsageError
from wayfuse.evaluation.report import plain
from wayfuse.evaluation.results_behaviours import measure_behaviours
from wayfuse.evaluation.results_folds import FOLDS, Folds, Mapper, gather, in_turn
from wayfuse.evaluation.results_hcu import measure_hcu
from wayfuse.evaluation.results_ipin2023 import measure_ipin2023
from wayfuse.evaluation.results_ms_indoor import measure_ms_indoor
from wayfuse.evaluation.results_repetitions import gather as gather_repetitions
from wayfuse.evaluation.results_speed import measure_speed
from wayfuse.evaluation.results_static import measure_static
from wayfuse.evaluation.results_steps import measure_steps
from wayfuse.formats.datasets import manifest

__all__ = ["SECTIONS", "Need", "absent", "measure"]


class Need(NamedTuple):
    """A data set, or its files below a folder of it, that a section is measured on."""

    data: str
    below: str = ""


_LOGS = Need("ipin2023-track3", "logs/")
_HCU = Need("maps", "hcu_ipin21/")
SECTIONS: Mapping[str, tuple[Need, ...]] = {
    "ms-indoor": (Need("ms-indoor"),),
    "speed": (Need("ms-indoor"),),
    "ipin2023": (_LOGS,),
    "behaviours": (_LOGS, _HCU),
    "hcu": (_HCU,),
    "sodindoorloc": (Need("sodindoorloc"),),
    "oxford-steps": (Need("oxford-steps"),),
}
_NEEDED = (".txt", ".json", ".geojson", ".csv")  # pictures and sheets of a data set are not measured on


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
    logs, hcu = root / _LOGS.data / _LOGS.below, root / _HCU.data / _HCU.below

    def folds() -> Folds:
        if not read:
            read.append(gather(root / "ms-indoor" / "site1", FOLDS, mapper))
        return read[0]

    work: dict[str, Callable[[], dict[str, Any]]] = {
        "ms-indoor": lambda: measure_ms_indoor(folds(), mapper=mapper),
        "speed": lambda: measure_speed(folds()),
        "ipin2023": lambda: measure_ipin2023(gather_repetitions(logs, mapper), mapper=mapper),
        "behaviours": lambda: measure_behaviours(logs, hcu / "SensorLog", mapper),
        "hcu": lambda: measure_hcu(hcu),
        "sodindoorloc": lambda: measure_static(root / "sodindoorloc", mapper=mapper),
        "oxford-steps": lambda: measure_steps(root / "oxford-steps"),
    }
    out: dict[str, dict[str, Any]] = {}
    for name, needs in SECTIONS.items():
        if only and name not in only:
            continue
        why = next(filter(None, (absent(need.data, root, need.below) for need in needs)), "")
        out[name] = {"measured": False, "why": why} if why else {"measured": True, **plain(work[name]())}
    return out


def absent(name: str, root: Path, below: str = "") -> str:
    """What is missing of a data set (or of a part of it) below the root, in a sentence; empty where it is whole."""
    needed = [e.path for e in manifest(name) if e.path.endswith(_NEEDED) and e.path.startswith(below)]
    missing = sum(not (root / name / path).is_file() for path in needed)
    if not missing:
        return ""
    some = "all" if missing == len(needed) else f"{missing} of {len(needed)}"
    return f"{some} files of the data set {name} are missing; fetch them with `wayfuse datasets fetch {name}`"
