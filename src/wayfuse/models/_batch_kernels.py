"""One tick of many tracks: predict, walls, likelihood, summary, resampling, in short passes over the particles of one.

A cloud is a block (4, N) of float32: x, y, heading bias, step scale. The passes of one track work on a scratch block
that stays in the first cache; the block of the track is read at the start and written at the end.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.jit import kernel, uncounted_kernel
from wayfuse.core.philox import box_muller, philox_words
from wayfuse.core.types import Array, Array32
from wayfuse.filters._batch_kernels import resample_block, weigh_block
from wayfuse.maps._kernels import crosses_many
from wayfuse.models._kernels import add_levels, add_places, add_ranges, pdr_move

__all__ = ["SCRATCH", "tick"]

SCRATCH = 13  # numbers of float32 for each particle of a track

_LOW = np.uint64(0xFFFFFFFF)


@uncounted_kernel
def tick(
    particles: Array32,
    log_weights: Array32,
    counters: NDArray[np.uint64],
    scratch: Array32,
    tracks: NDArray[np.int64],
    steps: Array32,
    ranges: Array32,
    scans: Array32,
    places: Array32,
    out: Array,
    numbers: Array32,
    grid: Array,
    clearance: NDArray[np.uint8],
    start: NDArray[np.int32],
    packed: Array,
    walls: Array,
    anchors: Array32,
    levels: Array32,
    frame: Array32,
) -> int:
    """Advance some tracks of a batch by one step and one observation each, in place.

    Returns -1, or a k that names a track outside the batch, one already named, or a step that is not finite;
    nothing is changed then.

    particles (U, 4, N), log_weights (U, N), counters (U, 3): key, key, draws so far. scratch (13 N,): the caller makes
    it, for a kernel that makes no array takes those of others in half the time. tracks (K,): the rows to advance.
    steps (K, 2): length m, heading rad; a length of 0 or less = no step. ranges (K, A), anchors (A, 2): see
    `add_ranges`; scans (K, C, 2, 16), levels, frame: `add_levels`; places (K, k, 4): `add_places`; an axis of length 0
    = there are none. out (K, 8): mean x, y, covariance xx, xy, yy, effective sample size, log of the mean weight, and 1
    where it resampled. numbers (7,): the four sigmas of `pdr_move`, the penalty of a blocked move (nats), the share of
    N below which the effective sample size makes it resample, the precision of `add_ranges`. grid .. walls:
    `WallArrays`; moves are not tested where ``walls`` is empty.
    """
    wrong = _first_wrong(tracks, steps, len(counters))
    if wrong >= 0:
        return wrong
    n = particles.shape[2]
    random, z = scratch[: 4 * n].view(np.uint32), scratch[4 * n : 8 * n].reshape((4, n))
    block, weights = scratch[8 * n : 12 * n].reshape((4, n)), scratch[12 * n :]
    words, one = random.reshape((4, n)), random[:4].reshape((4, 1))
    # in the place of words, which are no longer needed then
    hit, marks = random[:n].view(np.bool_)[:n], random[: n + 1].view(np.int32)
    for k in range(len(tracks)):
        u = tracks[k]
        old, logs = particles[u], log_weights[u]
        if steps[k, 0] > 0.0:
            draw = counters[u, 2]
            philox_words(counters[u, 0], counters[u, 1], draw & _LOW, draw >> np.uint64(32), words)
            box_muller(words, z)
            counters[u, 2] = draw + np.uint64(1)
            pdr_move(
                z, old[0], old[1], old[2], old[3], steps[k, 0], steps[k, 1],
                numbers[0], numbers[1], numbers[2], numbers[3], block[0], block[1], block[2], block[3],
            )  # fmt: skip
            if len(walls) > 0:
                crosses_many(old[0], old[1], block[0], block[1], grid, clearance, start, packed, walls, hit)
                _undo(old, block, hit, numbers[4], logs)
        else:
            _copy(old, block)
        if ranges.shape[1] > 0:
            add_ranges(block[0], block[1], anchors, ranges[k], numbers[6], logs)
        if scans.shape[1] > 0:
            add_levels(block[0], block[1], levels, frame, scans[k], logs)
        if places.shape[1] > 0:
            add_places(block[0], block[1], places[k], logs)
        weigh_block(block[0], block[1], logs, weights, out[k])
        if out[k, 5] < numbers[5] * n:
            draw = counters[u, 2]
            philox_words(counters[u, 0], counters[u, 1], draw & _LOW, draw >> np.uint64(32), one)
            counters[u, 2] = draw + np.uint64(1)
            resample_block(weights, (np.float64(one[0, 0]) + 0.5) * 2.0**-32, block, marks, old, logs)
            out[k, 7] = 1.0
        else:
            _copy(block, old)
    return -1


@kernel
def _first_wrong(tracks: NDArray[np.int64], steps: Array32, n_tracks: int) -> int:
    for k in range(len(tracks)):
        u = tracks[k]
        if u < 0 or u >= n_tracks or not (np.isfinite(steps[k, 0]) and np.isfinite(steps[k, 1])):
            return k
    if len(tracks) > 1:
        named = np.zeros(n_tracks, np.bool_)
        for k in range(len(tracks)):
            if named[tracks[k]]:
                return k
            named[tracks[k]] = True
    return -1


@uncounted_kernel
def _undo(
    old: Array32, block: Array32, hit: NDArray[np.bool_], penalty: np.float32, log_weights: Array32
) -> None:
    for i in range(len(hit)):
        block[0, i] = old[0, i] if hit[i] else block[0, i]
        block[1, i] = old[1, i] if hit[i] else block[1, i]
        log_weights[i] -= penalty if hit[i] else np.float32(0.0)


@uncounted_kernel
def _copy(source: Array32, target: Array32) -> None:
    for c in range(source.shape[0]):
        row, to = source[c], target[c]
        for i in range(len(row)):
            to[i] = row[i]
