"""Pedestrian dead reckoning as a motion model: each step moves every particle by its own length and heading."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from wayfuse.core.errors import ConfigError
from wayfuse.core.philox import Noise
from wayfuse.filters.cloud import Cloud
from wayfuse.models._kernels import pdr_move

__all__ = ["PdrMotion", "StepInput"]


class StepInput(NamedTuple):
    """One step: length (m) and heading (rad, building frame)."""

    length: float
    heading: float


@dataclass(frozen=True, slots=True, kw_only=True)
class PdrMotion:
    """Step motion with a heading bias and a step scale per particle.

    Parameters
    ----------
    length_sigma : relative noise of a step's length. heading_sigma : rad, noise of a step's heading.
    bias_sigma : rad per step, random walk of the heading bias. scale_sigma : per step, random walk of the step scale.
    """

    length_sigma: float = 0.15
    heading_sigma: float = 0.08
    bias_sigma: float = 0.02
    scale_sigma: float = 0.01

    def __post_init__(self) -> None:
        for name in ("length_sigma", "heading_sigma", "bias_sigma", "scale_sigma"):
            if not getattr(self, name) >= 0.0:
                raise ConfigError(
                    f"{name} must not be negative, got {getattr(self, name)}", where="PdrMotion"
                )

    def propagate(self, noise: Noise, cloud: Cloud, event: StepInput) -> Cloud:
        """One step; floors do not change."""
        z = noise.normals(cloud.n)
        x, y, bias, scale = (np.empty_like(cloud.x) for _ in range(4))
        pdr_move(
            z,
            cloud.x,
            cloud.y,
            cloud.heading_bias,
            cloud.step_scale,
            event.length,
            event.heading,
            self.length_sigma,
            self.heading_sigma,
            self.bias_sigma,
            self.scale_sigma,
            x,
            y,
            bias,
            scale,
        )
        return cloud._replace(x=x, y=y, heading_bias=bias, step_scale=scale)
