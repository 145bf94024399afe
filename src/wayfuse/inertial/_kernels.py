"""The compiled core of the inertial front end: one record in, state changed, a step or nothing out.

State ``s``, parameters ``p`` and events are float64 vectors (`_layout`): a checkpoint is one small copy.
`consume` handles one record; `consume_series` walks the four motion series in the order of `Recording.records` and
calls the same function, hence both give the same bits. Why each rule: `attitude`, `heading`, `steps`.
"""

from __future__ import annotations

import numpy as np

from wayfuse.core.jit import uncounted_kernel
from wayfuse.core.types import Array
from wayfuse.inertial import _layout as at

__all__ = ["consume", "consume_series", "heading_of"]


@uncounted_kernel
def wrap_angle(a: float) -> float:
    """Angle in (-pi, pi]."""
    return float(np.pi - (np.pi - a) % (2.0 * np.pi))


# --- attitude ---------------------------------------------------------------------------------------------
@uncounted_kernel
def rotate_by(s: Array, rx: float, ry: float, rz: float, in_world: bool) -> None:
    """Turn the own attitude by a rotation vector given in world axes (left factor) or device axes (right)."""
    angle = np.sqrt(rx * rx + ry * ry + rz * rz)
    k = 0.5 if angle < 1e-9 else np.sin(0.5 * angle) / angle
    c, bx, by, bz = np.cos(0.5 * angle), k * rx, k * ry, k * rz
    w, x, y, z = s[at.S_Q], s[at.S_Q + 1], s[at.S_Q + 2], s[at.S_Q + 3]
    sign = -1.0 if in_world else 1.0  # the cross product changes its sign with the order of the factors
    nw = c * w - bx * x - by * y - bz * z
    nx = c * x + w * bx + sign * (y * bz - z * by)
    ny = c * y + w * by + sign * (z * bx - x * bz)
    nz = c * z + w * bz + sign * (x * by - y * bx)
    n = 1.0 / np.sqrt(nw * nw + nx * nx + ny * ny + nz * nz)
    s[at.S_Q], s[at.S_Q + 1], s[at.S_Q + 2], s[at.S_Q + 3] = nw * n, nx * n, ny * n, nz * n


@uncounted_kernel
def to_world(s: Array, x: float, y: float, z: float) -> tuple[float, float, float]:
    """A device vector in east, north, up by the own attitude."""
    w, a, b, c = s[at.S_Q], s[at.S_Q + 1], s[at.S_Q + 2], s[at.S_Q + 3]
    e = (1.0 - 2.0 * (b * b + c * c)) * x + 2.0 * (a * b - w * c) * y + 2.0 * (a * c + w * b) * z
    n = 2.0 * (a * b + w * c) * x + (1.0 - 2.0 * (a * a + c * c)) * y + 2.0 * (b * c - w * a) * z
    u = 2.0 * (a * c - w * b) * x + 2.0 * (b * c + w * a) * y + (1.0 - 2.0 * (a * a + b * b)) * z
    return e, n, u


@uncounted_kernel
def up_of(s: Array, p: Array, t: float) -> tuple[float, float, float]:
    """The vertical in device axes, from the recorded attitude where fresh, else from the own."""
    o = at.S_RV if t - s[at.S_T_RV] <= p[at.P_STALE] else at.S_Q
    w, x, y, z = s[o], s[o + 1], s[o + 2], s[o + 3]
    return 2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)


