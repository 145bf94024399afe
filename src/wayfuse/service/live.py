"""All live tracks: entries of the log in, changes out. What it does depends on the entries alone, in their order."""

from __future__ import annotations

import json
import logging
import threading
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

from sqlalchemy.exc import SQLAlchemyError

from wayfuse.core.errors import FormatError
from wayfuse.service.adapters import ADAPTERS
from wayfuse.service.checkpoint import pack, unpack
from wayfuse.service.live_track import LiveConfig, LiveTrack, Memory
from wayfuse.service.message import BadBodyError, Message, Profile
from wayfuse.service.world import Basis, World
from wayfuse.service.zones import Crossing, ZoneState
from wayfuse.storage.log import Entry
from wayfuse.storage.tracks import Checkpoint, TrackRow
from wayfuse.tracking.estimate import Estimate
from wayfuse.tracking.tracker import TrackState

__all__ = ["Applied", "Live", "Look", "View", "profile_json", "read_entry"]

_log = logging.getLogger(__name__)
Recall = Callable[[str], tuple[TrackRow, bytes, int] | None]


class View(NamedTuple):
    """A track as it is now. number : of the estimate. ahead : s, of the phone's clock before the server's."""

    row: TrackRow
    estimate: Estimate | None
    number: int
    ahead: float
    counts: Mapping[str, int]
    is_ended: bool
    zones: tuple[str, ...] = ()


class Look(NamedTuple):
    """A track and the estimates that are not written yet, from number ``first`` on. is_live : it is in memory."""

    view: View
    first: int
    recent: list[Estimate]
    is_live: bool


class Applied(NamedTuple):
    """What an entry changed: the track, the first estimate that is new or was revised, zones entered and left."""

    seq: int
    view: View
    changed: int
    crossings: tuple[Crossing, ...] = ()


def profile_json(profile: Profile, basis: Basis) -> str:
    """What the log keeps beside a body: no names, those are pseudonyms in their own columns."""
    return _kept_json(profile.platform, profile.standardised, basis)


@lru_cache(64)
def _kept_json(platform: str, standardised: bool, basis: Basis) -> str:
    kept = {"platform": platform, "standardised": standardised, "map": basis.map_version}
    if basis.anchor_version:
        kept["anchors"] = basis.anchor_version
    return json.dumps(kept, separators=(",", ":"))


def read_entry(entry: Entry) -> Message:
    """The message of an entry of the log.

    Raises
    ------
    BadBodyError : this version of the package does not read what another one accepted.
    """
    said = json.loads(entry.profile)
    profile = Profile("-", "-", said["platform"], said["standardised"])
    messages = ADAPTERS[entry.adapter].read(entry.body, profile, entry.arrived)
    if len(messages) != 1:
        raise BadBodyError(f"{len(messages)} messages in an entry of the log")
    return messages[0]


_NOWHERE = ZoneState()


def _checked(kept: Any, track: str) -> tuple[Memory, ZoneState]:
    match kept:
        case (Memory() as memory, ZoneState() as zones):
            return memory, zones
    raise FormatError("a checkpoint that is no memory of a track", where=track)


@dataclass(slots=True)
class _Held:
    row: TrackRow
    track: LiveTrack
    is_dirty: bool = True
    zones: ZoneState = _NOWHERE
    seq: int = 0  # up to where the log is in the checkpoint it came from


