"""The compiled core of the vertical front end: one record in, memory changed, a report or nothing out.

Records only add to the sums of the bin their time falls in; a bin is judged by the first record beyond it. So the
order of records of equal time does not matter, and rates from 1 Hz to 400 Hz come to the same.
"""

from __future__ import annotations

import numpy as np

from wayfuse.core.jit import kernel
from wayfuse.core.types import Array
from wayfuse.inertial import _vertical_layout as at

__all__ = ["consume", "consume_series", "finish"]


@kernel
def recall(v: Array, ring: int, back: int) -> float:
    """Entry of a ring `back` ticks before the last judged one."""
    return float(v[ring + int(v[at.V_TICKS] - 1 - back) % at.N_RING])


@kernel
def reach(v: Array) -> int:
    """How many ticks one may look back: to the end of the last movement, at most the ring."""
    return int(min(v[at.V_TICKS] - 1 - v[at.V_FROM], at.N_RING - 1))


@kernel
def push(v: Array, p: Array) -> None:
    """Close the bin: its altitude, the running mean and the count of steps go into the rings."""
    n = int(v[at.V_TICKS]) % at.N_RING
    if v[at.V_P_N] > 0.0:
        v[at.V_P_LAST] = v[at.V_P_SUM] / v[at.V_P_N]
    v[at.V_RING_RAW + n] = v[at.V_P_LAST]
    v[at.V_RING_STEPS + n] = v[at.V_STEPS]
    v[at.V_TICKS] += 1.0
    width = min(int(p[at.P_WINDOW]), int(v[at.V_TICKS]))
    total = 0.0
    for back in range(width):
        total += recall(v, at.V_RING_RAW, back)
    v[at.V_RING_Z + n] = total / width
    v[at.V_P_SUM], v[at.V_P_N] = 0.0, 0.0


@kernel
def report(v: Array, p: Array, t: float, ended: float, e: Array) -> None:
    """Write a report of the movement under way."""
    rise = recall(v, at.V_RING_Z, 0) - v[at.V_Z0]
    e[at.E_T], e[at.E_BEGAN], e[at.E_BEHAVIOUR] = t, v[at.V_BEGAN], v[at.V_BEHAVIOUR]
    e[at.E_RISE] = rise
    e[at.E_SIGMA] = np.sqrt(p[at.P_SIGMA] ** 2 + (p[at.P_SIGMA_RELATIVE] * rise) ** 2)
    e[at.E_STEPS] = recall(v, at.V_RING_STEPS, 0) - v[at.V_STEPS0]
    e[at.E_OVER], e[at.E_ENDED], e[at.E_PRESSURE] = 1.0 if ended == ended else 0.0, ended, 1.0
    v[at.V_REPORTED] = t


@kernel
def classify(v: Array, p: Array, now: float) -> None:
    """Stairs where one steps, else a lift or an escalator by the greatest vertical speed."""
    if reach(v) >= 15:
        v[at.V_SPEED] = max(
            v[at.V_SPEED], abs(recall(v, at.V_RING_Z, 0) - recall(v, at.V_RING_Z, 15)) / (15 * at.TICK)
        )
    steps = recall(v, at.V_RING_STEPS, 0) - v[at.V_STEPS0]
    if steps >= p[at.P_STAIR_RATE] * (now - v[at.V_BEGAN]):
        v[at.V_BEHAVIOUR] = at.STAIRS
    else:
        v[at.V_BEHAVIOUR] = at.LIFT if v[at.V_SPEED] > p[at.P_LIFT_SPEED] else at.ESCALATOR


@kernel
def is_jump(v: Array, p: Array, back: int) -> bool:
    """Whether most of a rise came within the time that a jump takes through the running mean."""
    width = int(p[at.P_WINDOW]) + 2
    rise = recall(v, at.V_RING_Z, 0) - recall(v, at.V_RING_Z, back)
    most = 0.0
    for k in range(max(back - width, 0) + 1):
        most = max(
            most,
            (recall(v, at.V_RING_Z, k) - recall(v, at.V_RING_Z, min(k + width, back))) * np.sign(rise),
        )
    return bool(most > p[at.P_JUMP] * abs(rise))


@kernel
def begin(v: Array, p: Array, t: float, now: float, e: Array) -> bool:
    """Declare a movement where the altitude has risen or fallen enough."""
    far = reach(v)
    window = min(far, int(p[at.P_RISE_WINDOW] / at.TICK))
    z = recall(v, at.V_RING_Z, 0)
    recent = z - recall(v, at.V_RING_Z, window)
    if abs(recent) < p[at.P_RISE] / 1.5:
        return False
    sign = np.sign(recent)
    lowest = z * sign
    for back in range(far + 1):
        lowest = min(lowest, recall(v, at.V_RING_Z, back) * sign)
    start = 0
    while start < far and recall(v, at.V_RING_Z, start) * sign > lowest + 0.15:
        start += 1
    if (z - recall(v, at.V_RING_Z, start)) * sign < p[at.P_RISE] or is_jump(v, p, start):
        return False
    v[at.V_BEGAN] = now - (start + 0.5 * p[at.P_WINDOW]) * at.TICK
    v[at.V_Z0], v[at.V_SIGN], v[at.V_SPEED] = recall(v, at.V_RING_Z, start), sign, 0.0
    v[at.V_STEPS0] = recall(v, at.V_RING_STEPS, min(start + int(0.5 * p[at.P_WINDOW]), far))
    classify(v, p, now)
    report(v, p, t, np.nan, e)
    return True


@kernel
def end(v: Array, p: Array, t: float, ended: float, e: Array) -> None:
    """Report the movement under way for the last time."""
    report(v, p, t, ended, e)
    v[at.V_BEHAVIOUR] = 0.0
    v[at.V_FROM] = v[at.V_TICKS] - 1.0


