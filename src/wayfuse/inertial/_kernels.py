"""The compiled core of the inertial front end: one record in, state changed, a step or nothing out.

The state is one float64 vector (`N_STATE` numbers, offsets below) and so are the parameters (`N_PARAM`), so that a
checkpoint is one small copy. `consume` handles one record; `consume_series` walks the four motion series of a
recording in the order of `Recording.records` and calls the same function, hence both give the same bits.
"""

from __future__ import annotations

import numpy as np

from wayfuse.core.jit import kernel

# kinds of record, in the order in which equal times are merged
ACCELERATION, ROTATION_RATE, MAGNETIC_FIELD, ORIENTATION = 0, 1, 2, 3

# --- parameters -------------------------------------------------------------------------------------------------
P_LOW, P_HIGH, P_THRESHOLD, P_RELATIVE, P_INTERVAL, P_GAP, P_LEVEL_RATE = 0, 1, 2, 3, 4, 5, 6
P_DELAY, P_SOURCE, P_TAU_HEADING, P_TAU_TILT, P_TAU_TILT_NO_GYRO, P_TAU_MAG = 7, 8, 9, 10, 11, 12
P_TAU_MAG_NO_GYRO, P_MAG_TOLERANCE, P_STALE, P_MAX_PEAK, P_MODEL, P_COEFFICIENT = 13, 14, 15, 16, 17, 18
N_COEFFICIENT = 8
N_PARAM = P_COEFFICIENT + N_COEFFICIENT

# --- state ------------------------------------------------------------------------------------------------------
S_Q = 0  # own attitude, device to world (w, x, y, z)
S_Q_LEVEL = 4  # 1 once gravity has been seen
S_Q_YAW = 5  # 1 once the own attitude has an absolute heading
S_T_ACC, S_T_GYRO, S_T_MAG, S_T_RV = 6, 7, 8, 9  # time of the last valid record of each kind
S_RV = 10  # recorded attitude (w, x, y, z)
S_YAW = 14  # rotation about the vertical since the start, integrated from the gyro, rad
S_OFFSET, S_OFFSET_TIME = (
    15,
    16,
)  # absolute heading minus gyro yaw (rad), and how long it has been watched (s)
S_FIELD, S_FIELD_TIME = 17, 18  # running mean of |B| (µT), and how long (s)
S_PERIOD, S_PERIOD_N = 19, 20  # mean sampling period of the accelerometer (s), samples behind it
S_BAND, S_VERTICAL = 21, 25  # filter memories (4 each)
S_Y, S_LEVEL = 29, 30  # last band-passed |a|; running mean of accepted peaks
S_PEAK, S_VALLEY, S_SUM, S_COUNT, S_VMAX, S_VMIN, S_MAX, S_MIN = 31, 32, 33, 34, 35, 36, 37, 38
S_T_STEP, S_YAW_STEP, S_HEADING, S_HAS_HEADING = 39, 40, 41, 42
S_WARM = 43  # seconds of acceleration since the last reset
S_RING_N = 44
S_RING = 45  # ring of (t, heading)
N_RING = 48
N_STATE = S_RING + 2 * N_RING

# --- a step -----------------------------------------------------------------------------------------------------
(E_T, E_LENGTH, E_HEADING, E_DURATION, E_PEAK, E_VALLEY, E_MEAN_ABS, E_TURN, E_CONFIDENCE, E_VERTICAL) = (
    range(10)
)
N_EVENT = 10

G = 9.80665  # m/s², standard gravity
RING_PERIOD = 0.0125  # s between remembered headings: 48 of them reach back 0.6 s


@kernel
def wrap_angle(a):
    """Angle in (-pi, pi]."""
    return np.pi - (np.pi - a) % (2.0 * np.pi)


@kernel
def heading_of(w, x, y, z):
    """Horizontal direction of the phone: its y axis, blending into -z (its back) when it stands nearly upright."""
    ye, yn, yu = 2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x)
    s = (abs(yu) - 0.82) / 0.12  # from 55 to 70 degrees of pitch
    s = min(max(s, 0.0), 1.0)
    if s > 0.0:
        ze, zn = 2.0 * (x * z + w * y), 2.0 * (y * z - w * x)
        sign = 1.0 if yu > 0.0 else -1.0
        ye, yn = (1.0 - s) * ye - s * sign * ze, (1.0 - s) * yn - s * sign * zn
    return np.arctan2(yn, ye)


