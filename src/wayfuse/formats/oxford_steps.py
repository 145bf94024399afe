"""Reader of the oxford-steps walks: accelerations of phones in seven carrying positions, with counted steps.

Two layouts of comma-separated lines without a header: ``validation/<user>_<position>_<start>.csv`` holds
time (ns since boot), x, y, z (m/s²) and three running counts (the authors' algorithm, the reference on the
ankle, the phone's step counter; 0 throughout where the phone gave none);
``optimisation/data/<walk>/accelerometer.csv`` holds time, a status and x, y, z, without counts. The axes are
Android's.

References
----------
.. [1] D. Salvi, C. Velardo, J. Brynes and L. Tarassenko, An optimised algorithm for accurate steps counting
   from smart-phone accelerometry, EMBC 2018; data: github.com/Oxford-step-counter/DataSet (CC BY 4.0).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wayfuse.core.errors import DataMissingError, FormatError
from wayfuse.sensors.quality import ReadReport
from wayfuse.sensors.recording import Recording, Series

__all__ = ["CountedWalk", "read", "validation_walks"]

_NS = 1e-9  # s
_COUNTED, _PLAIN = 7, 5  # fields of a line


@dataclass(frozen=True, slots=True, eq=False)
class CountedWalk:
    """A walk of the validation set.

    recording : accelerations. user, position : from the file's name. steps : reference count.
    algorithm_steps, phone_steps : what the data set's own algorithm and the phone's step counter found (0:
    none recorded).
    """

    recording: Recording
    user: str
    position: str
    steps: int
    algorithm_steps: int
    phone_steps: int


def read(path: str | Path) -> CountedWalk:
    """Read one walk of either layout; the counts of a layout without them are 0.

    Raises
    ------
    DataMissingError : there is no such file.
    FormatError : no line of it has the fields of this format.
    """
    path = Path(path)
    if not path.is_file():
        raise DataMissingError("there is no such file", where=path)
    report = ReadReport(path=str(path))
    rows: list[list[float]] = []
    counts = [0, 0, 0]
    last = -math.inf
    for number, line in enumerate(path.read_text(encoding="utf-8", errors="replace").splitlines(), start=1):
        report.n_lines += 1
        fields = _numbers(line)
        if len(fields) not in (_COUNTED, _PLAIN):
            report.add("line without 5 or 7 finite numbers", number)
            continue
        t = fields[0] * _NS
        if t < last:
            report.add("time before the line above", number)
            continue
        last = t
        rows.append([t, *(fields[1:4] if len(fields) == _COUNTED else fields[2:5])])
        if len(fields) == _COUNTED:
            counts = [max(a, int(b)) for a, b in zip(counts, fields[4:], strict=True)]
    if not rows:
        raise FormatError("no line holds 5 or 7 numbers", where=path, remedy="give a file of oxford-steps")
    return _walk(path, report, rows, counts)


def validation_walks(folder: str | Path) -> tuple[CountedWalk, ...]:
    """The counted walks below a folder, in the order of their names.

    Raises
    ------
    DataMissingError : there are none.
    """
    paths = sorted(Path(folder).glob("**/validation/user*_*_*.csv"))
    if not paths:
        remedy = "fetch the data set oxford-steps"
        raise DataMissingError("no validation/user*.csv below this folder", where=folder, remedy=remedy)
    return tuple(read(path) for path in paths)


def _numbers(line: str) -> list[float]:
    try:
        fields = [float(f) for f in line.split(",")]
    except ValueError:
        return []
    return fields if all(map(math.isfinite, fields)) else []


def _walk(path: Path, report: ReadReport, rows: list[list[float]], counts: list[int]) -> CountedWalk:
    table = np.array(rows)
    report.n_records["acceleration"] = len(table)
    user, _, rest = path.stem.partition("_")
    is_counted = user.startswith("user")
    recording = Recording(
        name=path.stem if is_counted else path.parent.name,
        acceleration=Series(np.ascontiguousarray(table[:, 0]), np.ascontiguousarray(table[:, 1:])),
        clock="seconds since boot",
        path=str(path),
        report=report,
    )
    position = rest.rpartition("_")[0] if is_counted else ""
    return CountedWalk(recording, user if is_counted else "", position, counts[1], counts[0], counts[2])
