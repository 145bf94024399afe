r"""A straight line from measured ranges to distances, for ranges that are long (round-trip time through walls).

.. math:: d = a + b \hat d

Ranges by time of flight are long where walls, furniture and bodies delay the direct path, and the more of them lie
between the longer they are: the error grows with range. The line takes off its mean, the rest is left to the filter.
Where li2015 regresses ranges from powers (`radio.ranging`), this is its counterpart for times.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from wayfuse.core.errors import RadioMapError
from wayfuse.core.types import Array

__all__ = ["AS_MEASURED", "RangeLine", "fit_range_line"]


class RangeLine(NamedTuple):
    """d = offset + slope * measured: offset (m), slope."""

    offset: float = 0.0
    slope: float = 1.0

    def distance(self, measured: ArrayLike) -> Array:
        """Distances (m) of measured ranges (m) of any shape; NaN stays NaN.

        >>> RangeLine(-1.0, 0.5).distance([4.0, 6.0]).tolist()
        [1.0, 2.0]
        """
        return np.asarray(self.offset + self.slope * np.asarray(measured, dtype=np.float64))


AS_MEASURED = RangeLine()  # no correction


def fit_range_line(measured: ArrayLike, distance: ArrayLike) -> RangeLine:
    """Least squares of distances (n,) m on measured ranges (n,) m; pairs that are not finite are left out.

    Raises
    ------
    RadioMapError : fewer than two different ranges.
    """
    m, d = np.asarray(measured, dtype=np.float64), np.asarray(distance, dtype=np.float64)
    known = np.isfinite(m) & np.isfinite(d)
    m, d = m[known], d[known]
    if len(np.unique(m)) < 2:
        raise RadioMapError(
            "a line needs two different ranges", where="fit_range_line", remedy="measure at more distances"
        )
    slope, offset = np.polyfit(m, d, 1)
    return RangeLine(float(offset), float(slope))