@kernel
def rotate_by(s, o, rx, ry, rz, world):
    """Turn the quaternion at s[o:o+4] by a rotation vector: in world axes (left factor) or device axes (right)."""
    angle = np.sqrt(rx * rx + ry * ry + rz * rz)
    k = 0.5 if angle < 1e-9 else np.sin(0.5 * angle) / angle
    c, bx, by, bz = np.cos(0.5 * angle), k * rx, k * ry, k * rz
    w, x, y, z = s[o], s[o + 1], s[o + 2], s[o + 3]
    sign = -1.0 if world else 1.0  # the cross product changes its sign with the order of the factors
    nw = c * w - bx * x - by * y - bz * z
    nx = c * x + w * bx + sign * (y * bz - z * by)
    ny = c * y + w * by + sign * (z * bx - x * bz)
    nz = c * z + w * bz + sign * (x * by - y * bx)
    n = 1.0 / np.sqrt(nw * nw + nx * nx + ny * ny + nz * nz)
    s[o], s[o + 1], s[o + 2], s[o + 3] = nw * n, nx * n, ny * n, nz * n


@kernel
def low_pass(s, o, g, v):
    """Second-order Butterworth low-pass, trapezoidal (state-variable form); memory s[o:o+2]; g = tan(pi f T)."""
    k = np.sqrt(2.0)
    a1 = 1.0 / (1.0 + g * (g + k))
    v3 = v - s[o + 1]
    v1 = a1 * s[o] + a1 * g * v3
    v2 = s[o + 1] + g * v1
    s[o], s[o + 1] = 2.0 * v1 - s[o], 2.0 * v2 - s[o + 1]
    return v2


@kernel
def high_pass(s, o, g, v):
    """Second-order Butterworth high-pass, companion of `low_pass`."""
    k = np.sqrt(2.0)
    a1 = 1.0 / (1.0 + g * (g + k))
    v3 = v - s[o + 1]
    v1 = a1 * s[o] + a1 * g * v3
    v2 = s[o + 1] + g * v1
    s[o], s[o + 1] = 2.0 * v1 - s[o], 2.0 * v2 - s[o + 1]
    return v - k * v1 - v2


@kernel
def step_length_of(model, p, o, peak, valley, mean_abs, vertical, duration):
    """Length of a step (m) by model code 0-4, coefficients p[o:]."""
    if model == 0:
        return p[o]
    if model == 1:  # Weinberg
        return p[o] * np.sqrt(np.sqrt(max(peak - valley, 0.0)))
    if model == 2:  # Kim
        return p[o] * np.cbrt(mean_abs)
    if model == 3:  # Kakiuchi
        return p[o] * np.sqrt(np.sqrt(max(vertical, 0.0)))
    rate = 1.0 / max(duration, 0.25)
    length = p[o] + p[o + 1] * rate + p[o + 2] * np.sqrt(np.sqrt(max(peak - valley, 0.0)))
    length += p[o + 3] * np.cbrt(mean_abs) + p[o + 4] * np.sqrt(np.sqrt(max(vertical, 0.0))) + p[o + 5] * peak
    return min(max(length, p[o + 6]), p[o + 7])


@kernel
def up_of(s, t, p):
    """Vertical direction in device axes, from the recorded attitude where fresh, else from the own."""
    o = S_RV if t - s[S_T_RV] <= p[P_STALE] else S_Q
    w, x, y, z = s[o], s[o + 1], s[o + 2], s[o + 3]
    return 2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)


@kernel
def reset_steps(s):
    """Forget the filters and the step under way, after a gap in the acceleration."""
    for i in range(S_PERIOD, S_RING):
        if i not in (S_T_STEP, S_YAW_STEP, S_HEADING, S_HAS_HEADING):
            s[i] = 0.0
    s[S_T_STEP] = -np.inf


