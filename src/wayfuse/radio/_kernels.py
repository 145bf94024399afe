"""Compiled loops of the sparse k-NN map."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.jit import fast_kernel, kernel
from wayfuse.core.types import Array32

__all__ = ["accumulate_overlap", "nearest_by_overlap", "nearest_mean_distances"]

_BLOCK = 512  # rows whose distances are worked out together: they stay in the first cache


@fast_kernel
def accumulate_overlap(
    columns: NDArray[np.int64],
    values: Array32,
    weights: Array32,
    start: NDArray[np.int64],
    rows: NDArray[np.int32],
    row_values: Array32,
    out: Array32,
) -> None:
    """Add w_a min(v_a, v_ra) over the query's access points a to ``out[r]`` of every row r that heard a.

    ``start``, ``rows``, ``row_values`` are the inverted index: for access point a the rows that heard it.
    """
    for q in range(columns.shape[0]):
        a = columns[q]
        v = values[q]
        w = weights[q]
        # without a sign there is no look whether an index counts from the end
        for k in range(np.uint64(start[a]), np.uint64(start[a + 1])):
            u = row_values[k]
            out[np.uint32(rows[k])] += w * (u if u < v else v)


@kernel
def nearest_by_overlap(
    overlap: Array32, row_sum: Array32, query_sum: np.float32, k: int, index: NDArray[np.int32], best: Array32
) -> int:
    """Write the k smallest Sorensen distances, ascending, and their rows; ties keep the lower row. Returns how many.

    A distance is 1 - 2 overlap / (row_sum + query_sum + 1e-6), rounded as by NumPy.
    """
    distance = np.empty(_BLOCK, np.float32)
    n = 0
    for start in range(0, overlap.shape[0], _BLOCK):
        size = min(_BLOCK, overlap.shape[0] - start)
        shared, sums = overlap[start : start + size], row_sum[start : start + size]
        for i in range(size):
            total = sums[i] + query_sum + np.float32(1e-6)
            distance[i] = np.float32(1.0) - np.float32(2.0) * shared[i] / total
        for i in range(size):
            d = distance[i]
            if n == k and d >= best[n - 1]:
                continue
            j = n if n < k else k - 1
            while j > 0 and best[j - 1] > d:
                best[j] = best[j - 1]
                index[j] = index[j - 1]
                j -= 1
            best[j] = d
            index[j] = start + i
            if n < k:
                n += 1
    return n


@fast_kernel
def nearest_mean_distances(
    columns: NDArray[np.int64],
    values: Array32,
    weights: Array32,
    start: NDArray[np.int64],
    rows: NDArray[np.int32],
    row_values: Array32,
    row_sum: Array32,
    best: Array32,
    out: Array32,
) -> None:
    """Mean Sorensen distance of the k nearest rows, for S versions of a query at once.

    ``values`` (A, S) of the query's access points in each version; ``best`` (S, k) is scratch; ``out`` (S,).
    """
    versions, k = values.shape[1], best.shape[1]
    most = 0
    for q in range(columns.shape[0]):
        most += start[columns[q] + 1] - start[columns[q]]
    # only rows that have something in common are kept, in the order in which they are met; place 0 is nobody's
    most = min(most, row_sum.shape[0]) + 1
    place = np.zeros(row_sum.shape[0], np.int32)
    met = np.empty(most, np.int32)
    overlap = np.empty((most, versions), np.float32)
    total = np.full(versions, np.float32(1e-6))
    n = 0
    for q in range(columns.shape[0]):
        a = columns[q]
        w = weights[q]
        for s in range(versions):
            total[s] += w * values[q, s]
        for i in range(start[a], start[a + 1]):
            u = row_values[i]
            r = np.uint32(rows[i])
            m = place[r]
            if m == 0:
                n += 1
                place[r] = n
                met[n] = r
                for s in range(versions):
                    v = values[q, s]
                    overlap[n, s] = w * (u if u < v else v)
            else:
                for s in range(versions):
                    v = values[q, s]
                    overlap[m, s] += w * (u if u < v else v)
    best[:] = np.float32(1.0)  # the distance of rows with nothing in common
    farthest = np.ones(versions, np.float32)
    distance = np.empty(versions, np.float32)
    for m in range(1, n + 1):
        nearer = 0
        for s in range(versions):
            distance[s] = np.float32(1.0) - np.float32(2.0) * overlap[m, s] / (row_sum[met[m]] + total[s])
            nearer += distance[s] < farthest[s]
        if nearer == 0:
            continue
        for s in range(versions):
            d = distance[s]
            if d < farthest[s]:
                j = k - 1
                while j > 0 and best[s, j - 1] > d:
                    best[s, j] = best[s, j - 1]
                    j -= 1
                best[s, j] = d
                farthest[s] = best[s, k - 1]
    for s in range(versions):
        mean = np.float32(0.0)
        for j in range(k):
            mean += best[s, j]
        out[s] = mean / np.float32(k)
