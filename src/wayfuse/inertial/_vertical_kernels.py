"""The compiled core of the vertical front end: one record in, memory changed, a report or nothing out.

Records only add to the sums of the bin their time falls in; a bin is judged by the first record beyond it. So the
order of records of equal time does not matter, and rates from 1 Hz to 400 Hz come to the same.
"""

from __future__ import annotations

import numpy as np

from wayfuse.core.jit import uncounted_kernel
from wayfuse.core.types import Array
from wayfuse.inertial import _vertical_layout as at
from wayfuse.inertial._speed_kernels import DELAY, judge_speed, lean, restart, turn

__all__ = ["consume", "consume_series", "finish"]

REPORT_PERIOD = 1.0  # s
SETTLED = 3.0  # s on the level after which a movement found without a barometer is over
BELIEF_OVER = 0.75  # belief in the level that ends a movement: less is at stake than in its beginning
BELIEF_AGREED = 0.5  # belief of the accelerations from which they support the barometer
SPEED_SPAN = 20  # ticks over which the speed of a lift or escalator is taken: 4 s


@uncounted_kernel
def recall(v: Array, ring: int, back: int) -> float:
    """Entry of a ring `back` ticks before the last judged one."""
    return float(v[ring + int(v[at.V_TICKS] - 1 - back) % at.N_RING])


@uncounted_kernel
def reach(v: Array) -> int:
    """How many ticks one may look back: to the end of the last movement, or `N_REACH`."""
    return int(min(v[at.V_TICKS] - 1 - v[at.V_FROM], at.N_REACH))


@uncounted_kernel
def steps_at(v: Array, now: float, t: float) -> float:
    """Steps counted until a time of the last 25 s."""
    back = int(min((now - t) / at.TICK, min(at.N_RING, v[at.V_TICKS]) - 1))
    return recall(v, at.V_RING_STEPS, max(back, 0))


@uncounted_kernel
def push(v: Array, p: Array) -> None:
    """Close the bin: its altitude, the running mean and the count of steps go into the rings."""
    n = int(v[at.V_TICKS]) % at.N_RING
    if v[at.V_P_N] > 0.0:
        v[at.V_P_LAST] = v[at.V_P_SUM] / v[at.V_P_N]
    v[at.V_RING_RAW + n] = v[at.V_P_LAST]
    v[at.V_RING_STEPS + n] = v[at.V_STEPS]
    v[at.V_TICKS] += 1.0
    width = min(int(p[at.P_WINDOW]), reach(v) + 1)
    total = 0.0
    for back in range(width):
        total += recall(v, at.V_RING_RAW, back)
    v[at.V_RING_Z + n] = total / max(width, 1)
    v[at.V_P_SUM], v[at.V_P_N] = 0.0, 0.0


@uncounted_kernel
def report(v: Array, p: Array, t: float, now: float, is_over: bool, e: Array) -> None:
    """Write a report of the movement under way."""
    ended = v[at.V_ENDED]
    until = now if np.isnan(ended) else ended
    steps = max(steps_at(v, now, until) - v[at.V_STEPS0], 0.0)
    e[at.E_T], e[at.E_BEGAN], e[at.E_BEHAVIOUR] = t, v[at.V_BEGAN], v[at.V_BEHAVIOUR]
    if v[at.V_PRESSED] > 0.0:
        rise = recall(v, at.V_RING_Z, 0) - v[at.V_LEVEL]
        sigma, relative = p[at.P_SIGMA], p[at.P_SIGMA_RELATIVE]
    elif v[at.V_RISE] == 0.0 and not np.isnan(ended):  # taken back
        steps, rise, sigma, relative = 0.0, 0.0, p[at.P_SPEED_SIGMA], 0.0
    else:
        # on stairs a count of steps is better than a speed
        rise = v[at.V_SIGN] * steps * p[at.P_RISER] if v[at.V_BEHAVIOUR] == at.STAIRS else v[at.V_RISE]
        sigma, relative = p[at.P_SPEED_SIGMA], p[at.P_SPEED_SIGMA_RELATIVE]
    e[at.E_RISE], e[at.E_STEPS] = rise, steps
    e[at.E_SIGMA] = np.sqrt(sigma * sigma + (relative * rise) ** 2)
    e[at.E_OVER], e[at.E_ENDED], e[at.E_PRESSURE] = (1.0 if is_over else 0.0), np.nan, v[at.V_PRESSED]
    if is_over:
        e[at.E_ENDED] = until
    v[at.V_REPORTED] = t


