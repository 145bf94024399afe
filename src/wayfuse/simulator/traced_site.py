"""The access points of a site with rays traced in its building, before and after some of them were moved."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from wayfuse.core.types import BoolArray
from wayfuse.simulator.channel_state import ChannelModel
from wayfuse.simulator.radio_field import PHONE_HEIGHT, RadioField
from wayfuse.simulator.ray_tracer import Antennas, Work, trace_rays
from wayfuse.simulator.rays import ChannelRays, RayField
from wayfuse.simulator.simulate import SimulatedSite

__all__ = ["traced"]


def traced(
    before: SimulatedSite, later: SimulatedSite, csi: ChannelModel, seed: int, work: Work
) -> tuple[SimulatedSite, SimulatedSite]:
    """Both sites with rays; those of access points that did not move are traced once.

    Raises
    ------
    ConfigError : Sionna RT or a library that it needs is missing.
    """
    every = np.ones(before.radios.n_radios, dtype=bool)
    rays = _rays(before, every, csi, seed, work)
    has_moved = np.any(later.radios.ap_xy != before.radios.ap_xy, axis=1)[later.radios.ap]
    after = rays
    if has_moved.any():
        after = _with(rays, _rays(later, has_moved, csi, seed, work), has_moved)
    return _site(before, rays), _site(later, after)


def _rays(site: SimulatedSite, wanted: BoolArray, csi: ChannelModel, seed: int, work: Work) -> RayField:
    """Rays of the radios wanted (r,), a row each."""
    radios, model = site.radios, site.radios.model
    elevation = np.array([storey.elevation for storey in site.building.storeys])
    place = np.column_stack([radios.ap_xy, elevation[radios.ap_floor] + model.ap_height])[radios.ap]
    has_channel = (radios.band == csi.band) & (csi.period_s > 0.0)
    antennas = Antennas(place[wanted], radios.carrier[wanted], has_channel[wanted])
    return trace_rays(site.building, model.rays, antennas, (PHONE_HEIGHT, model.ceiling), seed, work)


def _with(rays: RayField, new: RayField, rows: BoolArray) -> RayField:
    """Rays with the rows (r,) of some radios replaced."""
    gain = [old.copy() for old in rays.gain]
    for old, changed in zip(gain, new.gain, strict=True):
        old[rows] = changed
    channels: list[ChannelRays] = []
    for here, there in zip(rays.channels, new.channels or rays.channels, strict=True):
        arrays = {name: getattr(here, name).copy() for name in ("delay", "amplitude", "azimuth")}
        for name, array in arrays.items():
            if there is not here:  # none of those that moved has a channel
                array[rows] = getattr(there, name)
        channels.append(replace(here, **arrays))
    return replace(rays, gain=tuple(gain), channels=tuple(channels))


def _site(site: SimulatedSite, rays: RayField) -> SimulatedSite:
    radios: RadioField = replace(site.radios, rays=rays)
    return replace(site, radios=radios)
