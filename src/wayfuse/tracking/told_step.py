"""Steps that a phone worked out itself (liu2017, chu2009 chapter 5), as the front end would have reported them."""

from __future__ import annotations

import math

from wayfuse.core.angles import wrap
from wayfuse.inertial.front_end import StepEvent
from wayfuse.sensors.quality import Verdict
from wayfuse.sensors.records import Step

__all__ = ["judge", "to_event"]

_USUAL, _LONGEST = 0.7, 2.5  # m
_USUAL_DURATION = 0.55  # s


def judge(step: Step) -> Verdict:
    """`Verdict.USED`, or why nothing can be made of the step; an unknown length (NaN) is no fault."""
    if not math.isfinite(step.heading) or math.isinf(step.length):
        return Verdict.NOT_FINITE
    if math.isfinite(step.length) and not 0.0 <= step.length <= _LONGEST:
        return Verdict.OUT_OF_RANGE
    return Verdict.USED


def to_event(step: Step) -> StepEvent:
    """The step as an event of `InertialFrontEnd`, of the usual length where the phone does not know it."""
    length = step.length if math.isfinite(step.length) else _USUAL
    return StepEvent(step.t, length, float(wrap(step.heading)), _USUAL_DURATION, 0.0, 0.0, 0.0, 0.0, 1.0)
