"""Bodies that are nearly right."""

from __future__ import annotations

import json

import numpy as np

from wayfuse.service.routes.examples import EXAMPLES

__all__ = ["body_of", "mutated"]


def body_of(adapter: str) -> bytes:
    """The example of an adapter."""
    example = EXAMPLES[adapter]
    return example.encode() if isinstance(example, str) else json.dumps(example).encode()


def mutated(body: bytes, draw: np.random.Generator) -> bytes:
    """A body with some bytes changed, left out, doubled, or a number put in for another."""
    b = bytearray(body)
    for _ in range(int(draw.integers(1, 6))):
        at, to = sorted(draw.integers(0, len(b) + 1, 2).tolist())
        kind = draw.integers(0, 5)
        if kind == 0 and at < len(b):
            b[at] = int(draw.integers(0, 256))
        elif kind == 1:
            del b[at : min(to, at + 8)]
        elif kind == 2:
            b[at:at] = b[at : min(to, at + 40)]
        elif kind == 3:
            b[at:at] = draw.choice([b"1e999", b"-0", b"null", b"{}", b"[]", b'"', b"\xff", b"9" * 30, b"NaN"])
        elif at < len(b):
            digits = [i for i in range(at, min(to, at + 60)) if 48 <= b[i] < 58]
            for i in digits:
                b[i] = 48 + int(draw.integers(0, 10))
    return bytes(b)
