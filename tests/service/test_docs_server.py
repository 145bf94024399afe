"""docs/server.md says what the server has: every setting, scope, way in, and route."""

from __future__ import annotations

import dataclasses
import re
from pathlib import Path

import pytest

from wayfuse.service.adapters import ADAPTERS
from wayfuse.service.app import PARTS
from wayfuse.service.settings import Settings
from wayfuse.storage.tokens import SCOPES

PAGE = (Path(__file__).resolve().parents[2] / "docs" / "server.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("field", dataclasses.fields(Settings), ids=lambda f: f.name)
def test_every_setting_is_documented_with_its_default(field: dataclasses.Field[object]) -> None:
    default = repr(field.default).replace("'", '"')
    assert f"| `{field.name}` | `{default}` | " in PAGE


def test_the_page_documents_no_setting_that_is_not_there() -> None:
    table = PAGE[PAGE.index("## Settings") :]
    names = re.findall(r"^\| `(\w+)` \|", table, re.MULTILINE)
    assert names == [f.name for f in dataclasses.fields(Settings)]


@pytest.mark.parametrize("scope", SCOPES)
def test_every_scope_is_documented(scope: str) -> None:
    assert f"| `{scope}` | " in PAGE


@pytest.mark.parametrize("adapter", ADAPTERS)
def test_every_way_in_is_documented(adapter: str) -> None:
    words = {
        "find3": "FIND3",
        "find3-passive": "`/passive`",
        "espresense": "`espresense/",
        "intel5300": "`csi_port`",
    }
    assert re.search(words.get(adapter, rf"/in/(TOKEN/)?{adapter}"), PAGE)


def test_routes_of_the_page_exist() -> None:
    known = {route.path for router in PARTS for route in router.routes}
    patterns = [re.compile(re.sub(r"\{\w+\}", "[^/]+", path)) for path in known]
    named = set(re.findall(r"(?<!wayfuse)/(?:api/v1|in)/[\w/-]+\w", PAGE)) | {"/metrics"}
    for path in named - {"/in/TOKEN"}:
        assert any(p.fullmatch(path) for p in patterns), path


def test_every_route_that_is_described_is_on_the_page() -> None:
    described = {r.path for router in PARTS for r in router.routes if getattr(r, "include_in_schema", False)}
    missing = []
    for path in described:
        pattern = re.sub(r"{\w+}", "[A-Z]+", path)
        if not re.search(pattern + r"(?![\w/-])", PAGE):
            missing.append(path)
    assert missing == []
