"""The one place that knows the compiler.

``@kernel`` compiles a function of arrays and scalars with numba, caches the machine code on disk and releases the
GIL. Kernels draw no random numbers of their own, take no options or strings and raise nothing: the wrapper
validates, the kernel trusts. A division by zero gives an infinity, as in NumPy: a check for it, as Python has, would
keep every loop with a division from being vectorised. ``fastmath`` stays off, for it assumes that no infinity occurs;
`fast_kernel` allows the re-association of sums (not the removal of NaN and infinity checks), where a loop is to be
vectorised. Without numba, or with ``NUMBA_DISABLE_JIT=1``, every kernel runs as the plain Python it also is.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib import import_module
from threading import get_ident
from typing import Any, TypeVar, cast

__all__ = [
    "COMPILED",
    "bounded_kernel",
    "fast_kernel",
    "inline_kernel",
    "kernel",
    "load_compiler",
    "uncounted_kernel",
]

F = TypeVar("F", bound=Callable[..., Any])


class _LeftOut:
    """An importer that finds no module of some names, for the thread that made it; others import what they like."""

    def __init__(self, names: tuple[str, ...]) -> None:
        self._names, self._thread = names, get_ident()

    def find_spec(self, name: str, path: object = None, target: object = None) -> None:  # noqa: ARG002 (a protocol)
        """Nothing, so that the next importer is asked; for the names an error, as where they are not installed."""
        if name in self._names and get_ident() == self._thread:
            raise ModuleNotFoundError(f"{name} is left out", name=name)


@contextmanager
def _without(*names: str) -> Iterator[None]:
    """Optional modules as if they were not installed, but for those that are loaded already."""
    finder = _LeftOut(names)
    sys.meta_path = [finder, *sys.meta_path]  # a new list: another thread may be going through the old one
    try:
        yield
    finally:
        sys.meta_path = [other for other in sys.meta_path if other is not finder]


def _compiler() -> Any:
    try:
        # numba only asks whether coverage is measured (where it is, the module is loaded) and how old scipy is
        with _without("coverage", "scipy"):
            import numba
    except ImportError:  # the same results, within rounding, at the speed of Python
        return None
    return numba


_NUMBA = _compiler()
COMPILED: bool = _NUMBA is not None and not _NUMBA.config.DISABLE_JIT
"""Whether kernels are compiled; as plain Python they mention integers that wrap around (`numpy.errstate`)."""


def load_compiler() -> None:
    """Load what the first call of a kernel loads, all but `scipy.linalg`, which takes longer than the rest of it.

    numba looks there for BLAS. No kernel uses it, but other code compiled in this process might: call this from a
    program that has the process to itself, before the first kernel.
    """
    if COMPILED:
        with _without("scipy", "scipy.linalg"):
            import_module("numba.np.arraymath")


def kernel(function: F) -> F:
    """Compile a kernel (cached on disk, GIL released, IEEE arithmetic)."""
    return _compiled(function, fastmath=False)


def fast_kernel(function: F) -> F:
    """Compile a kernel whose sums may be re-associated and contracted; NaN and infinity keep their meaning."""
    return _compiled(function, fastmath={"reassoc", "contract", "arcp", "nsz"})


def bounded_kernel(function: F) -> F:
    """Compile a kernel whose arrays hold neither NaN nor infinity, as its caller sees to: greatest values vectorise."""
    return _compiled(function, fastmath=True)


def uncounted_kernel(function: F) -> F:
    """Compile a kernel that makes no array of its own, only views of the caller's: references are not counted.

    To count them takes two locked additions for each array of each call, more than a short helper takes for its work.
    """
    return _compiled(function, fastmath=False, counted=False)


def inline_kernel(function: F) -> F:
    """Compile a scalar helper that is inlined into the kernels that call it."""
    return _compiled(function, fastmath=False, inline="always")


def _compiled(function: F, *, counted: bool = True, **options: Any) -> F:
    if _NUMBA is None:
        return function
    if COMPILED and hasattr(_NUMBA.core.options.DefaultOptions, "_nrt"):  # numba does not document it
        options["_nrt"] = counted  # always: a kernel without a word takes it from the one that calls it first
    return cast("F", _NUMBA.njit(cache=True, nogil=True, error_model="numpy", **options)(function))