@uncounted_kernel
def level(s: Array, p: Array, t: float, dt: float, x: float, y: float, z: float) -> None:
    """Turn the own attitude so that the specific force points up: first at once, then slowly."""
    if s[at.S_Q_LEVEL] == 0.0:
        s[at.S_Q_LEVEL] = 1.0
        gain = 1.0
    else:
        gyro = t - s[at.S_T_GYRO] <= p[at.P_STALE]
        gain = 1.0 - np.exp(-dt / (p[at.P_TAU_TILT] if gyro else p[at.P_TAU_TILT_NO_GYRO]))
    e, n, u = to_world(s, x, y, z)
    across = np.sqrt(e * e + n * n)
    if across > 1e-12:
        angle = gain * np.arctan2(across, u)
        rotate_by(s, angle * n / across, -angle * e / across, 0.0, True)
    elif u < 0.0:
        rotate_by(s, gain * np.pi, 0.0, 0.0, True)


@uncounted_kernel
def point_north(s: Array, p: Array, t: float, dt: float, x: float, y: float, z: float) -> bool:
    """Turn the own attitude about the vertical so the field points north, unless disturbed."""
    norm = np.sqrt(x * x + y * y + z * z)
    if s[at.S_Q_LEVEL] == 0.0 or norm == 0.0:
        return False
    s[at.S_FIELD_TIME] += dt
    s[at.S_FIELD] += (dt + 1e-3) / (min(s[at.S_FIELD_TIME], 20.0) + 1e-3) * (norm - s[at.S_FIELD])
    e, n, _ = to_world(s, x, y, z)
    if e * e + n * n < 25.0:  # less than 5 µT across (the earth's: 15 to 40): no direction in it
        return False
    error = np.arctan2(e, n)  # how far clockwise of the attitude's north the field points
    if s[at.S_Q_YAW] == 0.0:
        s[at.S_Q_YAW] = 1.0
        gain = 1.0
    else:
        gyro = t - s[at.S_T_GYRO] <= p[at.P_STALE]
        deviation = (norm - s[at.S_FIELD]) / p[at.P_MAG_TOLERANCE]
        gain = 1.0 - np.exp(-dt / (p[at.P_TAU_MAG] if gyro else p[at.P_TAU_MAG_NO_GYRO]))
        gain /= 1.0 + deviation * deviation
    rotate_by(s, 0.0, 0.0, gain * error, True)
    return True


# --- heading ----------------------------------------------------------------------------------------------
@uncounted_kernel
def heading_of(w: float, x: float, y: float, z: float) -> float:
    """Horizontal direction of the device's y axis, blending into that of its back when it stands upright."""
    e, n, u = 2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x)
    part = min(max((abs(u) - 0.82) / 0.12, 0.0), 1.0)  # pitch of 55 degrees: 0; of 70 degrees: 1
    if part > 0.0:
        side = part if u > 0.0 else -part
        e = (1.0 - part) * e - side * 2.0 * (x * z + w * y)
        n = (1.0 - part) * n - side * 2.0 * (y * z - w * x)
    return float(np.arctan2(n, e))


@uncounted_kernel
def learn_bias(s: Array, p: Array, t: float, dt: float, heading: float) -> None:
    """Bias of the yaw rate: drift of the raw yaw against the absolute heading, if beyond doubt."""
    raw = s[at.S_YAW_RAW] - heading
    if s[at.S_DRIFT_T0] == -np.inf:
        s[at.S_DRIFT], s[at.S_DRIFT_0], s[at.S_DRIFT_T0] = raw, raw, t
        return
    s[at.S_DRIFT] += dt / (3.0 + dt) * wrap_angle(raw - s[at.S_DRIFT])  # mean of 3 s, which lags by 3 s
    span = t - s[at.S_DRIFT_T0]
    if span < p[at.P_BIAS_TIME]:
        return
    drift = s[at.S_DRIFT] - s[at.S_DRIFT_0]
    bias = s[at.S_BIAS]
    if abs(drift) > p[at.P_BIAS_DRIFT]:
        bias = min(max(drift / (span - 3.0), -0.3), 0.3)
    elif span > 4.0 * p[at.P_BIAS_TIME]:
        bias = 0.0
    lag = (bias - s[at.S_BIAS]) * min(
        0.5 * span, p[at.P_TAU_HEADING]
    )  # by which the pull trails a biased gyro
    s[at.S_OFFSET] = wrap_angle(s[at.S_OFFSET] - lag)
    s[at.S_BIAS] = bias
    if span > 8.0 * p[at.P_BIAS_TIME]:
        s[at.S_DRIFT_0], s[at.S_DRIFT_T0] = s[at.S_DRIFT], t


