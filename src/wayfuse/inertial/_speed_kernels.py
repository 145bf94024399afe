"""The compiled core that finds stairs and lifts without a barometer: `vertical_speed` says how and why.

A bank of branches, each one history of movements (level, stairs, lift) with a Kalman filter of three numbers:
the offset of the integrated vertical acceleration, its drift, and the speed of the movement under way.
"""

from __future__ import annotations

import numpy as np

from wayfuse.core.jit import kernel, uncounted_kernel
from wayfuse.core.types import Array
from wayfuse.inertial import _vertical_layout as at

__all__ = ["judge_speed", "lean", "restart", "turn"]

EVERY = 3  # bins between two looks: 0.6 s, the time the running mean of the integral needs to change
LOOK = 0.6  # s
DELAY = 0.8  # s, delay of the double running mean
REST = 11.0  # bins after shaking until the integral is trusted: its running mean and a bit
WALKING = 1.5  # s since the last step up to which a person walks
SHORTEST_STAIRS, SHORTEST_LIFT = 1.8, 2.4  # s: four steps; a ride of 1 m at 0.4 m/s
LONGEST_STAIRS, LONGEST_LIFT = 20.0, 45.0  # s: 30 steps without a landing; ten floors at 1 m/s
STANDING = 0.5  # m/s², r.m.s. of |a| - g: who stands stays below (ipin: 0.1 to 0.4), who walks is above
LANDING = 4.0  # s, a landing between two flights
N_SCRATCH = 3 * at.N_BRANCH


@uncounted_kernel
def turn(v: Array, dt: float, x: float, y: float, z: float) -> None:
    """Turn the vertical by a rotation rate; gather the rate at which it tilts."""
    ux, uy, uz = v[at.V_UP], v[at.V_UP + 1], v[at.V_UP + 2]
    cx, cy, cz = y * uz - z * uy, z * ux - x * uz, x * uy - y * ux
    v[at.V_W_SUM] += cx * cx + cy * cy + cz * cz
    v[at.V_W_N] += 1.0
    step = min(dt, 0.1)
    ux, uy, uz = ux - step * cx, uy - step * cy, uz - step * cz
    norm = np.sqrt(ux * ux + uy * uy + uz * uz)
    if norm > 0.0:
        v[at.V_UP], v[at.V_UP + 1], v[at.V_UP + 2] = ux / norm, uy / norm, uz / norm


@uncounted_kernel
def lean(v: Array, p: Array, t: float, dt: float, x: float, y: float, z: float) -> None:
    """Draw the vertical to the specific force and gather the vertical part of that."""
    norm = np.sqrt(x * x + y * y + z * z)
    if norm < 1.0:  # in free fall there is no direction of gravity
        return
    gain = 1.0
    if v[at.V_HAS_UP] > 0.0:
        has_gyro = t - v[at.V_T_GYRO] <= 0.5
        gain = min(dt, 0.1) / (p[at.P_TILT] if has_gyro else 0.5 * p[at.P_TILT])
    v[at.V_HAS_UP] = 1.0
    ux = v[at.V_UP] + gain * (x / norm - v[at.V_UP])
    uy = v[at.V_UP + 1] + gain * (y / norm - v[at.V_UP + 1])
    uz = v[at.V_UP + 2] + gain * (z / norm - v[at.V_UP + 2])
    length = np.sqrt(ux * ux + uy * uy + uz * uz)
    if length < 1e-6:
        return
    ux, uy, uz = ux / length, uy / length, uz / length
    v[at.V_UP], v[at.V_UP + 1], v[at.V_UP + 2] = ux, uy, uz
    v[at.V_A_SUM] += ux * x + uy * y + uz * z
    v[at.V_A2_SUM] += (norm - 9.81) ** 2
    v[at.V_A_N] += 1.0


@uncounted_kernel
def restart(v: Array) -> None:
    """Forget all histories and wait until the integral can be trusted again."""
    v[at.V_N_BRANCH] = 0.0
    v[at.V_REST] = REST


@uncounted_kernel
def integrate(v: Array, p: Array, now: float) -> float:
    """Close the bin: integrate the vertical force, note shaking; the double running mean of the integral."""
    if v[at.V_A_N] > 0.0:
        v[at.V_A_LAST] = v[at.V_A_SUM] / v[at.V_A_N] - 9.8
        v[at.V_POWER] += (v[at.V_A2_SUM] / v[at.V_A_N] - v[at.V_POWER]) / 6.0
        v[at.V_SILENT] = 0.0
    else:
        v[at.V_SILENT] += 1.0
    if v[at.V_W_N] > 0.0:
        v[at.V_SPIN] += (v[at.V_W_SUM] / v[at.V_W_N] - v[at.V_SPIN]) / 3.0
    v[at.V_A_SUM], v[at.V_A2_SUM], v[at.V_A_N], v[at.V_W_SUM], v[at.V_W_N] = 0.0, 0.0, 0.0, 0.0, 0.0
    v[at.V_SUM] += at.TICK * v[at.V_A_LAST]
    last = int(v[at.V_TICKS]) - 1
    v[at.V_RING_SUM + last % at.N_RING] = v[at.V_SUM]
    has_gyro = now - v[at.V_T_GYRO] <= 0.5
    is_blind = not has_gyro and (now - v[at.V_T_STEP] <= WALKING or v[at.V_POWER] > STANDING**2)
    if v[at.V_SPIN] > p[at.P_SHAKE] ** 2 or v[at.V_SILENT] > 4.0 or is_blind:
        restart(v)
    mean = 0.0
    for back in range(8):  # running means of 1.2 s and of 0.6 s, one after the other
        weight = min(back + 1, 8 - back, 3)
        mean += weight / 18.0 * v[at.V_RING_SUM + (last - min(back, last)) % at.N_RING]
    return mean


