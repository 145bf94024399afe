"""All that is kept of one phone, in one archive: for the person who asks what is known of them."""

from __future__ import annotations

import json
import tempfile
import zipfile
from collections.abc import Collection, Sequence
from pathlib import Path

from wayfuse.service.export import to_csv
from wayfuse.service.history import estimates_of
from wayfuse.service.observations import write_observations
from wayfuse.service.server import Server
from wayfuse.service.web.survey_store import SurveyStore
from wayfuse.storage.tracks import TrackRow

__all__ = ["write_subject"]


def write_subject(server: Server, surveys: Sequence[SurveyStore], names: Collection[str], out: Path) -> int:
    """Write the archive of a phone, by its pseudonyms; of how many tracks.

    ::

        phone.json                  its enrolment, and its tracks with site and times (Unix s)
        tracks/TRACK.csv            the estimates of a track
        observations/TRACK.parquet  what its phone sent, as far as the log has it
        survey/N/...                scans it pushed for a survey, and walks tapped for it
    """
    rows = _tracks_of(server, names)
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        enrolled = [d for name in names if (d := server.devices.get(name)) is not None]
        said = {"enrolment": [d._asdict() for d in enrolled], "tracks": [row._asdict() for row in rows]}
        archive.writestr("phone.json", json.dumps(said, indent=1, ensure_ascii=False))
        for row in rows:
            _add_track(server, row, archive)
        for n, store in enumerate(surveys):
            for path in [p for name in names for p in store.files_of(name)]:
                archive.write(path, f"survey/{n}/{path.parent.name}/{path.name}")
    return len(rows)


def _tracks_of(server: Server, names: Collection[str]) -> list[TrackRow]:
    live = {v.row.track: v.row for v in server.live.views()}
    rows = {row.track: row for row in server.tracks.newest()} | live
    return sorted((row for row in rows.values() if row.device in names), key=lambda row: row.started)


def _add_track(server: Server, row: TrackRow, archive: zipfile.ZipFile) -> None:
    look = server.live.look(row.track)
    if look is not None and row.site in server.worlds:
        said = [e for _, e in estimates_of(server, look)]
        archive.writestr(f"tracks/{row.track}.csv", to_csv(server.worlds[row.site].site, said))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "observations.parquet"
        if write_observations(server.log.read(track=row.track), path):
            archive.write(path, f"observations/{row.track}.parquet")