@uncounted_kernel
def end(v: Array, p: Array, t: float, now: float, e: Array) -> None:
    """Report the movement under way for the last time."""
    report(v, p, t, now, True, e)
    v[at.V_BEHAVIOUR], v[at.V_ENDED] = 0.0, np.nan
    v[at.V_FROM] = v[at.V_TICKS] - 1.0


@uncounted_kernel
def carried_by(v: Array, p: Array, speed: float) -> float:
    """Lift or escalator: on an escalator one steps while it runs, and it is slower than lifts are."""
    return at.ESCALATOR if v[at.V_ONTO] > 0.0 and speed < p[at.P_LIFT_SPEED] else at.LIFT


@uncounted_kernel
def note_start(v: Array, now: float, began: float) -> None:
    """Keep when a movement began, the steps until then, and whether one stepped onto it."""
    v[at.V_BEGAN], v[at.V_STEPS0] = began, steps_at(v, now, began)
    v[at.V_ONTO] = 1.0 if steps_at(v, now, began + 1.0) - steps_at(v, now, began - 3.0) > 1.0 else 0.0
    v[at.V_ENDED], v[at.V_SPEED] = np.nan, 0.0


# --- with a barometer -------------------------------------------------------------------------------------
@uncounted_kernel
def classify(v: Array, p: Array, now: float) -> None:
    """Stairs where one steps, else a lift or an escalator."""
    if reach(v) >= SPEED_SPAN:
        gained = abs(recall(v, at.V_RING_Z, 0) - recall(v, at.V_RING_Z, SPEED_SPAN))
        v[at.V_SPEED] = max(v[at.V_SPEED], gained / (SPEED_SPAN * at.TICK))
    steps = recall(v, at.V_RING_STEPS, 0) - v[at.V_STEPS0]
    if steps >= p[at.P_STAIR_RATE] * (now - v[at.V_BEGAN]):
        v[at.V_BEHAVIOUR] = at.STAIRS
    else:
        v[at.V_BEHAVIOUR] = carried_by(v, p, v[at.V_SPEED])


@uncounted_kernel
def gradual_rise(v: Array, p: Array, back: int) -> float:
    """Rise over the last ticks (m, not negative) less its fastest part, made up for the time that takes.

    That part is as long as a jump of the pressure takes through the running mean, so a jump counts for nothing.
    """
    width = int(p[at.P_WINDOW]) + 2
    if back <= width:
        return 0.0
    rise = recall(v, at.V_RING_Z, 0) - recall(v, at.V_RING_Z, back)
    most = 0.0
    for k in range(back - width + 1):
        gained = recall(v, at.V_RING_Z, k) - recall(v, at.V_RING_Z, k + width)
        most = max(most, gained * np.sign(rise))
    return float((abs(rise) - most) * back / (back - width))


@uncounted_kernel
def begin_pressed(v: Array, p: Array, now: float) -> bool:
    """Find a movement where the altitude has risen or fallen enough."""
    far = reach(v)
    z = recall(v, at.V_RING_Z, 0)
    recent = z - recall(v, at.V_RING_Z, min(far, int(p[at.P_RISE_WINDOW] / at.TICK)))
    sign = np.sign(recent)
    needed = p[at.P_RISE_AGREED] if belief(v, sign) > BELIEF_AGREED else p[at.P_RISE]
    if abs(recent) < needed / 1.5:
        return False
    lowest = z * sign
    for back in range(far + 1):
        lowest = min(lowest, recall(v, at.V_RING_Z, back) * sign)
    start = 0
    while start < far and recall(v, at.V_RING_Z, start) * sign > lowest + 0.15:
        start += 1
    rise = (z - recall(v, at.V_RING_Z, start)) * sign
    if rise < needed or gradual_rise(v, p, start) < p[at.P_GRADUAL] * needed:
        return False
    note_start(v, now, now - (start + 0.5 * p[at.P_WINDOW]) * at.TICK)
    v[at.V_LEVEL], v[at.V_SIGN], v[at.V_PRESSED] = recall(v, at.V_RING_Z, start), sign, 1.0
    classify(v, p, now)
    return True


