"""The room of the scenario csi-room: its site, where the anchors hang, a channel model of its survey, walks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from wayfuse.core.types import Array
from wayfuse.maps.site import Site
from wayfuse.models.channel_survey import anchor_distances
from wayfuse.papers.li2015_channel import room_places
from wayfuse.radio.ap_places import ApPlaces, write_ap_places
from wayfuse.radio.channel_model import ChannelModel, fit_channel_model
from wayfuse.sensors.records import CsiFrame
from wayfuse.simulator.experiment import SimulatedWalk, make_world, plan_walks, simulate_plan
from wayfuse.simulator.scenario_file import find_scenario, load_scenario_file

__all__ = ["Room", "make_room"]


@dataclass(frozen=True)
class Room:
    """What was made. survey : the walks that the model was fitted to."""

    site: Site
    places: ApPlaces
    model: ChannelModel
    survey: tuple[SimulatedWalk, ...]
    walks: tuple[SimulatedWalk, ...]

    def surveyed(self) -> tuple[list[CsiFrame], Array]:
        """All frames of the survey, and how far their anchors were."""
        return _surveyed(self.site, self.survey, self.places)

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
    places = room_places(world, sorted({frame.anchor for made in survey for frame in made.recording.csi}))
    model = fit_channel_model(*_surveyed(site, survey, places), site.name)
    return Room(site, places, model, tuple(survey), tuple(walks))


def _surveyed(site: Site, survey: Sequence[SimulatedWalk], places: ApPlaces) -> tuple[list[CsiFrame], Array]:
    distances = [anchor_distances(site, made.recording, places) for made in survey]
    return [frame for made in survey for frame in made.recording.csi], np.concatenate(distances)
