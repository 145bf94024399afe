"""Upload of a GetSensorData log, whole; the device and the session are named beside the body."""

from __future__ import annotations

import io

from wayfuse.core.errors import FormatError
from wayfuse.formats.getsensordata import read_stream
from wayfuse.service.adapters.parts import digest_key, merged, notes_of
from wayfuse.service.message import BadBodyError, Message, Part, Profile

__all__ = ["GetSensorData"]


class GetSensorData:
    """Adapter of uploaded logs; a log has its own clock, so each is a track of its own, and ends with the upload."""

    def read(self, body: bytes, profile: Profile, arrived: float) -> list[Message]:
        """One message per log."""
        key = digest_key(body)
        try:
            recording = read_stream(io.BytesIO(body), name=key)
        except FormatError as error:
            raise BadBodyError(error.what, remedy="send a GetSensorData log as the whole body") from error
        if not profile.device:
            raise BadBodyError("the log does not say which phone it is of", remedy="add ?device=NAME")
        part = Part(key, merged(recording.records()))
        session = profile.track or key
        return [Message(profile.device, session, body, (part,), True, notes_of(recording.report))]
