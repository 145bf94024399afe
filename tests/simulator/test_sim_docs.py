"""The page of the simulator names every key with its default, and every scenario that comes with the package."""

from __future__ import annotations

import importlib.util
import re
from pathlib import Path

from wayfuse.simulator.scenario_file import shipped_scenarios

SCRIPT = Path(__file__).resolve().parents[2] / "scripts" / "write_scenario_docs.py"


def test_the_page_is_that_of_the_classes():
    spec = importlib.util.spec_from_file_location("write_scenario_docs", SCRIPT)
    assert spec is not None
    assert spec.loader is not None
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    page = script.PAGE.read_text(encoding="utf-8")
    assert page == script.page(), "docs/simulator.md is stale: python scripts/write_scenario_docs.py"
    named = re.findall(r"^\| `([a-z0-9-]+)` \| [^`]", page.partition("## What is written")[0], re.MULTILINE)
    assert sorted(named) == sorted(shipped_scenarios())
    keys = re.findall(r"^\| `(\w+)` \| `(.*?)` \| (.*) \|$", page.partition(script.MARK)[2], re.MULTILINE)
    assert len(keys) > 120
    assert [name for name, _, meaning in keys if not meaning.strip()] == []
