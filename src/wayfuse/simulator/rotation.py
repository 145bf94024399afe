"""Quaternions of the simulator, (n, 4) as w, x, y, z, turning device vectors into east-north-up."""

from __future__ import annotations

import numpy as np

from wayfuse.core.types import Array

__all__ = ["about_axis", "multiply", "rates", "to_device"]


def about_axis(axis: int, angle: Array) -> Array:
    """Turns by angles (n,) rad about x (0), y (1) or z (2)."""
    q = np.zeros((len(angle), 4))
    q[:, 0] = np.cos(0.5 * angle)
    q[:, 1 + axis] = np.sin(0.5 * angle)
    return q


def multiply(p: Array, q: Array) -> Array:
    """Hamilton product: first q, then p."""
    pw, px, py, pz = p.T
    qw, qx, qy, qz = q.T
    return np.column_stack(
        [
            pw * qw - px * qx - py * qy - pz * qz,
            pw * qx + px * qw + py * qz - pz * qy,
            pw * qy - px * qz + py * qw + pz * qx,
            pw * qz + px * qy - py * qx + pz * qw,
        ]
    )


def to_device(q: Array, world: Array) -> Array:
    """World vectors (n, 3) in the device frame."""
    w, v = q[:, :1], -q[:, 1:]  # the inverse turn
    t = 2.0 * np.cross(v, world)
    return np.asarray(world + w * t + np.cross(v, t))


def rates(t: Array, q: Array) -> Array:
    """Angular velocity (n, 3) rad/s in the device frame: the mean over the interval that ends at each sample.

    Integrating sensors report such means; the first sample repeats the second.
    """
    before, after = q[:-1], q[1:]
    turn = multiply(before * np.array([1.0, -1.0, -1.0, -1.0]), after)
    turn *= np.where(turn[:, :1] < 0.0, -1.0, 1.0)
    size = np.linalg.norm(turn[:, 1:], axis=1, keepdims=True)
    angle = 2.0 * np.arctan2(size, turn[:, :1])
    factor = np.where(size > 1e-12, angle / np.maximum(size, 1e-12), 2.0)
    omega = turn[:, 1:] * factor / np.diff(t)[:, None]
    return np.concatenate([omega[:1], omega])
