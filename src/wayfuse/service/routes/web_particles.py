"""The particles of a live track, for people who want to see why the server says what it says."""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np
from fastapi import APIRouter, Depends, Request

from wayfuse.filters.particle_filter import FilterState
from wayfuse.service.access import SCHEME, allowed, server_of
from wayfuse.service.problems import Problem, responses
from wayfuse.service.routes.answers import answer
from wayfuse.service.routes.answers_plan import Particles
from wayfuse.storage.tokens import Token

__all__ = ["router"]

router = APIRouter(
    prefix="/api/v1", tags=["out"], dependencies=[Depends(SCHEME)], responses=responses(401, 403, 429)
)


@router.get(
    "/tracks/{track}/particles",
    summary="Particles of a live track",
    responses=responses(404) | answer(Particles),
    response_model=None,
)
def particles(
    request: Request, token: Annotated[Token, Depends(allowed("read"))], track: str
) -> dict[str, Any]:
    """Columns: ``x``, ``y`` (m, frame of the floor), ``floor``, ``weight`` (sum 1); empty before the first fix."""
    server = server_of(request)
    view, state = server.live.view(track), server.live.state(track)
    if view is None or state is None or token.site not in {"", view.row.site}:
        raise Problem(404, "no such live track", "list them at /api/v1/tracks")
    cloud = getattr(state.engine, "filter", None)
    empty: dict[str, Any] = {"x": [], "y": [], "floor": [], "weight": []}
    said = {"track": track, "site": view.row.site, "t": state.now if np.isfinite(state.now) else None}
    return said | (_columns(cloud) if isinstance(cloud, FilterState) else empty)


def _columns(state: FilterState) -> dict[str, Any]:
    cloud = state.cloud
    return {
        "x": np.round(cloud.x.astype(np.float64), 2).tolist(),
        "y": np.round(cloud.y.astype(np.float64), 2).tolist(),
        "floor": cloud.floor.tolist(),
        "weight": np.round(state.weights.astype(np.float64), 7).tolist(),
    }
