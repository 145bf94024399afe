"""The surveys of a server: of its radio maps, decoded once, and of what is being collected."""

from __future__ import annotations

import threading
from collections import OrderedDict
from hashlib import sha256
from pathlib import Path

from fastapi import Request

from wayfuse.core.errors import RadioMapError
from wayfuse.radio.survey import Survey
from wayfuse.service.server import Server
from wayfuse.service.web.jobs import Jobs
from wayfuse.service.web.survey_store import SurveyStore
from wayfuse.service.world import survey_of

__all__ = ["Surveys", "surveys_of"]

_KEPT = 2  # radio maps are large, and the page asks for many pictures of one


class Surveys:
    """Surveys of a server's sites; used from any thread."""

    def __init__(self, server: Server) -> None:
        self.jobs = Jobs(server.clock)
        self._server = server
        self._folder = Path(server.settings.data) / "survey"
        self._stores: dict[str, SurveyStore] = {}  # by name of the folder
        self._known: OrderedDict[tuple[str, int], Survey] = OrderedDict()
        self._lock = threading.Lock()

    def of(self, site: str, version: int | None = None) -> tuple[int, Survey]:
        """The version (None: the one in use) and its survey.

        Raises
        ------
        RadioMapError : there is no such version, or none is in use.
        """
        wanted = self._server.published(site) if version is None else version
        if wanted is None:
            raise RadioMapError(f"site {site} has no radio map in use", remedy="survey it, or upload one")
        key = (site, wanted)
        with self._lock:
            if key not in self._known:
                archive = self._server.sites.archive(site, wanted)
                self._known[key] = survey_of(self._server.worlds[site].site, archive)
            self._known.move_to_end(key)
            while len(self._known) > _KEPT:
                self._known.popitem(last=False)
            return wanted, self._known[key]

    def store(self, site: str) -> SurveyStore:
        """What is collected at a site."""
        with self._lock:
            return self._in(sha256(site.encode()).hexdigest()[:16])

    def everywhere(self) -> list[SurveyStore]:
        """What is collected at all sites, also at those that are no longer served."""
        with self._lock:
            return [self._in(path.name) for path in sorted(self._folder.glob("*")) if path.is_dir()]

    def clean(self) -> None:
        """Delete what is older than it may be."""
        before = self._server.clock() - 86_400.0 * self._server.settings.retain_survey_d
        for store in self.everywhere():
            store.trim(before)

    def forget(self, device: str) -> int:
        """Delete what a phone collected, by its pseudonym; how many files that were."""
        return sum(store.forget(device) for store in self.everywhere())

    def _in(self, folder: str) -> SurveyStore:
        if folder not in self._stores:
            self._stores[folder] = SurveyStore(self._folder / folder)
        return self._stores[folder]


def surveys_of(request: Request) -> Surveys:
    """The surveys of an application."""
    surveys: Surveys = request.app.state.surveys
    return surveys
