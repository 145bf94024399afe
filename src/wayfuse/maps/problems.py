"""Problems of a site by name: what importers repaired or left out, and what `wayfuse.maps.validate` finds.

An importer draws sound polygons and connectors whatever the plan holds, so what was wrong with the plan would be
lost: it is kept in the site's provenance under "problems", and validation names it again.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from enum import StrEnum
from typing import NamedTuple

from wayfuse.core.errors import MapError
from wayfuse.maps.site import Site

__all__ = ["KEY", "Problem", "Severity", "noted_problems", "problems_text"]

KEY = "problems"  # of the provenance


class Severity(StrEnum):
    """An error makes a part of the site useless or wrong; a warning is worth a look."""

    ERROR = "error"
    WARNING = "warning"


class Problem(NamedTuple):
    """What is wrong with a feature: its id, the floor it is on (empty: the site), kind and explanation."""

    kind: str
    feature: str
    floor: str
    text: str
    severity: Severity = Severity.WARNING

    def __str__(self) -> str:
        where = f"floor {self.floor}: " if self.floor else ""
        return f"{self.severity}: {where}{self.feature}: {self.text} [{self.kind}]"


def problems_text(problems: Iterable[Problem]) -> str:
    """Problems as text for the provenance of a site."""
    return json.dumps([problem._asdict() for problem in problems], ensure_ascii=False)


def noted_problems(site: Site) -> tuple[Problem, ...]:
    """What the importer of a site noted.

    Raises
    ------
    MapError : the note is no list of problems.
    """
    try:
        entries = json.loads(site.provenance.get(KEY, "[]"))
        return tuple(
            Problem(
                **{k: str(entry[k]) for k in ("kind", "feature", "floor", "text")},
                severity=Severity(entry["severity"]),
            )
            for entry in entries
        )
    except (ValueError, TypeError, KeyError) as error:
        raise MapError(
            f"its noted problems are damaged: {error!r}", where=site.name, remedy="import the site anew"
        ) from error
