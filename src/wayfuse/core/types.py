"""Names for the arrays that travel through the package."""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

__all__ = ["Array", "Array32", "BoolArray", "IdArray", "IntArray"]

Array: TypeAlias = NDArray[np.float64]
Array32: TypeAlias = NDArray[np.float32]
BoolArray: TypeAlias = NDArray[np.bool_]
IntArray: TypeAlias = NDArray[np.signedinteger[Any]]
IdArray: TypeAlias = NDArray[np.uint64]
