"""Every method on the same recordings: groups of recordings with the survey and the places each may use."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from wayfuse.core.errors import MapError
from wayfuse.evaluation.errors import score
from wayfuse.evaluation.estimates_file import WalkEstimates, from_track
from wayfuse.evaluation.results_folds import Mapper
from wayfuse.evaluation.results_pool import Pooled, pool_known
from wayfuse.maps.site import Site
from wayfuse.models.survey_walk import place_of, survey_walk
from wayfuse.presets.catalogue import METHODS
from wayfuse.presets.methods import FIXES, build_from_start, build_method
from wayfuse.radio.ap_places import ApPlaces, read_ap_places
from wayfuse.radio.survey import Survey
from wayfuse.radio.walk_survey import survey_from_walks
from wayfuse.sensors.recording import Recording
from wayfuse.simulator.experiment import Plan, SimulatedWalk, World, make_world, plan_walks, simulate_plan
from wayfuse.simulator.experiment_files import write_access_points
from wayfuse.simulator.scenario_file import find_scenario, load_scenario_file
from wayfuse.tracking.dead_reckoning import Start
from wayfuse.tracking.tracker import Tracker

__all__ = ["Group", "can_enter", "run_groups", "simulated_group"]


@dataclass(frozen=True, slots=True, eq=False)
class Group:
    """Recordings that one survey belongs to; their waypoints are the truth.

    survey : None = nobody surveyed. places : of the access points, as far as they are known, None = not known (then
    methods that need them estimate them from the survey).
    """

    site: Site
    survey: Survey | None
    recordings: tuple[Recording, ...]
    places: ApPlaces | None = None

    @property
    def inputs(self) -> frozenset[str]:
        """What methods find here, in the words of `presets.catalogue`."""
        found = {"start"} if all(r.waypoints for r in self.recordings) else set()
        if self.survey is not None:
            found |= {"survey", "places"}
        if self.places is not None:
            found |= {"places", "anchors"}
        heard = {"scans": "wifi", "ranges": "ranges"}
        return frozenset(
            found | {kind for kind, of in heard.items() if any(getattr(r, of) for r in self.recordings)}
        )


def simulated_group(name: str, seed: int, mapper: Mapper) -> Group:
    """The walks of a scenario that comes with wayfuse, in the world of a seed, with the exact places as waypoints."""
    source = find_scenario(name)
    site, world = make_world(load_scenario_file(source), seed, source.parent)
    plans = plan_walks(world)
    made = list(mapper(_Simulate(world), plans, f"simulating {name}, seed {seed}"))
    surveyed = (survey_walk(site, m.recording)[0] for m in made if m.plan.role == "survey")
    survey = survey_from_walks([walk for walk in surveyed if walk is not None], site.floor_names)
    with TemporaryDirectory() as folder:  # as a user gets them
        places = Path(folder) / "access_points.csv"
        write_access_points(places, world, world.later)
        known = read_ap_places(places, site.floor_names)
    walks = (replace(m.recording, waypoints=m.places) for m in made if m.plan.role != "survey")
    return Group(site, survey, tuple(walks), known)


class _Simulate:
    """Simulates a walk; travels to the worker processes."""

    def __init__(self, world: World) -> None:
        self.world = world

    def __call__(self, plan: Plan) -> SimulatedWalk:
        return simulate_plan(self.world, plan)


def can_enter(name: str, groups: Sequence[Group]) -> bool:
    """Whether a method finds in all groups what it needs, and something that it goes by."""
    method = METHODS[name]
    radio = set(method.hears) & {"scans", "ranges"}
    return all(
        set(method.needs) <= group.inputs and (not radio or bool(radio & group.inputs)) for group in groups
    )


def run_groups(
    groups: Sequence[Group], methods: Sequence[str], seeds: Sequence[int], mapper: Mapper, label: str
) -> Mapping[str, Pooled]:
    """The points of every method on all recordings, by name, without the moments between two floors."""
    worker = _Worker(tuple(groups), tuple(methods), tuple(seeds))
    items = [(g, i) for g, group in enumerate(groups) for i in range(len(group.recordings))]
    found = dict(zip(items, mapper(worker, items, label), strict=True))
    scores = [
        score(
            [track for (at, _), tracks in found.items() if at == g for track in tracks],
            group.recordings,
            group.site,
            group.survey,
        )
        for g, group in enumerate(groups)
    ]
    return pool_known(scores)


class _Worker:
    """Tracks one recording of a group by every method and seed; travels to the worker processes."""

    def __init__(self, groups: tuple[Group, ...], methods: tuple[str, ...], seeds: tuple[int, ...]) -> None:
        self.groups, self.methods, self.seeds = groups, methods, seeds
        self.of_group = -1
        self.trackers: dict[str, Tracker[Any]] = {}

    def __call__(self, item: tuple[int, int]) -> list[WalkEstimates]:
        g, i = item
        group = self.groups[g]
        recording = group.recordings[i]
        if g != self.of_group:  # recordings of a group come in a row
            self.of_group, self.trackers = g, {}
        out = []
        for name in self.methods:
            tracker = self._tracker(name, group, recording)
            if tracker is None:
                continue
            for seed in self.seeds[:1] if name in FIXES or name == "pdr" else self.seeds:
                done = tracker.run(recording, seed)
                out.append(
                    from_track(recording.name, f"{name}#{seed}", done.estimates, group.site.floor_names)
                )
        return out

    def _tracker(self, name: str, group: Group, recording: Recording) -> Tracker[Any] | None:
        if "start" in METHODS[name].needs:
            try:
                start = Start(*place_of(group.site, recording.waypoints[0]))
            except (IndexError, MapError):
                return None
            return build_from_start(name, group.site, start)
        if name not in self.trackers:
            self.trackers[name] = build_method(name, group.site, group.survey, places=group.places)
        return self.trackers[name]