@uncounted_kernel
def absolute_heading(s: Array, p: Array, t: float, dt: float, heading: float) -> None:
    """Take an absolute heading: as it is, or to pull the gyro's (running mean first, then exponential)."""
    s[at.S_HAS_HEADING] = 1.0
    innovation = wrap_angle(heading - s[at.S_YAW] - s[at.S_OFFSET])
    if s[at.S_OFFSET_TIME] == 0.0:
        s[at.S_OFFSET_TIME] = 0.01
        s[at.S_OFFSET] = wrap_angle(s[at.S_OFFSET] + innovation)
    else:
        s[at.S_OFFSET_TIME] += dt
        gain = dt / min(s[at.S_OFFSET_TIME], p[at.P_TAU_HEADING])
        s[at.S_OFFSET] = wrap_angle(s[at.S_OFFSET] + gain * innovation)
    gyro = t - s[at.S_T_GYRO] <= p[at.P_STALE]
    if gyro and s[at.S_SHAKEN] == 0.0:
        learn_bias(s, p, t, dt, heading)
    pulled = gyro and p[at.P_PULLED] > 0.0
    s[at.S_HEADING] = wrap_angle(s[at.S_YAW] + s[at.S_OFFSET]) if pulled else heading


@uncounted_kernel
def on_rotation_rate(s: Array, p: Array, t: float, dt: float, x: float, y: float, z: float) -> None:
    """Integrate the own attitude and the yaw about the vertical; notice gaps and shaking."""
    if not 0.0 < dt <= p[at.P_GAP]:  # turns may have been missed: trust the next absolute heading
        s[at.S_OFFSET_TIME], s[at.S_DRIFT_T0] = 0.0, -np.inf
        return
    s[at.S_SPIN] += (x * x + y * y + z * z - s[at.S_SPIN]) * dt / (1.0 + dt)
    limit = p[at.P_SHAKE] * p[at.P_SHAKE]
    if s[at.S_SPIN] > limit:
        s[at.S_SHAKEN] = 1.0
    elif s[at.S_SPIN] < 0.25 * limit:
        s[at.S_SHAKEN] = 0.0
    if s[at.S_SHAKEN] > 0.0:  # the yaw of a shaken gyro is lost
        s[at.S_OFFSET_TIME], s[at.S_DRIFT_T0] = 0.0, -np.inf
    ux, uy, uz = up_of(s, p, t)
    rate, bias = ux * x + uy * y + uz * z, s[at.S_BIAS]
    s[at.S_YAW_RAW] += rate * dt
    s[at.S_YAW] += (rate - bias) * dt
    if s[at.S_Q_LEVEL] > 0.0:
        rotate_by(s, (x - bias * ux) * dt, (y - bias * uy) * dt, (z - bias * uz) * dt, False)
    if p[at.P_PULLED] > 0.0 or s[at.S_HAS_HEADING] == 0.0:
        s[at.S_HEADING] = wrap_angle(s[at.S_YAW] + s[at.S_OFFSET])


@uncounted_kernel
def remember_heading(s: Array, t: float) -> None:
    """Append the heading to the ring, at most every `RING_PERIOD`."""
    n = int(s[at.S_RING_N])
    if n > 0 and t - s[at.S_RING + 2 * ((n - 1) % at.N_RING)] < at.RING_PERIOD:
        return
    o = at.S_RING + 2 * (n % at.N_RING)
    s[o], s[o + 1] = t, s[at.S_HEADING]
    s[at.S_RING_N] = n + 1.0


