"""Bodies that no phone sends: examples changed byte by byte, value by value, or made of nothing."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from wayfuse.service.routes.examples import EXAMPLES

__all__ = ["hostile", "spoiled"]

_RAW = (b"1e999", b"-0", b"null", b"{}", b"[", b'"', b"\xff\xfe", b"9" * 40, b"NaN", b"\x00", b"\\ud800")
_VALUES: tuple[Any, ...] = (
    None, True, -1, 0, 1e308, -1e308, 2**63, 1e-320, "", "\x00", "'; drop table log; --", "\u202e", [], {}, [[]],
    "x" * 300, 1e12, -1e12, 4.9e-324, "00:00:00:00:00:00",
)  # fmt: skip


def hostile(adapter: str, draw: np.random.Generator) -> bytes:
    """A body for an adapter of `routes.examples.EXAMPLES`."""
    example = EXAMPLES[adapter]
    kind = draw.random()
    if kind < 0.1:
        return draw.bytes(int(draw.integers(0, 200)))
    if kind < 0.15:
        deep = int(draw.integers(1, 3000))
        return b'{"v":1,"device":"deep","wifi":' + b"[" * deep + b"]" * deep + b"}"
    if kind < 0.6 and not isinstance(example, str):
        return json.dumps(_changed(example, draw)).encode("utf-8", "surrogatepass")
    body = example.encode() if isinstance(example, str) else json.dumps(example).encode()
    return spoiled(body, draw)


def _changed(value: Any, draw: np.random.Generator) -> Any:
    """A value with some of its parts put to something else, left out or said twice."""
    if draw.random() < 0.03:
        return _VALUES[int(draw.integers(len(_VALUES)))]
    if isinstance(value, dict):
        return {k: _changed(v, draw) for k, v in value.items() if draw.random() > 0.02}
    if isinstance(value, list):
        times = [0, 1, 1, 1, 1, 1, 1, 2, 50]
        return [_changed(v, draw) for v in value for _ in range(times[int(draw.integers(len(times)))])]
    return value


def spoiled(body: bytes, draw: np.random.Generator) -> bytes:
    """A body with up to four cuts, copies, bits turned and foreign pieces."""
    b = bytearray(body)
    for _ in range(int(draw.integers(1, 5))):
        at, to = sorted(draw.integers(0, len(b) + 1, 2).tolist())
        kind = int(draw.integers(0, 4))
        if kind == 0 and at < len(b):
            b[at] ^= 1 << int(draw.integers(0, 8))
        elif kind == 1:
            del b[at : min(to, at + 12)]
        elif kind == 2:
            b[at:at] = b[at : min(to, at + 60)]
        else:
            b[at:at] = _RAW[int(draw.integers(len(_RAW)))]
    return bytes(b)
