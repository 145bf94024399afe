"""The ray tracer of the simulator, an optional extra: tests that need it say so where it is absent."""

from __future__ import annotations

import os
from importlib.util import find_spec

from programs import skip_without
from wayfuse.simulator.ray_tracer import newest_library

__all__ = ["skip_without_tracer"]


def skip_without_tracer() -> None:
    """Skip loudly without Sionna RT, or without the library that it compiles with."""
    if find_spec("sionna") is None:
        skip_without("Sionna RT", "the extra sionna is not installed (make sionna)")
    if not (newest_library() or os.environ.get("DRJIT_LIBLLVM_PATH")):
        skip_without("LLVM", "no libLLVM was found (Debian: libllvm19)")
