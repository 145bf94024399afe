"""The application: routes, answers to errors, headers, and the life of the server with it."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from fastapi import FastAPI
from fastapi.concurrency import run_in_threadpool
from sqlalchemy.exc import SQLAlchemyError
from starlette.types import Receive, Scope, Send

from wayfuse import __version__
from wayfuse.service.csi_stream import listen_for_csi
from wayfuse.service.problems import handle_problems
from wayfuse.service.routes import (
    admin,
    anchors,
    inputs,
    outputs,
    pages,
    sites,
    stream,
    web_assets,
    web_particles,
    web_plan,
    web_radio,
    web_survey,
    zones,
)
from wayfuse.service.security import SecurityHeaders
from wayfuse.service.server import Server
from wayfuse.service.web.surveys import Surveys

__all__ = ["PARTS", "create_app"]

_ROUTES = (inputs, outputs, stream, sites, anchors, admin, pages, zones)
_WEB = (web_plan, web_particles, web_radio, web_survey, web_assets)
PARTS = (*(part.router for part in (*_ROUTES, *_WEB)), web_survey.by_path)
_log = logging.getLogger(__name__)
_AGAIN_S, _TIMES = 2.0, 4  # s between words to a task that it should end, and how many
_CLEAN_S = 600.0  # between deletions of what is too old


def create_app(server: Server) -> FastAPI:
    """The application of a server; it starts and stops the server's work."""
    surveys = Surveys(server)

    @asynccontextmanager
    async def life(_app: FastAPI) -> AsyncIterator[None]:
        n = await run_in_threadpool(server.start, asyncio.get_running_loop())
        if n:
            _log.info("%d entries of the log read again", n)
        tasks = [asyncio.create_task(_clean(server, surveys))]
        if server.settings.mqtt:
            from wayfuse.service.mqtt import keep_connected

            tasks.append(asyncio.create_task(keep_connected(server)))
        if server.settings.csi_port:
            listener = await listen_for_csi(server)
            tasks.append(asyncio.create_task(listener.serve_forever()))
        yield
        server.is_ending = True
        server.hub.close()
        await _end(tasks)
        await run_in_threadpool(server.stop)

    app = _App(
        title="wayfuse",
        version=__version__,
        summary="Live indoor positions: phones and anchors in, positions out.",
        lifespan=life,
        docs_url=None,  # both would load scripts from another host
        redoc_url=None,
    )
    app.state.server, app.state.surveys = server, surveys
    for router in PARTS:
        app.include_router(router)
    handle_problems(app)
    app.add_middleware(SecurityHeaders)
    return app


class _App(FastAPI):
    """The framework's application, past which posts take a shorter way."""

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve a connection."""
        if scope["type"] == "http":
            scope["app"] = self
            answer = await inputs.quick(scope, receive)
            if answer is not None:
                await answer(scope, receive, send)
                return
        await super().__call__(scope, receive, send)


async def _end(tasks: list[asyncio.Task[None]]) -> None:
    """Cancel tasks until all are done: one that is busy with an error of its own may miss it once."""
    for _ in range(_TIMES):
        pending = [task for task in tasks if not task.done()]
        for task in pending:
            task.cancel()
        if pending:
            await asyncio.wait(pending, timeout=_AGAIN_S)
    for task in tasks:
        if not task.done():
            _log.error("a task of the server does not end: %r", task)
        error = task.exception() if task.done() and not task.cancelled() else None
        if error is not None:
            _log.error("a task of the server had ended: %r", error)


async def _clean(server: Server, surveys: Surveys) -> None:
    while True:
        await asyncio.sleep(_CLEAN_S)
        try:
            await run_in_threadpool(server.clean)
            await run_in_threadpool(surveys.clean)
        except (SQLAlchemyError, OSError) as error:
            _log.error("old data cannot be deleted now: %s", type(error).__name__)