@uncounted_kernel
def recall_heading(s: Array, t: float) -> float:
    """Heading remembered last before or at a time; the oldest kept where none is that old."""
    n = int(s[at.S_RING_N])
    found = s[at.S_HEADING]
    for back in range(1, min(n, at.N_RING) + 1):
        o = at.S_RING + 2 * ((n - back) % at.N_RING)
        found = s[o + 1]
        if s[o] <= t:
            break
    return float(found)


# --- steps ------------------------------------------------------------------------------------------------
@uncounted_kernel
def low_pass(s: Array, o: int, g: float, v: float) -> float:
    """Second-order Butterworth low-pass, state-variable form; memory s[o:o+2], g = tan(pi f T)."""
    a1 = 1.0 / (1.0 + g * (g + np.sqrt(2.0)))
    v3 = v - s[o + 1]
    v1 = a1 * s[o] + a1 * g * v3
    v2 = s[o + 1] + g * v1
    s[o], s[o + 1] = 2.0 * v1 - s[o], 2.0 * v2 - s[o + 1]
    return float(v2)


@uncounted_kernel
def high_pass(s: Array, o: int, g: float, v: float) -> float:
    """Second-order Butterworth high-pass, the companion of `low_pass`."""
    k = np.sqrt(2.0)
    a1 = 1.0 / (1.0 + g * (g + k))
    v3 = v - s[o + 1]
    v1 = a1 * s[o] + a1 * g * v3
    v2 = s[o + 1] + g * v1
    s[o], s[o + 1] = 2.0 * v1 - s[o], 2.0 * v2 - s[o + 1]
    return float(v - k * v1 - v2)


@uncounted_kernel
def reset_steps(s: Array) -> None:
    """Forget the filters, the step under way and the remembered headings."""
    s[at.S_PERIOD : at.S_RING] = 0.0
    s[at.S_T_STEP] = -np.inf
    s[at.S_VMAX], s[at.S_VMIN] = -np.inf, np.inf


@uncounted_kernel
def filter_acceleration(s: Array, p: Array, t: float, dt: float, x: float, y: float, z: float) -> float:
    """Feed one acceleration into the filters; the band-passed norm."""
    norm = np.sqrt(x * x + y * y + z * z)
    if s[at.S_STARTED] == 0.0:  # start the filters at rest on the first sample
        s[at.S_STARTED] = 1.0
        s[at.S_BAND + 1], s[at.S_VERTICAL + 1] = norm, norm
        return 0.0
    s[at.S_PERIOD_N] = min(s[at.S_PERIOD_N] + 1.0, 64.0)
    s[at.S_PERIOD] += (dt - s[at.S_PERIOD]) / s[at.S_PERIOD_N]
    period = min(max(s[at.S_PERIOD], 1e-4), 0.1)
    g_low, g_high = np.tan(np.pi * p[at.P_LOW] * period), np.tan(np.pi * p[at.P_HIGH] * period)
    band = low_pass(s, at.S_BAND + 2, g_high, high_pass(s, at.S_BAND, g_low, norm))
    ux, uy, uz = up_of(s, p, t)
    vertical = low_pass(s, at.S_VERTICAL, g_high, ux * x + uy * y + uz * z)
    s[at.S_VMAX], s[at.S_VMIN] = max(s[at.S_VMAX], vertical), min(s[at.S_VMIN], vertical)
    s[at.S_SUM] += abs(band)
    s[at.S_COUNT], s[at.S_VALLEY] = s[at.S_COUNT] + 1.0, min(s[at.S_VALLEY], band)
    return band


