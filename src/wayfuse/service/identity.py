"""Pseudonyms: devices and tracks are known inside by keyed digests of what they call themselves.

Without the key of the site (a file beside the data, not in the database) nobody can tell from a pseudonym which phone
it was, nor try out the few million addresses of a maker.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from hashlib import blake2b
from pathlib import Path

from wayfuse.core.errors import UsageError

__all__ = ["KEY_BYTES", "Pseudonyms", "is_random_address", "load_key"]

KEY_BYTES = 32
_ADDRESS = re.compile(r"(?:[0-9A-Fa-f]{2}[:-]){5}[0-9A-Fa-f]{2}|[0-9A-Fa-f]{12}")


class Pseudonyms:
    """Names under a key: 16 hexadecimal digits each, equal for equal names."""

    def __init__(self, key: bytes) -> None:
        self._key = key

    def device(self, name: str) -> str:
        """Of a device by what it calls itself."""
        return self._digest("device", name)

    def track(self, site: str, device: str, session: str) -> str:
        """Of a session of a device at a site."""
        return self._digest("track", site, device, session)

    def _digest(self, *parts: str) -> str:
        digest = blake2b(digest_size=8, key=self._key)
        for part in parts:
            raw = part.encode("utf-8", "surrogatepass")
            digest.update(len(raw).to_bytes(8, "big") + raw)
        return digest.hexdigest()


def load_key(path: Path, random: Callable[[int], bytes]) -> bytes:
    """The key in a file; made, readable by the owner alone, where there is none.

    Raises
    ------
    UsageError : the file holds something else.
    """
    if not path.exists():
        path.touch(mode=0o600)
        path.write_bytes(random(KEY_BYTES).hex().encode())
    try:
        key = bytes.fromhex(path.read_text(encoding="ascii").strip())
    except ValueError:
        key = b""
    if len(key) != KEY_BYTES:
        raise UsageError(
            "not the key of a server", where=path, remedy="restore it, or remove it and lose the pseudonyms"
        )
    return key


def is_random_address(name: str) -> bool:
    """Whether a name is a hardware address that its device drew at random (locally administered bit).

    >>> is_random_address("da:a1:19:00:00:01"), is_random_address("00:1b:63:00:00:01"), is_random_address("tag-7")
    (True, False, False)
    """
    return _ADDRESS.fullmatch(name) is not None and bool(int(name[1], 16) & 2)
