"""A mosquitto of one's own, on a free port of the loopback."""

from __future__ import annotations

import os
import shutil
import socket
import subprocess
import time
from pathlib import Path

__all__ = ["Mosquitto", "find_mosquitto", "free_port"]

_START_S = 60.0


def find_mosquitto() -> str | None:
    """The program, where it is on this machine."""
    return shutil.which("mosquitto", path=os.environ.get("PATH", "") + ":/usr/sbin")


def free_port() -> int:
    """A port of the loopback that nobody listens on."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port: int = free.getsockname()[1]
    return port


class Mosquitto:
    """A broker that anybody may use."""

    def __init__(self, program: str, folder: Path) -> None:
        self.port = free_port()
        self._config = folder / "mosquitto.conf"
        self._config.write_text(f"listener {self.port} 127.0.0.1\nallow_anonymous true\n", encoding="utf-8")
        self._program = program
        self.start()

    def start(self) -> None:
        """Begin, and wait until it listens."""
        quiet = subprocess.DEVNULL
        self._process = subprocess.Popen([self._program, "-c", self._config], stdout=quiet, stderr=quiet)
        end = time.monotonic() + _START_S
        while not self._is_up():
            if time.monotonic() > end:
                raise TimeoutError("the broker does not listen")
            time.sleep(0.02)

    def stop(self) -> None:
        """End at once."""
        self._process.kill()
        self._process.wait(30)

    def _is_up(self) -> bool:
        with socket.socket() as probe:
            return probe.connect_ex(("127.0.0.1", self.port)) == 0

    @property
    def url(self) -> str:
        """As the server's setting has it."""
        return f"mqtt://127.0.0.1:{self.port}"
