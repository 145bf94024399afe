"""A site on disk: what is read is what was written, or an error that names the file."""

from __future__ import annotations

import json
import subprocess
import sys

import numpy as np
import pytest

from wayfuse.core.errors import MapError
from wayfuse.maps.importers.ms_indoor import import_site
from wayfuse.maps.site import Site


@pytest.fixture
def saved(plans, tmp_path):
    folder = tmp_path / "site"
    import_site(plans)[0].save(folder)
    return folder


def test_reading_gives_back_what_was_written(plans, saved):
    written, read = import_site(plans)[0], Site.load(saved)
    assert read.name == written.name
    assert read.provenance == written.provenance
    for a, b in zip(written.floors, read.floors, strict=True):
        for name in ("name", "level", "width", "height", "elevation", "anchor"):
            assert getattr(a, name) == getattr(b, name)
        for x, y in zip(a.units, b.units, strict=True):
            assert (x.id, x.name, x.category) == (y.id, y.name, y.category)
            assert all(np.array_equal(r, s) for r, s in zip(x.polygon.rings, y.polygon.rings, strict=True))
        assert a.area == b.area
        assert a.walkable.origin == b.walkable.origin
        assert np.array_equal(a.walkable.mask, b.walkable.mask)
        for x, y in ((a.wall_index, b.wall_index), (a.barrier_index, b.barrier_index)):
            assert all(
                np.array_equal(s, t) and s.dtype == t.dtype for s, t in zip(x.arrays, y.arrays, strict=True)
            )


def test_the_same_plans_give_the_same_bytes(plans, saved, tmp_path):
    import_site(plans)[0].save(tmp_path / "again")
    names = sorted(path.name for path in saved.iterdir())
    assert names == ["B1.geojson", "B1.npz", "F1.geojson", "F1.npz", "site.json"]
    assert all((saved / name).read_bytes() == (tmp_path / "again" / name).read_bytes() for name in names)


def test_a_saved_site_loads_without_the_geometry_library(saved):
    code = (
        "import sys; from pathlib import Path; from wayfuse.maps.site import Site; "
        f"site = Site.load(Path({str(saved)!r})); site.floors[0].walkable.contains(1, 1); "
        "print([m for m in ('shapely', 'matplotlib', 'scipy', 'numba') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def edit(folder, change):
    manifest = json.loads((folder / "site.json").read_text())
    change(manifest)
    (folder / "site.json").write_text(json.dumps(manifest))


@pytest.mark.parametrize(
    ("damage", "named"),
    [
        (lambda f: (f / "site.json").unlink(), "site.json"),
        (lambda f: (f / "site.json").write_text("{"), "site.json"),
        (lambda f: (f / "site.json").write_text("[]"), "not a site"),
        (lambda f: edit(f, lambda m: m.update(format="other")), "not a site"),
        (lambda f: edit(f, lambda m: m.update(version=99)), "upgrade"),
        (lambda f: edit(f, lambda m: m.update(version="1")), "version"),
        (lambda f: edit(f, lambda m: m.update(floors=[])), "at least one floor"),
        (lambda f: edit(f, lambda m: m.pop("floors")), "floors"),
        (lambda f: edit(f, lambda m: m["floors"][0].pop("level")), "level"),
        (lambda f: edit(f, lambda m: m["floors"][0].update(files={})), "site.json"),
        (lambda f: edit(f, lambda m: m["floors"][0].update(files={"../B1.geojson": "0"})), "outside"),
        (lambda f: edit(f, lambda m: m["floors"][0].update(width="wide")), "site.json"),
        (lambda f: edit(f, lambda m: m["floors"][0].update(level=float("inf"))), "site.json"),
        (lambda f: edit(f, lambda m: m["floors"][0].update(anchor={"origin": [1]})), "site.json"),
        (lambda f: edit(f, lambda m: m["floors"][1].update(name="B1")), "repeat"),
        (lambda f: (f / "F1.geojson").unlink(), "F1.geojson"),
        (lambda f: (f / "F1.npz").unlink(), "F1.npz"),
        (lambda f: (f / "F1.npz").write_bytes((f / "F1.npz").read_bytes()[:100]), "F1.npz"),
        (lambda f: (f / "B1.geojson").write_text("{}"), "B1.geojson"),
    ],
)
def test_damage_is_named_with_a_remedy(saved, damage, named):
    damage(saved)
    with pytest.raises(MapError, match=named):
        Site.load(saved)


def test_a_file_with_a_right_checksum_and_wrong_content_is_named(saved):
    import hashlib

    for name in ("F1.npz", "F1.geojson"):
        (saved / name).write_bytes(b"{}")
        digest = hashlib.sha256(b"{}").hexdigest()
        edit(saved, lambda m, name=name, digest=digest: m["floors"][1]["files"].update({name: digest}))
        with pytest.raises(MapError, match=name):
            Site.load(saved)


def test_no_folder_is_an_error_with_a_remedy(tmp_path):
    with pytest.raises(MapError, match="wayfuse site import"):
        Site.load(tmp_path / "none")


def test_saving_overwrites_a_site_only_when_told_and_nothing_else_ever(plans, saved, tmp_path):
    site = import_site(plans)[0]
    with pytest.raises(MapError, match="--overwrite"):
        site.save(saved)
    ground = Site("ground", site.floors[1:])
    ground.save(saved, overwrite=True)
    assert Site.load(saved).floor_names == ("F1",)
    assert not (saved / "B1.geojson").exists()
    other = tmp_path / "other"
    other.mkdir()
    (other / "thesis.tex").write_text("years of work")
    with pytest.raises(MapError, match=r"thesis\.tex"):
        site.save(other, overwrite=True)
    with pytest.raises(MapError, match="is a file"):
        site.save(other / "thesis.tex", overwrite=True)


def test_floors_by_name(saved):
    site = Site.load(saved)
    assert site.floor_index("f1") == 1
    with pytest.raises(MapError, match="B1, F1"):
        site.floor_index("F9")


def test_reference_floor_and_shift(plans):
    site = import_site(plans)[0]
    assert site.reference == 1
    assert site.anchor == site.floors[1].anchor
    np.testing.assert_allclose(site.shift(0, 1), 0.0, atol=1e-6)


@pytest.mark.real_data
def test_frames_of_real_floors_differ_by_a_shift(ms_indoor):
    site = import_site(ms_indoor)[0]
    for i, source in enumerate(site.floors):
        corners = np.array([[0.0, 0.0], [source.width, source.height], [source.width, 0.0]])
        for j, target in enumerate(site.floors):
            exact = target.anchor.to_xy(source.to_lonlat(corners))
            np.testing.assert_allclose(corners + site.shift(i, j), exact, atol=1e-3)
    assert np.hypot(*site.shift(0, 1)) > 50.0
