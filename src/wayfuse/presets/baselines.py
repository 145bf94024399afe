"""What ``fused`` has to beat, each tuned for itself on the same development folds.

NNSS: nearest neighbour in signal space. Weighted k-NN: the same map as ``fused``, per scan, the phone's
offset estimated as there. Random walk: the particle
filter without steps; without motion information a map and a sharp filter only hurt, so its own best parameters are far
from those of ``fused``. Dead reckoning: steps from a known start.
"""

from __future__ import annotations

from wayfuse.maps.site import Site
from wayfuse.presets.fused import Config, build, prior_estimate
from wayfuse.presets.given import check_floors
from wayfuse.radio.device_offset import DeviceOffset
from wayfuse.radio.sparse_knn import SparseKnn
from wayfuse.radio.survey import Survey
from wayfuse.tracking.dead_reckoning import DeadReckoning, DeadReckoningState, Start
from wayfuse.tracking.fix_engine import FixEngine, FixState
from wayfuse.tracking.particle_engine import ParticleState
from wayfuse.tracking.tracker import Tracker

__all__ = ["RANDOM_WALK", "dead_reckoning", "nnss", "random_walk", "wknn"]

RANDOM_WALK = Config(
    use_steps=False,
    map_constraint="none",
    exponent=2.0,
    background=0.05,
    coverage_gain=0.0,
    injection=0.0,
    injection_least=0.01,
)


def nnss(site: Site, survey: Survey, *, lag: float = 0.0) -> Tracker[FixState]:
    """Nearest neighbour in signal space: the place of the single nearest fingerprint."""
    check_floors(site, survey)
    engine = FixEngine(radio_map=SparseKnn(survey, k=1, idf=False), prior=prior_estimate(site))
    return Tracker(engine=engine, lag=lag)


def wknn(site: Site, survey: Survey, *, lag: float = 0.0) -> Tracker[FixState]:
    """Weighted k nearest neighbours, k = 40 at temperature 0.02, with the phone's offset estimated."""
    check_floors(site, survey)
    engine = FixEngine(radio_map=SparseKnn(survey), prior=prior_estimate(site), device=DeviceOffset())
    return Tracker(engine=engine, lag=lag)


def random_walk(site: Site, survey: Survey, *, lag: float = 0.0) -> Tracker[ParticleState]:
    """Particle filter without motion sensors."""
    return build(site, survey, RANDOM_WALK, lag=lag)


def dead_reckoning(site: Site, start: Start, *, lag: float = 0.0) -> Tracker[DeadReckoningState]:
    """Steps from a known start."""
    rotation = site.anchor.rotation if site.anchor is not None else 0.0
    return Tracker(engine=DeadReckoning(start=start, rotation=rotation), lag=lag)
