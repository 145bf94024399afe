"""Connectors as plain dictionaries: what JSON and TOML hold of them.

```json
{"id": "lift", "kind": "lift", "landings": [{"floor": "F1", "x": 3.0, "y": 4.0}, {"floor": "F2", "x": 3.0, "y": 4.0}],
 "n_steps": [], "direction": 0, "footprint": [[2, 3], [4, 3], [4, 5], [2, 5], [2, 3]], "name": ""}
```
Landings name their floors, so that an entry stays readable when floors are added; only `id`, `kind` and `landings`
must be there. x, y in metres of the named floor, the footprint in those of the lowest.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from wayfuse.core.errors import MapError
from wayfuse.maps.connectors import Connector, ConnectorKind, Landing

__all__ = ["connector_entry", "read_connector"]


def connector_entry(connector: Connector, floors: Sequence[str]) -> dict[str, Any]:
    """Entry of a connector of a site with floors of these names, bottom up."""
    ring = connector.footprint
    return {
        "id": connector.id,
        "kind": connector.kind.value,
        "name": connector.name,
        "landings": [{"floor": floors[at.floor], "x": at.x, "y": at.y} for at in connector.landings],
        "n_steps": list(connector.n_steps),
        "direction": connector.direction,
        "footprint": None if ring is None else ring.tolist(),
    }


def read_connector(entry: Any, floors: Sequence[str]) -> Connector:
    """Connector of an entry; its landings may come in any order, its footprint be open.

    Raises
    ------
    MapError : a field is missing or wrong; names the connector and the field.
    """
    if not isinstance(entry, Mapping) or not isinstance(entry.get("id"), str):
        raise MapError("a connector has no id", remedy='give id = "..."')
    name = f"connector {entry['id']}"
    try:
        kind = ConnectorKind(str(entry.get("kind")))
    except ValueError:
        known = ", ".join(ConnectorKind)
        raise MapError(f"{name}: kind {entry.get('kind')!r} is not known", remedy=f"kinds: {known}") from None
    try:
        landings = [
            Landing(floors.index(a["floor"]), float(a["x"]), float(a["y"])) for a in entry["landings"]
        ]
        footprint = entry.get("footprint")
        ring = None if footprint is None else np.array(footprint, dtype=np.float64).reshape(-1, 2)
        n_steps = tuple(int(n) for n in entry.get("n_steps", ()))
        direction = int(entry.get("direction", 0))
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        remedy = "landings need floor, x and y of a floor of the site; footprint is a list of [x, y]"
        raise MapError(f"{name}: {error!r}", remedy=remedy) from error
    places = [] if ring is None else [*ring.flat]
    if not np.all(np.isfinite([*(v for at in landings for v in at[1:]), *places])):
        raise MapError(f"{name}: coordinates must be finite numbers", remedy="mend its landings or footprint")
    if ring is not None and len(ring) and not np.array_equal(ring[0], ring[-1]):
        ring = np.vstack([ring, ring[:1]])
    return Connector(
        id=entry["id"],
        kind=kind,
        landings=tuple(sorted(landings)),
        n_steps=n_steps,
        direction=direction,
        footprint=ring,
        name=str(entry.get("name", "")),
    )
