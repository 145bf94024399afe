"""Work that takes longer than a request: one job of a site at a time, with its progress."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from typing import Any, NamedTuple

from wayfuse.core.errors import UsageError, WayfuseError

__all__ = ["Job", "Jobs"]

_log = logging.getLogger(__name__)
_KEPT = 50
Work = Callable[[Callable[[float, str], None]], dict[str, Any]]


class Job(NamedTuple):
    """state : running, done or failed. share : 0 to 1. doing : what, or what went wrong. result : when done."""

    id: int
    site: str
    state: str
    share: float
    doing: str
    started: float
    result: dict[str, Any] | None = None


class Jobs:
    """The jobs of a server; ``clock`` gives Unix s. A stop of the server ends them without harm."""

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self._jobs: dict[int, Job] = {}
        self._lock = threading.Lock()

    def start(self, site: str, work: Work) -> Job:
        """Start a job; ``work`` is given a function that takes a share and what is being done.

        Raises
        ------
        UsageError : a job of this site is running.
        """
        with self._lock:
            if any(job.site == site and job.state == "running" for job in self._jobs.values()):
                raise UsageError("a job of this site is running", remedy="wait until it is done")
            job = Job(max(self._jobs, default=0) + 1, site, "running", 0.0, "", self._clock())
            self._jobs[job.id] = job
            for old in sorted(self._jobs)[:-_KEPT]:
                del self._jobs[old]
        threading.Thread(
            target=self._run, args=(job, work), name=f"wayfuse-job-{job.id}", daemon=True
        ).start()
        return job

    def get(self, identifier: int) -> Job | None:
        """A job, None where there is none."""
        with self._lock:
            return self._jobs.get(identifier)

    def last(self, site: str) -> Job | None:
        """The newest job of a site."""
        with self._lock:
            return max((j for j in self._jobs.values() if j.site == site), key=lambda j: j.id, default=None)

    def _run(self, job: Job, work: Work) -> None:
        def progress(share: float, doing: str) -> None:
            self._set(job.id, share=share, doing=doing)

        try:
            result = work(progress)
        except WayfuseError as error:
            self._set(
                job.id, state="failed", doing=f"{error.what}{f' ({error.remedy})' if error.remedy else ''}"
            )
        except Exception:  # whatever it is, whoever waits for it has to be told
            _log.exception("job %d failed", job.id)
            self._set(job.id, state="failed", doing="the server failed; its log tells more to its operator")
        else:
            self._set(job.id, state="done", share=1.0, doing="", result=result)

    def _set(self, identifier: int, **what: Any) -> None:
        with self._lock:
            if identifier in self._jobs:
                self._jobs[identifier] = self._jobs[identifier]._replace(**what)
