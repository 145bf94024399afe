"""What is answered when something is wrong: a status, what, and what to do; never a traceback."""

from __future__ import annotations

from collections.abc import Mapping

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse, Response
from pydantic import BaseModel
from starlette.exceptions import HTTPException

from wayfuse.core.errors import WayfuseError
from wayfuse.service.message import BadBodyError
from wayfuse.service.pipeline import BusyError

__all__ = ["Problem", "ProblemBody", "handle_problems", "problem_response", "responses"]


class ProblemBody(BaseModel):
    """The body of every answer that is no success."""

    error: str
    remedy: str = ""


class Problem(Exception):  # noqa: N818 (an answer, rather than an error of the program)
    """Ends a request with a status and two sentences."""

    def __init__(
        self, status: int, error: str, remedy: str = "", headers: Mapping[str, str] | None = None
    ) -> None:
        super().__init__(error)
        self.status, self.error, self.remedy = status, error, remedy
        self.headers = dict(headers or {})


def problem_response(problem: Problem) -> Response:
    """The answer."""
    body = ProblemBody(error=problem.error, remedy=problem.remedy)
    return JSONResponse(body.model_dump(), problem.status, headers=problem.headers)


def responses(*statuses: int) -> dict[int | str, dict[str, object]]:
    """For the OpenAPI description: answers with a `ProblemBody`."""
    return {status: {"model": ProblemBody} for status in statuses}


def handle_problems(app: FastAPI) -> None:
    """Turn exceptions into answers."""

    @app.exception_handler(Problem)
    async def _(_request: Request, error: Problem) -> Response:
        return problem_response(error)

    @app.exception_handler(BusyError)
    async def _(_request: Request, error: BusyError) -> Response:
        return problem_response(Problem(503, error.what, error.remedy, {"Retry-After": "1"}))

    @app.exception_handler(WayfuseError)
    async def _(_request: Request, error: WayfuseError) -> Response:
        status = 400 if isinstance(error, BadBodyError) else 422
        return problem_response(Problem(status, str(error.what), error.remedy))

    @app.exception_handler(RequestValidationError)
    async def _(_request: Request, error: RequestValidationError) -> Response:
        said = "; ".join(f"{'.'.join(map(str, e['loc']))}: {e['msg']}" for e in error.errors()[:5])
        return problem_response(Problem(422, said, "see /openapi.json"))

    @app.exception_handler(HTTPException)
    async def _(_request: Request, error: HTTPException) -> Response:
        return problem_response(Problem(error.status_code, str(error.detail), "", error.headers))

    @app.exception_handler(Exception)
    async def _(_request: Request, _error: Exception) -> Response:
        return problem_response(Problem(500, "the server failed", "its log tells more to its operator"))