@uncounted_kernel
def on_acceleration(s: Array, p: Array, t: float, dt: float, x: float, y: float, z: float, e: Array) -> bool:
    """Feed one acceleration; True when it completes a step, which is then written to ``e``."""
    if not dt <= p[at.P_GAP]:
        reset_steps(s)
    if x * x + y * y + z * z > 1.0:  # in free fall there is no direction of gravity
        level(s, p, t, min(dt, 1.0), x, y, z)
    remember_heading(s, t)
    band = filter_acceleration(s, p, t, dt, x, y, z)
    previous = s[at.S_Y]
    s[at.S_Y] = band
    if band > 0.0:
        s[at.S_PEAK] = max(s[at.S_PEAK], band)
        return False
    if previous <= 0.0:
        return False
    peak = s[at.S_PEAK]
    s[at.S_PEAK] = 0.0
    is_weak = peak <= max(p[at.P_THRESHOLD], p[at.P_RELATIVE] * s[at.S_LEVEL])
    if is_weak or s[at.S_SHAKEN] > 0.0 or t - s[at.S_T_STEP] < p[at.P_INTERVAL]:
        return False
    finish_step(s, p, t, peak, e)
    return True


@uncounted_kernel
def finish_step(s: Array, p: Array, t: float, peak: float, event: Array) -> None:
    """Write a completed step and start the next."""
    is_first = not t - s[at.S_T_STEP] <= at.BOUT_GAP
    duration = at.USUAL_STEP if is_first else t - s[at.S_T_STEP]
    heading = recall_heading(s, t - p[at.P_DELAY])
    yaw = s[at.S_YAW] if t - s[at.S_T_GYRO] <= p[at.P_STALE] else heading
    event[at.E_T], event[at.E_DURATION], event[at.E_HEADING] = t, duration, heading
    event[at.E_PEAK], event[at.E_VALLEY] = peak, s[at.S_VALLEY]
    event[at.E_MEAN_ABS] = s[at.S_SUM] / s[at.S_COUNT]
    event[at.E_VERTICAL] = s[at.S_VMAX] - s[at.S_VMIN]
    event[at.E_TURN] = 0.0 if s[at.S_T_STEP] == -np.inf else wrap_angle(yaw - s[at.S_YAW_STEP])
    event[at.E_CONFIDENCE] = min(1.0, 0.5 * peak / p[at.P_THRESHOLD]) * (0.5 if is_first else 1.0)
    event[at.E_LENGTH] = step_length_of(p, event)
    s[at.S_LEVEL] += p[at.P_LEVEL_RATE] * (peak - s[at.S_LEVEL])
    s[at.S_T_STEP], s[at.S_YAW_STEP] = t, yaw
    s[at.S_SUM], s[at.S_COUNT], s[at.S_VALLEY] = 0.0, 0.0, 0.0
    s[at.S_VMAX], s[at.S_VMIN] = -np.inf, np.inf


@uncounted_kernel
def step_length_of(p: Array, event: Array) -> float:
    """Length of a step (m) by the model in the parameters."""
    model, o = int(p[at.P_MODEL]), at.P_COEFFICIENT
    peak, valley, mean_abs = event[at.E_PEAK], event[at.E_VALLEY], event[at.E_MEAN_ABS]
    if model == 0:  # constant
        length = p[o]
    elif model == 1:  # Weinberg
        length = p[o] * np.sqrt(np.sqrt(peak - valley))
    elif model == 2:  # Kim
        length = p[o] * np.cbrt(mean_abs)
    elif model == 3:  # Kakiuchi
        length = p[o] * np.sqrt(np.sqrt(event[at.E_VERTICAL]))
    else:  # regression
        length = p[o] + p[o + 1] / event[at.E_DURATION] + p[o + 2] * np.cbrt(mean_abs)
        length += (p[o + 3] * peak + p[o + 4] * mean_abs) / (peak - valley)
    return float(min(max(length, p[o + 6]), p[o + 7]))