@kernel
def absolute_heading(s, p, t, dt, heading):
    """Take an absolute heading: directly, or to pull the gyro's slowly (running mean first, then exponential)."""
    gyro = t - s[S_T_GYRO] <= p[P_STALE]
    if p[P_SOURCE] == 0.0 or not gyro:
        s[S_HEADING] = heading
        s[S_HAS_HEADING] = 1.0
    dt = min(max(dt, 0.0), 0.1)
    innovation = wrap_angle(heading - s[S_YAW] - s[S_OFFSET])
    if s[S_OFFSET_TIME] == 0.0:
        s[S_OFFSET] += innovation
        s[S_OFFSET_TIME] = max(dt, 0.01)
    else:
        s[S_OFFSET_TIME] += dt
        gain = dt / min(s[S_OFFSET_TIME], p[P_TAU_HEADING])
        s[S_OFFSET] = wrap_angle(s[S_OFFSET] + gain * innovation)
    if p[P_SOURCE] == 1.0 and gyro:
        s[S_HEADING] = wrap_angle(s[S_YAW] + s[S_OFFSET])
        s[S_HAS_HEADING] = 1.0


@kernel
def on_rotation_rate(s, p, t, x, y, z):
    """Integrate the own attitude and the yaw about the vertical."""
    dt = t - s[S_T_GYRO]
    s[S_T_GYRO] = t
    if not (0.0 < dt <= p[P_GAP]):
        return
    if s[S_Q_LEVEL] > 0.0:
        rotate_by(s, S_Q, x * dt, y * dt, z * dt, False)
    ux, uy, uz = up_of(s, t, p)
    s[S_YAW] += (ux * x + uy * y + uz * z) * dt
    if p[P_SOURCE] > 0.0 or t - s[S_T_RV] > p[P_STALE]:
        s[S_HEADING] = wrap_angle(s[S_YAW] + s[S_OFFSET])


@kernel
def on_magnetic_field(s, p, t, x, y, z):
    """Turn the own attitude about the vertical towards magnetic north, unless the field looks disturbed."""
    dt = min(max(t - s[S_T_MAG], 0.0), 0.1)
    s[S_T_MAG] = t
    norm = np.sqrt(x * x + y * y + z * z)
    if norm < 1.0 or s[S_Q_LEVEL] == 0.0:
        return
    s[S_FIELD_TIME] += dt
    s[S_FIELD] += min(1.0, (dt + 1e-3) / (min(s[S_FIELD_TIME], 20.0) + 1e-3)) * (norm - s[S_FIELD])
    w, a, b, c = s[S_Q], s[S_Q + 1], s[S_Q + 2], s[S_Q + 3]
    e = (1.0 - 2.0 * (b * b + c * c)) * x + 2.0 * (a * b - w * c) * y + 2.0 * (a * c + w * b) * z
    n = 2.0 * (a * b + w * c) * x + (1.0 - 2.0 * (a * a + c * c)) * y + 2.0 * (b * c - w * a) * z
    if e * e + n * n < 25.0:  # less than 5 µT across: no direction in it
        return
    error = np.arctan2(e, n)  # the measured north lies this far clockwise of the attitude's
    if s[S_Q_YAW] == 0.0:
        gain = 1.0
        s[S_Q_YAW] = 1.0
    else:
        tau = p[P_TAU_MAG] if t - s[S_T_GYRO] <= p[P_STALE] else p[P_TAU_MAG_NO_GYRO]
        deviation = (norm - s[S_FIELD]) / p[P_MAG_TOLERANCE]
        gain = (1.0 - np.exp(-dt / tau)) / (1.0 + deviation * deviation)
    rotate_by(s, S_Q, 0.0, 0.0, gain * error, True)
    if t - s[S_T_RV] > p[P_STALE]:
        heading = heading_of(s[S_Q], s[S_Q + 1], s[S_Q + 2], s[S_Q + 3])
        absolute_heading(s, p, t, dt, heading)


@kernel
def on_orientation(s, p, t, w, x, y, z):
    """Take the recorded attitude and its heading."""
    dt = t - s[S_T_RV]
    norm = np.sqrt(w * w + x * x + y * y + z * z)
    if not norm > 0.5:
        return
    s[S_T_RV] = t
    w, x, y, z = w / norm, x / norm, y / norm, z / norm
    s[S_RV], s[S_RV + 1], s[S_RV + 2], s[S_RV + 3] = w, x, y, z
    absolute_heading(s, p, t, dt, heading_of(w, x, y, z))


