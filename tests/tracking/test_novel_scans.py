"""Scans from away from the survey weigh less, but for the bonus of particles that are away from it too."""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np

from wayfuse.filters.cloud import Cloud
from wayfuse.inertial.vertical import Behaviour, VerticalEvent
from wayfuse.presets.methods import build_method
from wayfuse.radio.sparse_knn import Neighbours
from wayfuse.tracking.engine import Known
from wayfuse.tracking.floor_change import Movement
from wayfuse.tracking.radio_parts import Radio


def _near(world: Any, distance: float) -> Neighbours:
    at = world.survey.xy[:5].astype(np.float32)
    floor = world.survey.floor[:5]
    return Neighbours(at[:, 0], at[:, 1], floor, np.full(5, 0.2, np.float32), distance, 9, 0.1)


def _cloud(x: float, y: float, floor: int) -> Cloud:
    one = np.ones(1, np.float32)
    return Cloud.on_floors(x * one, y * one, 0.0 * one, one, np.array([floor], np.int32))


def test_a_novel_scan_is_tempered_and_its_bonus_is_not(world: Any) -> None:
    radio = build_method("fused", world.site, world.survey).engine.radio
    novelty, trust, same = radio.observed(np.nan, _near(world, 0.1), walks=True)
    assert trust == 1.0
    assert same is radio.observation
    near = _near(world, 0.6)
    for _ in range(20):
        novelty, trust, tempered = radio.observed(novelty, near, walks=True)
    assert trust == radio.novelty.least
    assert tempered.exponent == trust * radio.observation.exponent
    x, y = near.x[0].item(), near.y[0].item()
    there, plain = np.zeros(1), np.zeros(1)
    tempered.log_likelihood(_cloud(x, y, int(near.floor[0])), near, there)
    radio.observation.log_likelihood(_cloud(x, y, int(near.floor[0])), near, plain)
    assert np.isclose(there[0], trust * plain[0])
    for observation in (tempered, radio.observation):
        far = np.zeros(1)
        observation.log_likelihood(_cloud(1e4, 1e4, int(near.floor[0])), near, far)
        background = observation.exponent * np.log(observation.background)
        assert np.isclose(far[0] - background, observation.coverage_gain)


@dataclass(frozen=True, kw_only=True)
class Asked(Radio):
    """Keeps what it was asked."""

    walks: list[bool] = field(default_factory=list)

    def observed(self, novelty: float, near: Neighbours, *, walks: bool) -> Any:
        """As of the class."""
        self.walks.append(walks)
        return super().observed(novelty, near, walks=walks)


def test_novelty_counts_only_while_steps_speak(world: Any) -> None:
    engine = build_method("fused", world.site, world.survey).engine
    radio = Asked(**{f.name: getattr(engine.radio, f.name) for f in fields(Radio)})
    engine = replace(engine, radio=radio)
    scan = world.survey.fingerprint(0)
    first = engine.on_fingerprint(engine.init("x", 0), 0.0, scan, Known())
    walking = first._replace(n_walked=50)
    lift = Movement(VerticalEvent(1.0, 0.5, Behaviour.LIFT, 0.4, 0.3, 0, False, np.nan, True))
    for state in (first, walking, walking._replace(is_quiet=True), walking._replace(movement=lift)):
        engine.on_fingerprint(state, 2.0, scan, Known())
    assert radio.walks == [False, True, False, False]