# --- records ----------------------------------------------------------------------------------------------
@uncounted_kernel
def consume(
    s: Array, p: Array, kind: int, t: float, a: float, b: float, c: float, d: float, event: Array
) -> bool:
    """Feed one record of a kind; True when it completes a step, written to ``event`` (N_EVENT,)."""
    # NaN compares false; 1e6 of any unit is a fault, and would stay in the filters for good
    if not (np.isfinite(t) and abs(a) < 1e6 and abs(b) < 1e6 and abs(c) < 1e6 and abs(d) < 1e6):
        return False
    elapsed = t - s[at.S_T_ACC + kind]
    if -p[at.P_GAP] < elapsed < 0.0:  # late: what came after it has been used
        return False
    if elapsed < 0.0:  # the clock was set back
        elapsed = np.inf
    if kind == at.ACCELERATION:
        s[at.S_T_ACC] = t
        return on_acceleration(s, p, t, elapsed, a, b, c, event)
    if kind == at.ROTATION_RATE:
        s[at.S_T_GYRO] = t
        on_rotation_rate(s, p, t, elapsed, a, b, c)
        return False
    dt = min(elapsed, 0.1)  # a gap must not give one reading the weight of all that are missing
    if kind == at.MAGNETIC_FIELD:
        s[at.S_T_MAG] = t
        if point_north(s, p, t, dt, a, b, c) and t - s[at.S_T_RV] > p[at.P_STALE]:
            absolute_heading(s, p, t, dt, heading_of(s[at.S_Q], s[at.S_Q + 1], s[at.S_Q + 2], s[at.S_Q + 3]))
        return False
    norm = np.sqrt(a * a + b * b + c * c + d * d)
    if norm > 0.5:  # a rotation vector is of unit length
        if elapsed > p[at.P_GAP]:  # another source had been pulling, or none
            s[at.S_OFFSET_TIME] = 0.0
        s[at.S_T_RV] = t
        o = at.S_RV
        s[o], s[o + 1], s[o + 2], s[o + 3] = a / norm, b / norm, c / norm, d / norm
        absolute_heading(s, p, t, dt, heading_of(s[o], s[o + 1], s[o + 2], s[o + 3]))
    return False


@uncounted_kernel
def consume_series(s: Array, p: Array, series: tuple[Array, ...], events: Array, trace: Array) -> int:
    """Feed four series merged by time (equal times: acceleration first, orientation last); number of steps.

    ``series`` holds times and values of each kind in turn. ``trace`` (n, 5) takes the own attitude and the
    heading after each of the n accelerations, unless it is empty.
    """
    ta, va, tg, vg, tm, vm, tq, vq = series
    i, j, k, m, n = 0, 0, 0, 0, 0
    while True:
        kind, t = -1, np.inf
        if i < len(ta):
            kind, t = at.ACCELERATION, ta[i]
        if j < len(tg) and (kind < 0 or tg[j] < t):
            kind, t = at.ROTATION_RATE, tg[j]
        if k < len(tm) and (kind < 0 or tm[k] < t):
            kind, t = at.MAGNETIC_FIELD, tm[k]
        if m < len(tq) and (kind < 0 or tq[m] < t):
            kind, t = at.ORIENTATION, tq[m]
        if kind < 0:
            return n
        if kind == at.ACCELERATION:
            if consume(s, p, kind, t, va[i, 0], va[i, 1], va[i, 2], 0.0, events[n]):
                n += 1
            if len(trace) > 0:
                for o in range(4):
                    trace[i, o] = s[at.S_Q + o]
                trace[i, 4] = s[at.S_HEADING]
            i += 1
        elif kind == at.ROTATION_RATE:
            consume(s, p, kind, t, vg[j, 0], vg[j, 1], vg[j, 2], 0.0, events[n])
            j += 1
        elif kind == at.MAGNETIC_FIELD:
            consume(s, p, kind, t, vm[k, 0], vm[k, 1], vm[k, 2], 0.0, events[n])
            k += 1
        else:
            consume(s, p, kind, t, vq[m, 0], vq[m, 1], vq[m, 2], vq[m, 3], events[n])
            m += 1