@kernel
def level(s, p, dt, t, x, y, z, norm):
    """Turn the own attitude so that the measured specific force points up (slowly while a gyro runs)."""
    if s[S_Q_LEVEL] == 0.0:
        s[S_Q], s[S_Q + 1], s[S_Q + 2], s[S_Q + 3] = 1.0, 0.0, 0.0, 0.0
        s[S_Q_LEVEL] = 1.0
        gain = 1.0
    else:
        tau = p[P_TAU_TILT] if t - s[S_T_GYRO] <= p[P_STALE] else p[P_TAU_TILT_NO_GYRO]
        gain = 1.0 - np.exp(-dt / tau)
    w, a, b, c = s[S_Q], s[S_Q + 1], s[S_Q + 2], s[S_Q + 3]
    e = ((1.0 - 2.0 * (b * b + c * c)) * x + 2.0 * (a * b - w * c) * y + 2.0 * (a * c + w * b) * z) / norm
    n = (2.0 * (a * b + w * c) * x + (1.0 - 2.0 * (a * a + c * c)) * y + 2.0 * (b * c - w * a) * z) / norm
    u = (2.0 * (a * c - w * b) * x + 2.0 * (b * c + w * a) * y + (1.0 - 2.0 * (a * a + b * b)) * z) / norm
    across = np.sqrt(e * e + n * n)
    if across > 1e-12:
        angle = gain * np.arctan2(across, u)
        rotate_by(s, S_Q, angle * n / across, -angle * e / across, 0.0, True)
    elif u < 0.0:
        rotate_by(s, S_Q, gain * np.pi, 0.0, 0.0, True)


@kernel
def remember_heading(s, t):
    """Append the heading to the ring, at most every `RING_PERIOD`."""
    n = int(s[S_RING_N])
    if n > 0 and t - s[S_RING + 2 * ((n - 1) % N_RING)] < RING_PERIOD:
        return
    o = S_RING + 2 * (n % N_RING)
    s[o], s[o + 1] = t, s[S_HEADING]
    s[S_RING_N] = n + 1.0


@kernel
def recall_heading(s, t):
    """Heading remembered last before or at a time, the oldest kept where none is that old."""
    n = int(s[S_RING_N])
    found = s[S_HEADING]
    for back in range(1, min(n, N_RING) + 1):
        o = S_RING + 2 * ((n - back) % N_RING)
        found = s[o + 1]
        if s[o] <= t:
            break
    return found


@kernel
def on_acceleration(s, p, t, x, y, z, event):
    """Feed one acceleration; True when it completes a step, which is then written to ``event``."""
    dt = t - s[S_T_ACC]
    s[S_T_ACC] = t
    norm = np.sqrt(x * x + y * y + z * z)
    if not 0.0 <= dt <= p[P_GAP]:
        reset_steps(s)
        dt = 0.0
    if norm > 1.0:
        level(s, p, dt, t, x, y, z, norm)
    remember_heading(s, t)
    if s[S_PERIOD_N] == 0.0 and dt == 0.0:  # first sample: start the filters at rest
        if s[S_WARM] == 0.0:
            s[S_BAND + 1] = norm
            s[S_VERTICAL + 1] = G
            s[S_WARM] = 1e-9
        return False
    s[S_PERIOD_N] = min(s[S_PERIOD_N] + 1.0, 64.0)
    s[S_PERIOD] += (dt - s[S_PERIOD]) / s[S_PERIOD_N]
    s[S_WARM] += dt
    period = min(max(s[S_PERIOD], 1e-4), 0.1)
    g_low, g_high = np.tan(np.pi * p[P_LOW] * period), np.tan(np.pi * p[P_HIGH] * period)
    band = low_pass(s, S_BAND + 2, g_high, high_pass(s, S_BAND, g_low, norm))
    ux, uy, uz = up_of(s, t, p)
    vertical = low_pass(s, S_VERTICAL, g_high, ux * x + uy * y + uz * z)
    s[S_VMAX], s[S_VMIN] = max(s[S_VMAX], vertical), min(s[S_VMIN], vertical)
    s[S_SUM] += abs(band)
    s[S_COUNT] += 1.0
    s[S_VALLEY] = min(s[S_VALLEY], band)
    previous = s[S_Y]
    s[S_Y] = band
    if band > 0.0:
        s[S_PEAK] = max(s[S_PEAK], band)
        return False
    if previous <= 0.0:
        return False
    peak = s[S_PEAK]
    s[S_PEAK] = 0.0
    if peak <= max(p[P_THRESHOLD], p[P_RELATIVE] * s[S_LEVEL]) or t - s[S_T_STEP] < p[P_INTERVAL]:
        return False
    finish_step(s, p, t, peak, event)
    return True


