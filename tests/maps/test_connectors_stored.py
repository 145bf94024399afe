"""Connectors and doors of a site survive its folder; older folders load without them."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wayfuse.core.errors import MapError
from wayfuse.maps.connector_entries import connector_entry, read_connector
from wayfuse.maps.connectors import Connector, ConnectorKind, Landing
from wayfuse.maps.importers.ms_indoor import import_site
from wayfuse.maps.site import Site

RING = np.array([[1.0, 1.0], [3.0, 1.0], [3.0, 4.0], [1.0, 1.0]])
STAIRS = Connector(
    "s", ConnectorKind.STAIRS, (Landing(0, 2.0, 28.0), Landing(1, 3.0, 27.5)), (22,), 0, RING, "Haupttreppe"
)
ESCALATOR = Connector("e", ConnectorKind.ESCALATOR, (Landing(0, 28.0, 9.0), Landing(1, 28.0, 12.0)), (), 1)


def same(a: Connector, b: Connector) -> bool:
    plain = [dataclasses.astuple(dataclasses.replace(c, footprint=None)) for c in (a, b)]
    if a.footprint is None or b.footprint is None:
        return plain[0] == plain[1] and a.footprint is b.footprint
    return plain[0] == plain[1] and np.array_equal(a.footprint, b.footprint)


@pytest.fixture
def saved(plans, tmp_path):
    site = import_site(plans)[0]
    doors = np.array([[5.0, 10.0, 5.0, 11.0]])
    floors = (dataclasses.replace(site.floors[0], doors=doors), site.floors[1])
    site = dataclasses.replace(site, floors=floors, connectors=(STAIRS, ESCALATOR))
    site.save(tmp_path / "site")
    return tmp_path / "site"


def edit(folder, change):
    manifest = json.loads((folder / "site.json").read_text())
    change(manifest)
    (folder / "site.json").write_text(json.dumps(manifest))


def test_a_site_keeps_its_connectors_and_doors(saved):
    site = Site.load(saved)
    assert all(same(a, b) for a, b in zip(site.connectors, (STAIRS, ESCALATOR), strict=True))
    assert site.floors[0].doors.tolist() == [[5.0, 10.0, 5.0, 11.0]]
    assert site.floors[1].doors.shape == (0, 4)


def test_a_site_of_before_connectors_loads_with_none(saved):
    edit(saved, lambda m: m.pop("connectors"))
    assert Site.load(saved).connectors == ()


@pytest.mark.parametrize(
    ("damage", "named"),
    [
        (lambda c: c.pop("id"), "no id"),
        (lambda c: c.update(kind="rope"), "kind 'rope'"),
        (lambda c: c["landings"][0].update(floor="F9"), "connector s"),
        (lambda c: c["landings"].pop(), "connector s joins floors 0"),
        (lambda c: c["landings"][0].update(x=float("nan")), "finite"),
        (lambda c: c.update(n_steps=[1, 2]), "numbers of steps"),
        (lambda c: c.update(direction="up"), "connector s"),
        (lambda c: c.update(footprint=[1, 2, 3]), "connector s"),
        (lambda c: c.update(id="e"), "ids repeat"),
    ],
)
def test_a_damaged_connector_is_named(saved, damage, named):
    edit(saved, lambda m: damage(m["connectors"][0]))
    with pytest.raises(MapError, match=named):
        Site.load(saved)


numbers = st.floats(-1e4, 1e4)
kinds = st.sampled_from(ConnectorKind)


@given(
    st.sets(st.integers(0, 4), min_size=2),
    kinds,
    st.data(),
    st.none() | st.lists(st.tuples(numbers, numbers), min_size=3, max_size=6),
)
def test_an_entry_read_back_is_the_connector(floors, kind, data, ring):
    landings = tuple(Landing(f, data.draw(numbers), data.draw(numbers)) for f in sorted(floors))
    steps = data.draw(st.just(()) | st.tuples(*[st.integers(0, 99)] * (len(landings) - 1)))
    footprint = None if ring is None else np.array([*ring, ring[0]])
    written = Connector("c", kind, landings, steps, data.draw(st.sampled_from([-1, 0, 1])), footprint, "x")
    names = [f"F{i}" for i in range(5)]
    text = json.dumps(connector_entry(written, names))
    assert same(read_connector(json.loads(text), names), written)