class Live:
    """The tracks of all sites. Its methods may be called from any thread.

    Parameters
    ----------
    worlds : by name of the site. recall : gives a track's checkpoint, None where it has none. seed : of all tracks.
    """

    def __init__(
        self, worlds: Mapping[str, World], recall: Recall, config: LiveConfig | None = None, seed: int = 0
    ) -> None:
        self.counts: Counter[str] = Counter()
        self._worlds, self._recall = worlds, recall
        self._config, self._seed = config or LiveConfig(), seed
        self._held: dict[str, _Held] = {}
        self._lock = threading.RLock()

    def apply(self, entry: Entry, message: Message | None = None) -> Applied | None:
        """Take an entry; None where it changed nothing. ``message`` : what the entry says, where it is at hand.

        Raises
        ------
        SQLAlchemyError : the track's checkpoint cannot be read now; nothing has changed, try again.
        """
        if entry.site not in self._worlds or entry.adapter not in ADAPTERS:
            self.counts["entries of no site or adapter"] += (
                1  # of a site that is no longer served, or deleted
            )
            return None
        try:
            message = read_entry(entry) if message is None else message
        except BadBodyError as error:
            self.counts["entries that cannot be read"] += 1
            _log.warning("entry %d of the log: %s", entry.seq, error)
            return None
        with self._lock:
            try:
                held = self._of(entry)
                if entry.seq <= held.seq:
                    return None  # the log is read again, and this is in the checkpoint already
                held.row = held.row._replace(heard=entry.arrived)
                held.is_dirty = True
                changed = held.track.apply(message, entry.arrived)
            except SQLAlchemyError:
                raise  # the checkpoint cannot be read now: the entry is not at fault
            except Exception:  # whatever it is, it must not stop the other tracks
                self.counts["entries that failed"] += 1
                _log.exception("entry %d of the log failed", entry.seq)
                return None
            zones = self._worlds[entry.site].zones
            said = held.track.undrained()[max(0, changed - held.track.first) :]
            held.zones, crossings = zones.step(held.zones, said)
            return Applied(entry.seq, self._view(held), changed, tuple(crossings))

    def _of(self, entry: Entry) -> _Held:
        """The track of an entry: in memory, from its checkpoint, or new."""
        held = self._held.get(entry.track) or self._load(entry.track)
        if held is None:
            said = json.loads(entry.profile)
            basis = Basis(int(said["map"]), int(said.get("anchors", 0)))
            row = TrackRow(
                entry.track, entry.site, entry.device, basis.map_version, entry.arrived, entry.arrived
            )
            row = row._replace(anchor_version=basis.anchor_version)
            tracker = self._worlds[entry.site].tracker(*basis)
            held = _Held(row, LiveTrack(tracker, entry.track, self._seed, self._config))
            self._held[entry.track] = held
        return held

    def _load(self, track: str) -> _Held | None:
        held = self._recalled(track)
        if held is not None:
            self._held[track] = held
        return held

    def _recalled(self, track: str) -> _Held | None:
        """A track as its checkpoint has it."""
        kept = self._recall(track)
        if kept is None or kept[0].site not in self._worlds:
            return None
        row, state, seq = kept
        try:
            memory, zones = _checked(unpack(state), track)
        except FormatError as error:
            self.counts["checkpoints of another version"] += 1
            _log.warning("track %s begins anew: %s", track, error)
            return None
        tracker = self._worlds[row.site].tracker(row.map_version, row.anchor_version)
        return _Held(
            row, LiveTrack.recall(tracker, memory, self._config), is_dirty=False, zones=zones, seq=seq
        )

    def load(self, track: str) -> bool:
        """Bring a track from its checkpoint into memory; whether there is such a track."""
        with self._lock:
            return track in self._held or self._load(track) is not None

    def changed(self) -> list[str]:
        """Tracks that changed since their last checkpoint."""
        with self._lock:
            return [track for track, held in self._held.items() if held.is_dirty]

    def checkpoint(self, tracks: Iterable[str]) -> list[Checkpoint]:
        """Those of the tracks that changed, as they are now; they must be written, or the process must end."""
        with self._lock:
            out = []
            for held in [self._held[track] for track in tracks if track in self._held]:
                if held.is_dirty:
                    first, settled = held.track.drain()
                    out.append(Checkpoint(held.row, first, settled, pack((held.track.memory(), held.zones))))
                    held.is_dirty = False
            return out

    def release(self, before: float) -> int:
        """Let go of tracks last heard before a time (Unix s) whose checkpoints are written; how many."""
        with self._lock:
            idle = [k for k, h in self._held.items() if not h.is_dirty and h.row.heard < before]
            for track in idle:
                del self._held[track]
            return len(idle)

    def forget(self, device: str) -> set[str]:
        """Drop the tracks of a device; which."""
        with self._lock:
            gone = {k for k, h in self._held.items() if h.row.device == device}
            for track in gone:
                del self._held[track]
            return gone

    # --- what comes out

    def view(self, track: str) -> View | None:
        """A track in memory."""
        with self._lock:
            held = self._held.get(track)
            return None if held is None else self._view(held)

    def views(self, site: str = "") -> list[View]:
        """Tracks in memory, of a site or all, the last heard first."""
        with self._lock:
            all_of = [self._view(h) for h in self._held.values() if site in {"", h.row.site}]
        return sorted(all_of, key=lambda v: (-v.row.heard, v.row.track))

    def state(self, track: str) -> TrackState[Any] | None:
        """The tracker's state of a track in memory."""
        with self._lock:
            held = self._held.get(track)
            return None if held is None else held.track.state

    def look(self, track: str) -> Look | None:
        """A track in memory, or as its checkpoint has it; None where it has none."""
        with self._lock:
            held = self._held.get(track)
            is_live = held is not None
            held = held or self._recalled(track)
            if held is None:
                return None
            return Look(self._view(held), held.track.first, held.track.undrained(), is_live)

    def _view(self, held: _Held) -> View:
        track = held.track
        number = track.first + len(track.undrained()) - 1
        counts = dict(track.counts) | track.verdicts
        zones = self._worlds[held.row.site].zones.names(held.zones)
        return View(held.row, track.latest, number, track.ahead, counts, track.is_ended, zones)