@uncounted_kernel
def begin_branch(b: Array, p: Array, mode: int, now: float) -> None:
    """Turn a copy of a level branch into one where a movement began a look ago."""
    is_resumed = b[at.B_LAST_MODE] == mode and now - b[at.B_LAST_ENDED] < LANDING
    b[at.B_WEIGHT] += np.log(LOOK * (p[at.P_LANDING] if is_resumed else p[at.P_START]))
    mean, spread = (
        (p[at.P_STAIR_MEAN], p[at.P_STAIR_SPREAD]) if mode < 3 else (p[at.P_LIFT_MEAN], p[at.P_LIFT_SPREAD])
    )
    b[at.B_MODE], b[at.B_BEGAN], b[at.B_RISE] = mode, now - LOOK, 0.0
    b[at.B_S] = mean if mode % 2 == 1 else -mean
    b[at.B_OS], b[at.B_BS], b[at.B_SS] = 0.0, 0.0, spread * spread


@uncounted_kernel
def end_branch(b: Array, p: Array, now: float) -> None:
    """Turn a copy of a moving branch into one where the movement ended a look ago."""
    b[at.B_WEIGHT] += np.log(LOOK * p[at.P_STOP])
    b[at.B_TOTAL] += b[at.B_RISE]
    b[at.B_TOTAL_VAR] += b[at.B_SS] * (now - LOOK - b[at.B_BEGAN]) ** 2
    b[at.B_LAST_BEGAN], b[at.B_LAST_ENDED], b[at.B_LAST_MODE] = b[at.B_BEGAN], now - LOOK, b[at.B_MODE]
    b[at.B_MODE], b[at.B_S], b[at.B_RISE] = 0.0, 0.0, 0.0
    b[at.B_OS], b[at.B_BS], b[at.B_SS] = 0.0, 0.0, 0.0


@uncounted_kernel
def update_branch(b: Array, p: Array, y: float, noise: float, now: float, is_walking: bool) -> None:
    """Kalman step of a branch: weigh it by how well it foretold the integral, then correct it."""
    dt, mode = LOOK, b[at.B_MODE]
    moves = 1.0 if mode > 0.0 else 0.0
    b[at.B_O] += dt * b[at.B_B]
    oo = b[at.B_OO] + dt * (2.0 * b[at.B_OB] + dt * b[at.B_BB]) + noise * noise * dt
    ob, os = b[at.B_OB] + dt * b[at.B_BB], b[at.B_OS] + dt * b[at.B_BS]
    bb, bs, ss = b[at.B_BB] + p[at.P_BIAS] ** 2 * dt, b[at.B_BS], b[at.B_SS]
    age = now - b[at.B_BEGAN]
    if mode > 2.0:  # a lift gathers speed, and its speed wanders a little
        ss += dt * p[at.P_WANDER] ** 2 + (dt * p[at.P_RAMP] ** 2 if age < 2.0 else 0.0)
    e = y - b[at.B_O] - moves * b[at.B_S]
    ho, hb, hs = oo + moves * os, ob + moves * bs, os + moves * ss
    variance = ho + moves * hs + p[at.P_READING] ** 2
    misfit = e * e / variance
    if misfit > p[at.P_OUTLIER]:  # a gesture of the hand is no evidence beyond this
        variance *= misfit / p[at.P_OUTLIER]
        misfit = p[at.P_OUTLIER]
    b[at.B_WEIGHT] -= 0.5 * (misfit + np.log(variance))
    ko, kb, ks = ho / variance, hb / variance, hs / variance
    b[at.B_O], b[at.B_B], b[at.B_S] = b[at.B_O] + ko * e, b[at.B_B] + kb * e, b[at.B_S] + ks * e
    b[at.B_OO], b[at.B_OB], b[at.B_OS] = oo - ko * ho, ob - ko * hb, os - ko * hs
    b[at.B_BB], b[at.B_BS], b[at.B_SS] = bb - kb * hb, bs - kb * hs, ss - ks * hs
    if mode > 0.0:
        b[at.B_RISE] += dt * b[at.B_S]
        # who stands still climbs no stairs, who walks rides no lift; neither goes backwards, or on for ever
        cost = 1.0 if mode < 3.0 and not is_walking else (1.5 if mode > 2.0 and is_walking else 0.0)
        cost += 1.0 if age > (LONGEST_STAIRS if mode < 3.0 else LONGEST_LIFT) else 0.0
        cost += 3.0 if b[at.B_S] * (1.0 if mode % 2.0 == 1.0 else -1.0) < 0.1 else 0.0
        b[at.B_WEIGHT] -= dt * cost


