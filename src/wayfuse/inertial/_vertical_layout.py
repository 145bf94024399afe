"""Where each number lives in the memory, parameters and reports of the vertical front end.

The compiler keeps these as constants of the kernels, and its disk cache watches only the file of the kernel: touch
the ``_vertical_*`` kernel files after a change here.
"""

from __future__ import annotations

import numpy as np

from wayfuse.core.types import Array

# --- kinds of record, in the order in which equal times are merged; V_T_ACC + kind is their last time
ACCELERATION, ROTATION_RATE, PRESSURE, STEP = 0, 1, 2, 3

TICK = 0.2  # s: records are gathered in bins of this length and judged when a bin is complete
N_RING = 128  # bins remembered: 25.6 s; a movement is known to be over at most 15 s after its end
N_REACH = (
    63  # bins in which the beginning of a rise is looked for: 12.6 s, twice `VerticalConfig.rise_window`
)

# --- parameters (meaning and source: `VerticalConfig`)
P_USE_PRESSURE, P_STALE, P_GAP = 0, 1, 2
P_WINDOW, P_RISE_WINDOW, P_RISE, P_GRADUAL = 3, 4, 5, 6
P_END_TIME, P_END_SPEED, P_STAIR_RATE, P_LIFT_SPEED = 7, 8, 9, 10
P_SIGMA, P_SIGMA_RELATIVE = 11, 12
P_TILT, P_SHAKE, P_NOISE, P_BIAS, P_READING, P_OUTLIER = 13, 14, 15, 16, 17, 18
P_STAIR_MEAN, P_STAIR_SPREAD, P_LIFT_MEAN, P_LIFT_SPREAD, P_RAMP, P_WANDER = 19, 20, 21, 22, 23, 24
P_START, P_STOP, P_LANDING, P_BELIEF, P_LEAST_TIME = 25, 26, 27, 28, 29
P_RISER, P_SPEED_SIGMA, P_SPEED_SIGMA_RELATIVE, P_RISE_AGREED = 30, 31, 32, 33
N_PARAM = 34

# --- memory
V_T_ACC, V_T_GYRO, V_T_P, V_T_STEP = 0, 1, 2, 3  # time of the last valid record of each kind
V_BIN = 4  # number of the bin being filled: its records have t in [V_BIN, V_BIN + 1) * TICK
V_P_SUM, V_P_N, V_P_LAST = 5, 6, 7  # of the altitude in the bin (m above V_P_ZERO); that of the last bin
V_P_ZERO = 8  # altitude of the first reading (m), NaN before
V_STEPS = 9  # steps so far
V_TICKS = 10  # bins judged so far
V_FROM = 11  # tick before which nothing is looked at: the end of the last movement, a gap, the start
# the movement under way: altitude or total rise where it began, steps then, whether one stepped onto it, the
# time it ended as far as known (NaN), rise and its variance as last known, whether it comes from the barometer
V_BEHAVIOUR, V_BEGAN, V_LEVEL, V_STEPS0, V_SIGN, V_REPORTED, V_SPEED = 12, 13, 14, 15, 16, 17, 18
V_ONTO, V_ENDED, V_RISE, V_RISE_VAR, V_PRESSED = 19, 20, 21, 22, 23
# inertial: the vertical in device axes; sums over the bin of the vertical specific force, (|a| - g)², tilt rate²
V_UP, V_HAS_UP, V_A_SUM, V_A2_SUM, V_A_N, V_W_SUM, V_W_N = 24, 27, 28, 29, 30, 31, 32
V_A_LAST, V_SILENT = 33, 34  # mean of the last bin with accelerations; bins since
V_SUM, V_POWER, V_SPIN, V_REST = (
    35,
    36,
    37,
    38,
)  # integral; running means of (|a| - g)², tilt rate²; bins to rest
V_N_BRANCH = 39  # branches held
V_RING_RAW = 40  # altitude of each bin
V_RING_Z = V_RING_RAW + N_RING  # its running mean
V_RING_STEPS = V_RING_Z + N_RING  # steps so far, by the end of each bin
V_RING_SUM = V_RING_STEPS + N_RING  # V_SUM of each bin
V_BRANCHES = V_RING_SUM + N_RING  # N_BRANCH rows

# --- a branch: one history of movements with what follows from it
B_WEIGHT, B_MODE = 0, 1  # logarithm; 0 level, 1 up stairs, 2 down, 3 lift up, 4 down
B_O, B_B, B_S = 2, 3, 4  # offset of the integral (m/s), its drift (m/s²), speed of the movement (m/s)
B_OO, B_OB, B_BB, B_OS, B_BS, B_SS = 5, 6, 7, 8, 9, 10  # covariance
B_BEGAN, B_RISE = 11, 12  # time the movement began (s); its rise (m)
B_TOTAL, B_TOTAL_VAR = 13, 14  # rise of all movements that are over (m), its variance (m²)
B_LAST_BEGAN, B_LAST_ENDED, B_LAST_MODE = 15, 16, 17  # of the last movement that is over
B_SIZE = 18
N_BRANCH = 24
N_MEMORY = V_BRANCHES + N_BRANCH * B_SIZE

# --- a report, in the order of `VerticalEvent`
E_T, E_BEGAN, E_BEHAVIOUR, E_RISE, E_SIGMA, E_STEPS, E_OVER, E_ENDED, E_PRESSURE = range(9)
N_EVENT = 9

STAIRS, LIFT, ESCALATOR = 2.0, 3.0, 4.0  # as in `Behaviour`


def initial_memory() -> Array:
    """Memory before the first record, (N_MEMORY,)."""
    v = np.zeros(N_MEMORY)
    v[V_T_ACC : V_T_STEP + 1] = -np.inf
    v[V_BIN] = v[V_P_ZERO] = v[V_ENDED] = np.nan
    v[V_REST] = 10.0
    return v
