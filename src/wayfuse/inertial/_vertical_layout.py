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
N_RING = 64  # bins remembered: 12.8 s, twice the time in which a rise is looked for

# --- parameters (meaning and source: `VerticalConfig`)
P_USE_PRESSURE, P_STALE, P_GAP = 0, 1, 2
P_WINDOW, P_RISE_WINDOW, P_RISE, P_JUMP = 3, 4, 5, 6
P_END_TIME, P_END_SPEED, P_STAIR_RATE, P_LIFT_SPEED = 7, 8, 9, 10
P_SIGMA, P_SIGMA_RELATIVE = 11, 12
N_PARAM = 13

# --- memory
V_T_ACC, V_T_GYRO, V_T_P, V_T_STEP = 0, 1, 2, 3  # time of the last valid record of each kind
V_BIN = 4  # number of the bin being filled: its records have t in [V_BIN, V_BIN + 1) * TICK
V_ACC_SUM, V_ACC_N = 5, 6  # of |a| in the bin
V_P_SUM, V_P_N, V_P_LAST = 7, 8, 9  # of the altitude in the bin (m above V_P_ZERO); that of the last bin
V_P_ZERO = 10  # altitude of the first reading (m), NaN before
V_STEPS = 11  # steps so far
V_TICKS = 12  # bins judged so far
V_FROM = 13  # tick before which nothing is looked at: the end of the last movement, a gap, the start
# the movement under way
V_BEHAVIOUR, V_BEGAN, V_Z0, V_STEPS0, V_SIGN, V_REPORTED, V_SPEED, V_BEST = 14, 15, 16, 17, 18, 19, 20, 21
V_RING_RAW = 22  # altitude of each bin
V_RING_Z = V_RING_RAW + N_RING  # its running mean
V_RING_STEPS = V_RING_Z + N_RING  # steps so far, by the end of each bin
N_MEMORY = V_RING_STEPS + N_RING

# --- a report, in the order of `VerticalEvent`
E_T, E_BEGAN, E_BEHAVIOUR, E_RISE, E_SIGMA, E_STEPS, E_OVER, E_ENDED, E_PRESSURE = range(9)
N_EVENT = 9

STAIRS, LIFT, ESCALATOR = 2.0, 3.0, 4.0  # as in `Behaviour`


def initial_memory() -> Array:
    """Memory before the first record, (N_MEMORY,)."""
    v = np.zeros(N_MEMORY)
    v[V_T_ACC : V_T_STEP + 1] = -np.inf
    v[V_BIN] = v[V_P_ZERO] = np.nan
    return v