@uncounted_kernel
def is_over_pressed(v: Array, p: Array, now: float) -> bool:
    """Follow a movement; whether the altitude has stayed."""
    classify(v, p, now)
    back = min(int(p[at.P_END_TIME] / at.TICK), int(v[at.V_TICKS]) - 1)
    gained = (recall(v, at.V_RING_Z, 0) - recall(v, at.V_RING_Z, back)) * v[at.V_SIGN]
    if gained >= p[at.P_END_SPEED] * p[at.P_END_TIME]:
        return False
    v[at.V_ENDED] = max(now - (back + 0.5 * p[at.P_WINDOW]) * at.TICK, v[at.V_BEGAN])
    return True


# --- without ----------------------------------------------------------------------------------------------
@uncounted_kernel
def belief(v: Array, sign: float) -> float:
    """Probability that one moves up (sign 1), down (-1) or not at all (0), by the branches."""
    total = 0.0
    for i in range(int(v[at.V_N_BRANCH])):
        o = at.V_BRANCHES + i * at.B_SIZE
        mode = v[o + at.B_MODE]
        way = 0.0 if mode == 0.0 else (1.0 if mode % 2.0 == 1.0 else -1.0)
        if way == sign:
            total += np.exp(v[o + at.B_WEIGHT])
    return float(total)


@uncounted_kernel
def best_branch(v: Array) -> int:
    """Place of the most probable branch in the memory."""
    best = at.V_BRANCHES
    for i in range(int(v[at.V_N_BRANCH])):
        o = at.V_BRANCHES + i * at.B_SIZE
        if v[o + at.B_WEIGHT] > v[best + at.B_WEIGHT]:
            best = o
    return best


@uncounted_kernel
def begin_unpressed(v: Array, p: Array, now: float) -> bool:
    """Find a movement that the branches believe in."""
    b = best_branch(v)
    mode = v[b + at.B_MODE]
    sign = 1.0 if mode % 2.0 == 1.0 else -1.0
    is_new = mode > 0.0 and now - v[b + at.B_BEGAN] > p[at.P_LEAST_TIME]
    if not is_new or belief(v, sign) < p[at.P_BELIEF]:
        return False
    note_start(v, now, v[b + at.B_BEGAN] - DELAY)
    if mode < 3.0 and v[at.V_STEPS] - v[at.V_STEPS0] < p[at.P_STAIR_RATE] * (now - v[at.V_BEGAN]):
        return False
    v[at.V_SIGN], v[at.V_PRESSED], v[at.V_LEVEL] = sign, 0.0, v[b + at.B_TOTAL]
    v[at.V_RISE] = v[b + at.B_RISE]
    v[at.V_BEHAVIOUR] = at.STAIRS if mode < 3.0 else carried_by(v, p, abs(v[b + at.B_S]))
    return True


@uncounted_kernel
def is_over_unpressed(v: Array, p: Array, now: float) -> bool:
    """Follow a movement; whether the branches believe that it is over, or that there was none."""
    if v[at.V_N_BRANCH] == 0.0:  # shaken or silent: what is known stays
        v[at.V_ENDED] = now
        return True
    b = best_branch(v)
    mode = v[b + at.B_MODE]
    moves_on = mode > 0.0 and (mode % 2.0 == 1.0) == (v[at.V_SIGN] > 0.0)
    v[at.V_RISE] = v[b + at.B_TOTAL] - v[at.V_LEVEL] + (v[b + at.B_RISE] if moves_on else 0.0)
    if moves_on:
        v[at.V_BEHAVIOUR] = at.STAIRS if mode < 3.0 else carried_by(v, p, abs(v[b + at.B_S]))
        return False
    is_known = v[b + at.B_LAST_ENDED] > v[at.V_BEGAN] and v[at.V_RISE] * v[at.V_SIGN] > 0.0
    ended = v[b + at.B_LAST_ENDED] if is_known else v[at.V_BEGAN]
    is_over = belief(v, -v[at.V_SIGN]) > p[at.P_BELIEF] or (
        belief(v, 0.0) > BELIEF_OVER and now - ended > SETTLED
    )
    if is_over:
        v[at.V_ENDED] = max(ended - DELAY, v[at.V_BEGAN])
        if not is_known:
            v[at.V_RISE] = 0.0
    return bool(is_over)


