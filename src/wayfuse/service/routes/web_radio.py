"""Pictures of a radio map: what it covers, where to survey next, how strong an access point is where."""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np
from fastapi import APIRouter, Depends, Query, Request

from wayfuse.core.types import Array
from wayfuse.models.survey_coverage import Grid, coverage, heard_at, level_of, next_places
from wayfuse.sensors.records import bssid_text
from wayfuse.service.access import SCHEME, SiteName, Surveyor, server_of, site_of
from wayfuse.service.adapters.parts import identifier
from wayfuse.service.problems import Problem, responses
from wayfuse.service.routes.answers import answer
from wayfuse.service.routes.answers_survey import AccessPoints, Coverage, Heat
from wayfuse.service.web.surveys import surveys_of

__all__ = ["router"]

router = APIRouter(
    prefix="/api/v1/survey",
    tags=["survey"],
    dependencies=[Depends(SCHEME)],
    responses=responses(401, 403, 404, 422, 429),
)

FloorIndex = Annotated[int, Query(ge=0, le=1000, description="Index of the floor, from 0 bottom up.")]
Version = Annotated[int | None, Query(ge=1, le=2**31 - 1, description="Of the radio map; the one in use.")]


@router.get(
    "/coverage", summary="How far the next fingerprint is", responses=answer(Coverage), response_model=None
)
def covered(
    request: Request, token: Surveyor, floor: FloorIndex, site: SiteName = "", version: Version = None
) -> dict[str, Any]:
    """A grid of distances (m, null where nobody walks), where to survey next, and the fingerprints' places."""
    server = server_of(request)
    name = site_of(server, token, site)
    plan = _floor(server.worlds[name].site.floors, floor)
    places = np.empty((0, 2))
    known: int | None = None
    if version is not None or server.published(name) is not None:
        known, survey = surveys_of(request).of(name, version)
        places = survey.xy[survey.floor == floor]
    found = next_places(plan, places)
    return {
        "site": name,
        "floor": floor,
        "version": known,
        "fingerprints": len(places),
        "places": np.round(np.unique(np.round(places), axis=0), 1).tolist(),
        "next": [{"x": x, "y": y, "distance_m": d if np.isfinite(d) else None} for x, y, d in found],
        **_grid(coverage(plan, places)),
    }


@router.get(
    "/access-points",
    summary="Access points of the radio map",
    responses=answer(AccessPoints),
    response_model=None,
)
def access_points(
    request: Request,
    token: Surveyor,
    site: SiteName = "",
    version: Version = None,
    limit: Annotated[int, Query(ge=1, le=10_000)] = 500,
) -> dict[str, Any]:
    """The most heard first: address, channel, and on each floor how many fingerprints heard it and how loud at most."""
    server = server_of(request)
    name = site_of(server, token, site)
    known, survey = surveys_of(request).of(name, version)
    n_floors, n_aps = len(survey.floors), len(survey.bssid)
    row_of = np.repeat(np.arange(len(survey)), np.diff(survey.indptr))
    pair = survey.indices.astype(np.int64) * n_floors + survey.floor[row_of]
    count = np.bincount(pair, minlength=n_aps * n_floors).reshape(n_aps, n_floors)
    by_pair = np.full(n_aps * n_floors, -np.inf)
    np.maximum.at(by_pair, pair, survey.rssi)
    loudest = by_pair.reshape(n_aps, n_floors)
    order = np.argsort(-count.sum(axis=1), kind="stable")[:limit]
    found = [
        {
            "bssid": bssid_text(int(survey.bssid[a])),
            "mhz": int(survey.frequency[a]),
            "fingerprints": count[a].tolist(),
            "loudest_dbm": [float(v) if np.isfinite(v) else None for v in loudest[a]],
        }
        for a in order
    ]
    return {"site": name, "version": known, "levels": list(survey.floors), "n": n_aps, "access_points": found}


@router.get(
    "/heat", summary="How strong an access point is over a floor", responses=answer(Heat), response_model=None
)
def heat(
    request: Request,
    token: Surveyor,
    bssid: Annotated[str, Query(min_length=1, max_length=200)],
    floor: FloorIndex,
    site: SiteName = "",
    version: Version = None,
) -> dict[str, Any]:
    """A grid of levels (dBm), null farther than 5 m from any fingerprint."""
    server = server_of(request)
    name = site_of(server, token, site)
    plan = _floor(server.worlds[name].site.floors, floor)
    known, survey = surveys_of(request).of(name, version)
    column = int(survey.columns(np.array([identifier(bssid)], np.uint64))[0])
    if column < 0:
        raise Problem(
            404, "no such access point in this radio map", "list them at /api/v1/survey/access-points"
        )
    places, levels = heard_at(survey, column, floor)
    said = {"site": name, "floor": floor, "version": known, "bssid": bssid}
    return said | {"fingerprints": int(np.isfinite(levels).sum())} | _grid(level_of(plan, places, levels))


def _floor(floors: tuple[Any, ...], floor: int) -> Any:
    if floor >= len(floors):
        raise Problem(404, f"no floor {floor}", "see /api/v1/plan")
    return floors[floor]


def _grid(grid: Grid) -> dict[str, Any]:
    """A grid in JSON: values rounded to 0.1, null for nothing."""
    return {"origin": list(grid.origin), "cell_m": grid.cell, "values": _rows(grid.values)}


def _rows(values: Array) -> list[list[float | None]]:
    rounded = np.round(values, 1)
    return [[v if np.isfinite(v) else None for v in row] for row in rounded.tolist()]
