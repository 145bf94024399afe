"""An answer that is made in a file, for it may be larger than the memory should hold, and deleted when it is sent."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path

from fastapi.responses import FileResponse
from starlette.background import BackgroundTask

__all__ = ["sent_file"]


def sent_file(write: Callable[[Path], object], media: str, name: str) -> FileResponse:
    """Send what ``write`` writes to the path it is given, as a file of a name."""
    with tempfile.NamedTemporaryFile(delete=False) as file:
        path = Path(file.name)
    try:
        write(path)
    except BaseException:
        path.unlink()
        raise
    return FileResponse(path, media_type=media, filename=name, background=BackgroundTask(path.unlink))
