"""Where each number lives in the front end's state, parameters and events.

The compiler keeps these as constants of the kernels, and its disk cache watches only ``_kernels.py``: touch
that file after a change here.
"""

from __future__ import annotations

import numpy as np

from wayfuse.core.types import Array

# --- kinds of record, in the order in which equal times are merged; S_T_ACC + kind is their last time
ACCELERATION, ROTATION_RATE, MAGNETIC_FIELD, ORIENTATION = 0, 1, 2, 3

# --- parameters (meaning and source: `InertialConfig`) ----------------------------------------------------
P_LOW, P_HIGH, P_THRESHOLD, P_RELATIVE, P_LEVEL_RATE, P_INTERVAL = 0, 1, 2, 3, 4, 5
P_GAP, P_STALE, P_DELAY, P_PULLED, P_TAU_HEADING = 6, 7, 8, 9, 10
P_TAU_TILT, P_TAU_TILT_NO_GYRO, P_TAU_MAG, P_TAU_MAG_NO_GYRO, P_MAG_TOLERANCE = 11, 12, 13, 14, 15
P_BIAS_TIME, P_BIAS_DRIFT, P_SHAKE, P_MODEL, P_COEFFICIENT = 16, 17, 18, 19, 20
N_COEFFICIENT = 8
N_PARAM = P_COEFFICIENT + N_COEFFICIENT

# --- state ------------------------------------------------------------------------------------------------
S_Q = 0  # own attitude, device to world (w, x, y, z)
S_Q_LEVEL = 4  # 1 once gravity has been seen
S_Q_YAW = 5  # 1 once the own attitude knows magnetic north
S_T_ACC, S_T_GYRO, S_T_MAG, S_T_RV = 6, 7, 8, 9  # time of the last valid record of each kind
S_RV = 10  # recorded attitude (w, x, y, z)
S_YAW = 14  # rotation about the vertical since the start, from the gyro, bias taken off, rad
S_OFFSET, S_OFFSET_TIME = 15, 16  # absolute heading minus gyro yaw (rad); how long it has been watched (s)
S_FIELD, S_FIELD_TIME = 17, 18  # running mean of |B| (µT); how long (s)
S_HEADING, S_HAS_HEADING = 19, 20  # heading (rad); 1 once it is absolute
S_BIAS, S_YAW_RAW = 21, 22  # bias of the yaw rate (rad/s); yaw with the bias left in (rad)
S_DRIFT, S_DRIFT_0, S_DRIFT_T0 = 23, 24, 25  # smoothed raw yaw minus heading; at the block's start; when (s)
S_SPIN, S_SHAKEN = 26, 27  # running mean of the squared rotation rate (rad²/s²); 1 while the phone is shaken
S_T_STEP, S_YAW_STEP = 28, 29  # time of the last step and yaw at it
S_PERIOD, S_PERIOD_N = 30, 31  # mean sampling period of the accelerometer (s); samples behind it (at most 64)
S_STARTED = 32  # 1 once the filters hold a first sample
S_BAND, S_VERTICAL = 33, 37  # filter memories: band-pass of |a| (4), low-pass of the vertical (2)
S_Y, S_LEVEL = 39, 40  # last band-passed |a|; running mean of accepted peaks
S_PEAK, S_VALLEY, S_SUM, S_COUNT, S_VMAX, S_VMIN = 41, 42, 43, 44, 45, 46  # of the step under way
S_RING_N = 47  # headings remembered so far
S_RING = 48  # ring of (t, heading)
N_RING = 48
N_STATE = S_RING + 2 * N_RING

# --- a step -----------------------------------------------------------------------------------------------
E_T, E_LENGTH, E_HEADING, E_DURATION, E_PEAK, E_VALLEY, E_MEAN_ABS, E_TURN, E_CONFIDENCE = range(9)
E_VERTICAL = 9  # range of the low-passed vertical acceleration, m/s²
N_EVENT = 10

RING_PERIOD = 0.0125  # s between remembered headings: 48 of them reach back 0.6 s, delays reach 0.2 s
STANDARD_GRAVITY = 9.80665  # m/s²
USUAL_STEP = (
    0.55  # s, a step of 1.8 Hz (median of the ms-indoor survey walks): the first of a bout has no other
)
BOUT_GAP = 1.5  # s without a step after which the next one starts a bout


def initial_state() -> Array:
    """State before the first record, (N_STATE,)."""
    s = np.zeros(N_STATE)
    s[S_Q] = s[S_RV] = 1.0
    s[S_T_ACC : S_T_RV + 1] = -np.inf
    s[S_T_STEP] = s[S_DRIFT_T0] = -np.inf
    s[S_VMAX], s[S_VMIN] = -np.inf, np.inf
    return s