@kernel
def finish_step(s, p, t, peak, event):
    """Write a completed step and start the next."""
    duration = t - s[S_T_STEP]
    if not duration <= 1.5:  # the first of a bout: the usual step, 1.8 Hz
        duration = 0.55
    mean_abs = s[S_SUM] / s[S_COUNT]
    vertical = s[S_VMAX] - s[S_VMIN]
    event[E_T], event[E_DURATION], event[E_PEAK], event[E_VALLEY] = t, duration, peak, s[S_VALLEY]
    event[E_MEAN_ABS], event[E_VERTICAL] = mean_abs, vertical
    heading = recall_heading(s, t - p[P_DELAY])
    event[E_HEADING] = heading
    gyro = t - s[S_T_GYRO] <= p[P_STALE]
    now = s[S_YAW] if gyro else heading
    event[E_TURN] = 0.0 if s[S_T_STEP] == -np.inf else wrap_angle(now - s[S_YAW_STEP])
    s[S_YAW_STEP] = now
    event[E_LENGTH] = step_length_of(
        int(p[P_MODEL]), p, P_COEFFICIENT, peak, s[S_VALLEY], mean_abs, vertical, duration
    )
    event[E_CONFIDENCE] = min(1.0, 0.5 * peak / p[P_THRESHOLD]) if peak <= p[P_MAX_PEAK] else 0.1
    s[S_LEVEL] += p[P_LEVEL_RATE] * (peak - s[S_LEVEL])
    s[S_T_STEP] = t
    s[S_SUM], s[S_COUNT], s[S_VALLEY] = 0.0, 0.0, 0.0
    s[S_VMAX], s[S_VMIN] = -np.inf, np.inf


@kernel
def consume(s, p, kind, t, a, b, c, d, event):
    """Feed one record of a kind; True when it completes a step, written to ``event`` (N_EVENT,)."""
    if not (np.isfinite(t) and np.isfinite(a) and np.isfinite(b) and np.isfinite(c) and np.isfinite(d)):
        return False
    if kind == ACCELERATION:
        return on_acceleration(s, p, t, a, b, c, event)
    if kind == ROTATION_RATE:
        on_rotation_rate(s, p, t, a, b, c)
    elif kind == MAGNETIC_FIELD:
        on_magnetic_field(s, p, t, a, b, c)
    elif kind == ORIENTATION:
        on_orientation(s, p, t, a, b, c, d)
    return False


@kernel
def consume_series(s, p, ta, va, tg, vg, tm, vm, tq, vq, events):
    """Feed four series merged by time (equal times: acceleration first, orientation last); number of steps."""
    i, j, k, m, n = 0, 0, 0, 0, 0
    while True:
        kind, t = -1, np.inf
        if i < len(ta):
            kind, t = ACCELERATION, ta[i]
        if j < len(tg) and (kind < 0 or tg[j] < t):
            kind, t = ROTATION_RATE, tg[j]
        if k < len(tm) and (kind < 0 or tm[k] < t):
            kind, t = MAGNETIC_FIELD, tm[k]
        if m < len(tq) and (kind < 0 or tq[m] < t):
            kind, t = ORIENTATION, tq[m]
        if kind < 0:
            return n
        if kind == ACCELERATION:
            if consume(s, p, kind, t, va[i, 0], va[i, 1], va[i, 2], 0.0, events[n]):
                n += 1
            i += 1
        elif kind == ROTATION_RATE:
            consume(s, p, kind, t, vg[j, 0], vg[j, 1], vg[j, 2], 0.0, events[n])
            j += 1
        elif kind == MAGNETIC_FIELD:
            consume(s, p, kind, t, vm[k, 0], vm[k, 1], vm[k, 2], 0.0, events[n])
            k += 1
        else:
            consume(s, p, kind, t, vq[m, 0], vq[m, 1], vq[m, 2], vq[m, 3], events[n])
            m += 1
