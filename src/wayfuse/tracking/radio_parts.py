"""What a particle filter knows of Wi-Fi: the radio map, how it is read, and how the phone differs."""

from __future__ import annotations

from dataclasses import dataclass, replace

from wayfuse.models.initial import FirstCloud
from wayfuse.models.observation.fingerprint import FingerprintLikelihood
from wayfuse.radio.device_offset import DeviceOffset, OffsetState, shifted
from wayfuse.radio.novelty import Novelty
from wayfuse.radio.sparse_knn import Neighbours, SparseKnn
from wayfuse.radio.survey import Fingerprint

__all__ = ["Radio"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Radio:
    """The parts that make a scan an observation.

    Parameters
    ----------
    radio_map : finds the fingerprints like a scan. observation : how likely that is at a particle. first : draws
    particles from a scan. device : estimates how the phone's levels differ from the survey's, None = not at all.
    novelty : how much scans away from the survey count, None = as all others.
    quiet_gain : multiplies the log-likelihood of a scan while no motion sensor speaks, for without steps the cloud
    forgets fast and the scan before says little. moving_gain : the same while a movement between floors is under way,
    for the place of somebody on stairs is known to metres only. usual_spacing : s between scans for which the
    observation was tempered; the errors of scans closer to each other are more alike, so each counts less, in
    proportion and by no more than a factor of ``spacing_range`` either way.
    """

    radio_map: SparseKnn
    observation: FingerprintLikelihood
    first: FirstCloud
    device: DeviceOffset | None = None
    novelty: Novelty | None = None
    quiet_gain: float = 1.0
    moving_gain: float = 1.0
    usual_spacing: float = 2.0
    spacing_range: float = 2.0

    def neighbours(
        self, offset: OffsetState | None, fingerprint: Fingerprint
    ) -> tuple[OffsetState | None, Neighbours | None]:
        """What is known of the phone after a scan, and the fingerprints like it; None where none is."""
        if self.device is not None and offset is not None:
            offset = self.device.step(offset, self.radio_map, fingerprint)
            fingerprint = shifted(fingerprint, self.device.shift(offset))
        return offset, self.radio_map.neighbours(fingerprint)

    def observed(
        self, novelty: float, near: Neighbours, *, walks: bool
    ) -> tuple[float, float, FingerprintLikelihood]:
        """Novelty after a scan, what the scan counts (0 to 1), and the observation tempered by it.

        The bonus of particles away from the survey is not tempered: it is for such scans that it is there. Nor is
        anything where steps say nothing instead (``walks`` is false): before the first of them, when only scans tell
        the floor, where the motion sensors fell silent, and on stairs and in lifts, which are hardly ever surveyed.
        """
        if self.novelty is None:
            return novelty, 1.0, self.observation
        novelty = self.novelty.step(novelty, near)
        trust = self.novelty.trust(novelty) if walks else 1.0
        if trust == 1.0:
            return novelty, trust, self.observation
        return novelty, trust, replace(self.observation, exponent=trust * self.observation.exponent)

    def gain(self, spacing: float, *, is_quiet: bool, is_moving: bool) -> float:
        """Factor of a scan's log-likelihood, ``spacing`` seconds after the scan before."""
        fresh = min(max(spacing / self.usual_spacing, 1.0 / self.spacing_range), self.spacing_range)
        return fresh * (self.quiet_gain if is_quiet else 1.0) * (self.moving_gain if is_moving else 1.0)