@kernel
def tick(v: Array, p: Array, t: float, e: Array) -> bool:
    """Judge the bin that is complete; True when there is a report in ``e``."""
    push(v, p)
    v[at.V_ACC_SUM], v[at.V_ACC_N] = 0.0, 0.0
    now = (v[at.V_BIN] + 1.0) * at.TICK
    is_pressed = p[at.P_USE_PRESSURE] > 0.0 and now - v[at.V_T_P] <= p[at.P_STALE]
    if v[at.V_BEHAVIOUR] == 0.0:
        return is_pressed and begin(v, p, t, now, e)
    if not is_pressed:
        end(v, p, t, v[at.V_T_P], e)
        return True
    classify(v, p, now)
    back = min(int(p[at.P_END_TIME] / at.TICK), int(v[at.V_TICKS]) - 1)
    gained = (recall(v, at.V_RING_Z, 0) - recall(v, at.V_RING_Z, back)) * v[at.V_SIGN]
    if gained < p[at.P_END_SPEED] * p[at.P_END_TIME]:
        end(v, p, t, now - (back + 0.5 * p[at.P_WINDOW]) * at.TICK, e)
        return True
    if t - v[at.V_REPORTED] >= 1.0:
        report(v, p, t, np.nan, e)
        return True
    return False


@kernel
def advance(v: Array, p: Array, t: float, e: Array) -> bool:
    """Judge the bins that are complete at time t; True when there is a report (an end is never hidden)."""
    number = np.floor(t / at.TICK)
    if not v[at.V_BIN] == v[at.V_BIN]:
        v[at.V_BIN] = number
        return False
    if (number - v[at.V_BIN]) * at.TICK > p[at.P_GAP]:
        found = tick(v, p, t, e)
        if v[at.V_BEHAVIOUR] > 0.0:
            end(v, p, t, (v[at.V_BIN] + 1.0) * at.TICK, e)
            found = True
        v[at.V_BIN], v[at.V_FROM] = number, v[at.V_TICKS]
        return found
    found, over = False, False
    while v[at.V_BIN] < number:
        if not over:
            found = tick(v, p, t, e) or found
            over = found and e[at.E_OVER] > 0.0
        else:
            push(v, p)
        v[at.V_BIN] += 1.0
    return found


@kernel
def consume(v: Array, p: Array, kind: int, t: float, a: float, b: float, c: float, e: Array) -> bool:
    """Feed one record of a kind; True when it completes a report, written to ``e`` (N_EVENT,)."""
    if not (np.isfinite(t) and abs(a) < 1e6 and abs(b) < 1e6 and abs(c) < 1e6):
        return False
    if kind == at.PRESSURE and not 300.0 < a < 1200.0:
        return False
    elapsed = t - v[at.V_T_ACC + kind]
    if -p[at.P_GAP] < elapsed < 0.0:  # late: what came after it has been used
        return False
    found = advance(v, p, t, e)
    if elapsed < 0.0:  # the clock was set back
        v[at.V_BIN], v[at.V_FROM] = np.floor(t / at.TICK), v[at.V_TICKS]
        v[at.V_T_ACC : at.V_T_STEP + 1] = -np.inf
    v[at.V_T_ACC + kind] = t
    if kind == at.ACCELERATION:
        v[at.V_ACC_SUM] += np.sqrt(a * a + b * b + c * c)
        v[at.V_ACC_N] += 1.0
    elif kind == at.PRESSURE:
        z = 44330.8 * (1.0 - (a / 1013.25) ** 0.190263)  # standard atmosphere, ISO 2533
        if not v[at.V_P_ZERO] == v[at.V_P_ZERO]:
            v[at.V_P_ZERO] = z
            v[at.V_FROM] = v[at.V_TICKS]
        v[at.V_P_SUM] += z - v[at.V_P_ZERO]
        v[at.V_P_N] += 1.0
    elif kind == at.STEP:
        v[at.V_STEPS] += 1.0
    return found


@kernel
def finish(v: Array, p: Array, t: float, e: Array) -> bool:
    """End the movement under way at the end of the recording."""
    if v[at.V_BEHAVIOUR] == 0.0:
        return False
    end(v, p, t, t, e)
    return True


@kernel
def consume_series(v: Array, p: Array, series: tuple[Array, ...], steps: Array, events: Array) -> int:
    """Feed three series and the step times merged by time (a step last at equal times); number of reports."""
    ta, va, tg, vg, tp, vp = series
    i, j, k, m, n = 0, 0, 0, 0, 0
    while True:
        kind, t = -1, np.inf
        if i < len(ta):
            kind, t = at.ACCELERATION, ta[i]
        if j < len(tg) and (kind < 0 or tg[j] < t):
            kind, t = at.ROTATION_RATE, tg[j]
        if k < len(tp) and (kind < 0 or tp[k] < t):
            kind, t = at.PRESSURE, tp[k]
        if m < len(steps) and (kind < 0 or steps[m] < t):
            kind, t = at.STEP, steps[m]
        if kind < 0:
            return n
        found = False
        if kind == at.ACCELERATION:
            found = consume(v, p, kind, t, va[i, 0], va[i, 1], va[i, 2], events[n])
            i += 1
        elif kind == at.ROTATION_RATE:
            found = consume(v, p, kind, t, vg[j, 0], vg[j, 1], vg[j, 2], events[n])
            j += 1
        elif kind == at.PRESSURE:
            found = consume(v, p, kind, t, vp[k, 0], 0.0, 0.0, events[n])
            k += 1
        else:
            found = consume(v, p, kind, t, 0.0, 0.0, 0.0, events[n])
            m += 1
        if found:
            n += 1