# --- records ----------------------------------------------------------------------------------------------
@uncounted_kernel
def tick(v: Array, p: Array, t: float, e: Array) -> bool:
    """Judge the bin that is complete; True when there is a report in ``e``."""
    push(v, p)
    now = (v[at.V_BIN] + 1.0) * at.TICK
    has_looked = judge_speed(v, p, now) or v[at.V_N_BRANCH] == 0.0
    is_pressed = p[at.P_USE_PRESSURE] > 0.0 and now - v[at.V_T_P] <= p[at.P_STALE]
    if v[at.V_BEHAVIOUR] == 0.0:
        if is_pressed:
            found = begin_pressed(v, p, now)
        else:
            found = has_looked and v[at.V_N_BRANCH] > 0.0 and begin_unpressed(v, p, now)
        if found:
            report(v, p, t, now, False, e)
        return found
    if is_pressed != (v[at.V_PRESSED] > 0.0):  # the barometer has come or gone
        v[at.V_ENDED] = now
        end(v, p, t, now, e)
        return True
    is_over = is_over_pressed(v, p, now) if is_pressed else has_looked and is_over_unpressed(v, p, now)
    if is_over:
        end(v, p, t, now, e)
        return True
    if t - v[at.V_REPORTED] >= REPORT_PERIOD:
        report(v, p, t, now, False, e)
        return True
    return False


@uncounted_kernel
def advance(v: Array, p: Array, t: float, e: Array) -> bool:
    """Judge the bins that are complete at time t; True when there is a report (an end is never hidden)."""
    number = np.floor(t / at.TICK)
    if np.isnan(v[at.V_BIN]):
        v[at.V_BIN] = number
        return False
    if (number - v[at.V_BIN]) * at.TICK > p[at.P_GAP]:
        found = tick(v, p, t, e)
        if v[at.V_BEHAVIOUR] > 0.0:
            finish(v, p, t, e)
            found = True
        restart(v)
        v[at.V_BIN], v[at.V_FROM] = number, v[at.V_TICKS]
        return found
    found, is_over = False, False
    while v[at.V_BIN] < number:
        if is_over:
            push(v, p)
        else:
            found = tick(v, p, t, e) or found
            is_over = found and e[at.E_OVER] > 0.0
        v[at.V_BIN] += 1.0
    return found


@uncounted_kernel
def finish(v: Array, p: Array, t: float, e: Array) -> bool:
    """End the movement under way at the end of the recording."""
    if v[at.V_BEHAVIOUR] == 0.0:
        return False
    now = v[at.V_BIN] * at.TICK
    v[at.V_ENDED] = now
    end(v, p, t, now, e)
    return True


@uncounted_kernel
def consume(v: Array, p: Array, kind: int, t: float, a: float, b: float, c: float, e: Array) -> bool:
    """Feed one record of a kind; True when it completes a report, written to ``e`` (N_EVENT,)."""
    # NaN compares false; 1e6 of any unit is a fault, and would stay in the sums for good
    if not (np.isfinite(t) and abs(a) < 1e6 and abs(b) < 1e6 and abs(c) < 1e6):
        return False
    if kind == at.PRESSURE and not 300.0 < a < 1200.0:  # hPa: the highest road to a storm in a deep mine
        return False
    elapsed = t - v[at.V_T_ACC + kind]
    if -p[at.P_GAP] < elapsed < 0.0:  # late: what came after it has been used
        return False
    found = advance(v, p, t, e)
    if elapsed < 0.0:  # the clock was set back
        found = finish(v, p, t, e) or found
        v[at.V_BIN], v[at.V_FROM] = np.floor(t / at.TICK), v[at.V_TICKS]
        v[at.V_T_ACC : at.V_T_STEP + 1] = -np.inf
        restart(v)
        elapsed = np.inf
    v[at.V_T_ACC + kind] = t
    if kind == at.ACCELERATION:
        lean(v, p, t, elapsed, a, b, c)
    elif kind == at.ROTATION_RATE:
        turn(v, elapsed, a, b, c)
    elif kind == at.PRESSURE:
        z = 44330.8 * (1.0 - (a / 1013.25) ** 0.190263)  # standard atmosphere, ISO 2533
        if np.isnan(v[at.V_P_ZERO]):
            v[at.V_P_ZERO] = z
            v[at.V_FROM] = v[at.V_TICKS]
        v[at.V_P_SUM] += z - v[at.V_P_ZERO]
        v[at.V_P_N] += 1.0
    else:
        v[at.V_STEPS] += 1.0
    return found


@uncounted_kernel
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
