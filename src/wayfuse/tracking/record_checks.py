"""What can be made of a step that a phone worked out itself (liu2017, chu2009 chapter 5), and of a range."""

from __future__ import annotations

import math
from collections.abc import Sequence

from wayfuse.core.angles import wrap
from wayfuse.inertial.front_end import StepEvent
from wayfuse.sensors.quality import Verdict
from wayfuse.sensors.records import Range, Step

__all__ = ["judge_range", "judge_step", "step_event"]

_USUAL, _LONGEST = 0.7, 2.5  # m, of a step
_USUAL_DURATION = 0.55  # s
_LONGEST_RANGE = 1e3  # m; no radio ranges further indoors


def judge_step(step: Step) -> Verdict:
    """`Verdict.USED`, or why nothing can be made of the step; an unknown length (NaN) is no fault."""
    if not math.isfinite(step.heading) or math.isinf(step.length):
        return Verdict.NOT_FINITE
    if math.isfinite(step.length) and not 0.0 <= step.length <= _LONGEST:
        return Verdict.OUT_OF_RANGE
    return Verdict.USED


def step_event(step: Step) -> StepEvent:
    """The step as an event of `InertialFrontEnd`, of the usual length where the phone does not know it."""
    length = step.length if math.isfinite(step.length) else _USUAL
    return StepEvent(step.t, length, float(wrap(step.heading)), _USUAL_DURATION, 0.0, 0.0, 0.0, 0.0, 1.0)


def judge_range(measured: Range, moment: Sequence[Range]) -> Verdict:
    """`Verdict.USED`, or why nothing can be made of the range beside those of its moment that came before."""
    if not math.isfinite(measured.distance):
        return Verdict.NOT_FINITE
    if abs(measured.distance) > _LONGEST_RANGE:
        return Verdict.OUT_OF_RANGE
    if any(other.anchor == measured.anchor for other in moment):
        return Verdict.DUPLICATE
    return Verdict.USED
