"""Random and mutated bodies over HTTP: never a crash, a traceback, or a lost good record."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mutations import body_of, mutated
from service_running import started

from wayfuse.presets.methods import build_method
from wayfuse.service.replay import envelopes
from wayfuse.service.routes.examples import EXAMPLES
from wayfuse.service.wire import encode

_EXPECTED = {200, 400, 422, 499}


def _fuzz(world: Any, data: Path, per_adapter: int, seed: int) -> Counter[int]:
    """Post a good walk with bad bodies between its envelopes; the statuses of the bad ones."""
    draw = np.random.default_rng(seed)
    statuses: Counter[int] = Counter()
    walk = world.walks[0]
    with started(world, data) as app:
        good = [encode(e) for e in envelopes(walk, "good phone", "good", 1.0)]
        track = ""
        for body in good:
            accepted = app.post("/api/v1/in/own", body).json()["accepted"][0]
            track = accepted["track"]
            for adapter in EXAMPLES:
                for _ in range(per_adapter // len(good) + 1):
                    # of what is nearly right, of good envelopes, and of nothing
                    source = [body_of(adapter), body_of(adapter), body[:2000], draw.bytes(50)]
                    bad = mutated(source[int(draw.integers(4))], draw)
                    path = f"/api/v1/in/{adapter}?platform=android&device=fuzz"
                    answer = app.post(path, bad.replace(b"good phone", b"fuzz"))
                    assert answer.status_code in _EXPECTED, (answer.status_code, adapter, bad)
                    assert "Traceback" not in answer.text
                    statuses[answer.status_code] += 1
        app.settle()
        assert app.client.get("/health").json()["status"] == "ok"
        assert app.server.live.counts["entries that failed"] == 0
        assert app.server.live.counts["entries that cannot be read"] == 0
        tracker = build_method("fused", world.site, world.survey, n_particles=100)
        expected = tracker.run(replace(walk, name=track)).estimates
        features = app.get(f"/api/v1/tracks/{track}/estimates").json()["features"]
        said = [(p["t"], p["x"], p["y"], p["floor"]) for p in (f["properties"] for f in features)]
        assert said == [e[:4] for e in expected]
    return statuses


def test_bad_bodies_among_good_ones(world: Any, tmp_path: Path) -> None:
    statuses = _fuzz(world, tmp_path, 40, seed=1)
    assert statuses[200] > 20
    assert statuses[400] > 20


@pytest.mark.slow
def test_thousands_of_bad_bodies(world: Any, tmp_path: Path) -> None:
    """A hundred thousand, on a running server: ``python -m benchmarks.server_fuzz``."""
    assert _fuzz(world, tmp_path, 1_000, seed=2).total() >= 5_000
