"""Every module says what it offers, and offers what it says."""

from __future__ import annotations

import importlib
import inspect
import pkgutil

import pytest

import wayfuse

MODULES = sorted(
    m.name for m in pkgutil.walk_packages(wayfuse.__path__, "wayfuse.") if m.name != "wayfuse.__main__"
)


@pytest.mark.parametrize("name", MODULES)
def test_names_are_there_and_described(name: str) -> None:
    module = importlib.import_module(name)
    assert (module.__doc__ or "").strip()
    public = getattr(module, "__all__", None)
    if hasattr(module, "__path__") or (public is None and name.rpartition(".")[2].startswith("_")):
        return  # a room, or a table of constants for one room
    assert public is not None, f"{name} has no __all__"
    assert len(set(public)) == len(public)
    for entry in public:
        thing = getattr(module, entry)
        if inspect.isclass(thing) or inspect.isroutine(thing):
            assert inspect.getdoc(thing), f"{name}.{entry}"


def test_there_are_as_many_as_expected() -> None:
    assert len(MODULES) > 80  # the walk above has not silently found nothing