@uncounted_kernel
def is_same(a: Array, b: Array) -> bool:
    """Whether two branches foretell the same from now on."""
    return bool(
        a[at.B_MODE] == b[at.B_MODE]
        and abs(a[at.B_O] - b[at.B_O]) < 0.02
        and abs(a[at.B_B] - b[at.B_B]) < 0.004
        and abs(a[at.B_S] - b[at.B_S]) < 0.02
        and abs(a[at.B_TOTAL] - b[at.B_TOTAL]) < 0.5
        and (a[at.B_MODE] == 0.0 or abs(a[at.B_BEGAN] - b[at.B_BEGAN]) < 1.3)
    )


@kernel
def keep_best(v: Array, branches: Array, n: int) -> None:
    """Put the best of n branches, no two alike, into the memory; weights are normalised."""
    order = np.argsort(-branches[:n, at.B_WEIGHT], kind="mergesort")
    best = branches[order[0], at.B_WEIGHT]
    kept = v[at.V_BRANCHES : at.V_BRANCHES + at.N_BRANCH * at.B_SIZE].reshape((at.N_BRANCH, at.B_SIZE))
    m = 0
    for i in order:
        if branches[i, at.B_WEIGHT] < best - 25.0:
            break
        found = -1
        for j in range(m):
            if is_same(kept[j], branches[i]):
                found = j
                break
        if found >= 0:
            kept[found, at.B_WEIGHT] += np.log1p(np.exp(branches[i, at.B_WEIGHT] - kept[found, at.B_WEIGHT]))
        elif m < at.N_BRANCH:
            kept[m] = branches[i]
            m += 1
    top, total = kept[0, at.B_WEIGHT], 0.0
    for j in range(m):
        top = max(top, kept[j, at.B_WEIGHT])
    for j in range(m):
        total += np.exp(kept[j, at.B_WEIGHT] - top)
    for j in range(m):
        kept[j, at.B_WEIGHT] -= top + np.log(total)
    v[at.V_N_BRANCH] = m


@kernel
def grow(v: Array, p: Array, y: float, now: float) -> None:
    """Let movements begin and end in every branch, weigh them all by the integral, keep the best."""
    held = v[at.V_BRANCHES : at.V_BRANCHES + at.N_BRANCH * at.B_SIZE].reshape((at.N_BRANCH, at.B_SIZE))
    branches = np.empty((N_SCRATCH, at.B_SIZE))
    is_walking = now - v[at.V_T_STEP] < WALKING
    n = int(v[at.V_N_BRANCH])
    branches[:n] = held[:n]
    for i in range(int(v[at.V_N_BRANCH])):
        mode = branches[i, at.B_MODE]
        shortest = SHORTEST_STAIRS if mode < 3.0 else SHORTEST_LIFT
        if mode == 0.0:
            for way in range(1, 3):
                branches[n] = branches[i]
                begin_branch(branches[n], p, way if is_walking else way + 2, now)
                n += 1
        else:
            if now - LOOK - branches[i, at.B_BEGAN] > shortest - 1e-6:
                branches[n] = branches[i]
                end_branch(branches[n], p, now)
                n += 1
            branches[i, at.B_WEIGHT] += np.log(1.0 - LOOK * p[at.P_STOP])
    rms = np.sqrt(v[at.V_POWER])
    noise = p[at.P_NOISE] * max(min(0.04 * rms, 0.024 + 0.005 * rms), 0.005)
    for i in range(n):
        update_branch(branches[i], p, y, noise, now, is_walking)
    keep_best(v, branches, n)


@uncounted_kernel
def judge_speed(v: Array, p: Array, now: float) -> bool:
    """Take in the bin that is complete; True where the branches are up to date."""
    y = integrate(v, p, now)
    if v[at.V_REST] > 0.0:
        v[at.V_REST] -= 1.0
        return False
    if int(v[at.V_TICKS]) % EVERY != 0:
        return False
    if v[at.V_N_BRANCH] == 0.0:  # level, with an offset and a drift yet to be learned
        o = at.V_BRANCHES
        v[o : o + at.B_SIZE] = 0.0
        v[o + at.B_O], v[o + at.B_OO], v[o + at.B_BB] = y, 0.01, 0.01
        v[o + at.B_LAST_ENDED] = -np.inf
        v[at.V_N_BRANCH] = 1.0
        return False
    grow(v, p, y, now)
    return True
