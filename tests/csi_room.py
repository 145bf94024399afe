"""The room of the scenario csi-room: its site, where the anchors hang, a channel model of its survey, walks."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from wayfuse.maps.site import Site
from wayfuse.models.channel_survey import anchor_distances
from wayfuse.papers.li2015_channel import room_places
from wayfuse.radio.ap_places import ApPlaces, write_ap_places
from wayfuse.radio.channel_model import ChannelModel, fit_channel_model
from wayfuse.simulator.experiment import SimulatedWalk, make_world, plan_walks, simulate_plan
from wayfuse.simulator.scenario_file import find_scenario, load_scenario_file

__all__ = ["Room", "make_room"]


@dataclass(frozen=True)
class Room:
    """What was made. survey : its first walk."""

    site: Site
    places: ApPlaces
    model: ChannelModel
    survey: SimulatedWalk
    walks: tuple[SimulatedWalk, ...]

    def save(self, folder: Path) -> Path:
        """The site's folder as a server takes it, with its anchors."""
        self.site.save(folder)
        write_ap_places(folder / "access_points.csv", self.places, self.site.floor_names)
        self.model.save(folder / "channel.npz")
        return folder


@cache
def make_room() -> Room:
    """The room of seed 0, four of its survey walks and two others."""
    path = find_scenario("csi-room")
    site, world = make_world(load_scenario_file(path), 0, path.parent)
    plans = plan_walks(world)
    survey = [simulate_plan(world, p) for p in plans if p.role == "survey"][:4]
    walks = [simulate_plan(world, p) for p in plans if p.role == "walk"][:2]
    frames = [frame for made in survey for frame in made.recording.csi]
    places = room_places(world, sorted({frame.anchor for frame in frames}))
    distances = np.concatenate([anchor_distances(site, made.recording, places) for made in survey])
    return Room(site, places, fit_channel_model(frames, distances, site.name), survey[0], tuple(walks))
