"""A server's parts, put together: database, sites, pipeline, events. Clock and randomness come from outside."""

from __future__ import annotations

import asyncio
import fcntl
import json
import os
from collections.abc import Callable, Sequence
from contextlib import suppress
from hashlib import sha256
from pathlib import Path
from typing import NamedTuple, TypeVar

import msgspec

from wayfuse.core.errors import ConfigError, RadioMapError, UsageError
from wayfuse.maps.site import Site
from wayfuse.presets.methods import CONFIGS, FIXES
from wayfuse.radio.walk_survey import load
from wayfuse.service.anchors_in_use import AnchorsInUse
from wayfuse.service.events import Event, Hub
from wayfuse.service.identity import Pseudonyms, load_key
from wayfuse.service.limits import RateLimit
from wayfuse.service.live import Applied, Live, View
from wayfuse.service.live_track import LiveConfig
from wayfuse.service.metrics import Metrics
from wayfuse.service.mqtt_topics import broker_of
from wayfuse.service.pipeline import BusyError, Pipeline, PipelineConfig, recover
from wayfuse.service.positions import Json, feature, told
from wayfuse.service.security import Authority
from wayfuse.service.settings import Settings
from wayfuse.service.site_anchors import read_site_anchors
from wayfuse.service.uploaded_sites import UploadedSites
from wayfuse.service.world import NO_MAP, Basis, World, survey_of
from wayfuse.service.zones import Zone, read_geofences
from wayfuse.storage.anchors import AnchorStore
from wayfuse.storage.audit import AuditLog
from wayfuse.storage.database import open_database, take_lease
from wayfuse.storage.devices import DeviceStore
from wayfuse.storage.log import IngestLog, last_seq
from wayfuse.storage.shrinking import give_back
from wayfuse.storage.sites import SiteStore
from wayfuse.storage.tokens import TokenStore
from wayfuse.storage.tracks import TrackStore

__all__ = ["Server", "SiteFiles", "match_radio_maps"]

T = TypeVar("T")
_OPERATOR = "operator"  # who acts where the command line does


class SiteFiles(NamedTuple):
    """A site to serve: its folder, and a radio map to publish, if any."""

    folder: Path
    radio_map: Path | None = None


class Server:
    """Everything a server has, without the network.

    Parameters
    ----------
    clock : Unix s. random : unpredictable bytes.

    Raises
    ------
    WayfuseError : a folder, a database or a radio map that cannot be used.
    """

    def __init__(
        self,
        settings: Settings,
        sites: Sequence[SiteFiles],
        *,
        clock: Callable[[], float],
        random: Callable[[int], bytes],
    ) -> None:
        if settings.method not in {*CONFIGS, *FIXES}:
            raise ConfigError(
                f"no method {settings.method!r}",
                where="method",
                remedy=f"use one of {', '.join([*CONFIGS, *FIXES])}",
            )
        if settings.mqtt:
            broker_of(settings.mqtt)  # a mistake in it ends the start, not the connection
        self.settings, self.clock = settings, clock
        data = Path(settings.data)
        data.mkdir(mode=0o700, parents=True, exist_ok=True)
        self._lock = _lock(data)
        self.pseudonyms = Pseudonyms(load_key(data / "site.key", random))
        self.engine = open_database(settings.database_url)
        self._lease = take_lease(self.engine)
        self.log, self.sites = IngestLog(self.engine), SiteStore(self.engine)
        self.tracks, self.devices = TrackStore(self.engine), DeviceStore(self.engine)
        self.tokens, self.audit = TokenStore(self.engine, random), AuditLog(self.engine)
        self.metrics = Metrics()
        self._published: dict[str, int | None] = {}
        self.worlds: dict[str, World] = {}
        self.authority = Authority(
            self.tokens, RateLimit(settings.rate_per_s, settings.rate_burst, clock), clock
        )
        self.uploads = UploadedSites(data / "sites")
        given = [(Site.load(files.folder), files) for files in sites]
        plans = {site.name: site for site in map(Site.load, self.uploads.folders())}
        plans |= {site.name: site for site, _ in given}  # the operator's own files go first
        self._fences: dict[str, list[Zone]] = (
            read_geofences(Path(settings.geofences), plans) if settings.geofences else {}
        )
        files_of = {site.name: files for site, files in given}
        anchors = {site.name: read_site_anchors(files.folder, site) for site, files in given}
        self.anchors = AnchorsInUse(AnchorStore(self.engine), anchors)
        self.given = frozenset(files_of)  # sites of the command line: they are changed there
        for site in plans.values():
            self.worlds[site.name] = self.world_of(site, files_of.get(site.name))
        config = LiveConfig(rewind=settings.rewind_s, spacing=settings.spacing_s)
        self.live = Live(self.worlds, self.tracks.state, config, settings.seed)
        self.hub = Hub(settings.events)
        self.is_ending = False
        self._loop: asyncio.AbstractEventLoop | None = None
        self.pipeline: Pipeline | None = None
        self._watch()

    def world_of(self, site: Site, files: SiteFiles | None = None) -> World:
        """A site with all that tracking needs; a radio map among its files is kept and published.

        Raises
        ------
        RadioMapError : the radio map, or the one in use, is not of this site.
        UsageError : its files of anchors cannot be used.
        """
        digest = sha256(json.dumps(dict(site.provenance), sort_keys=True).encode()).hexdigest()
        self.sites.register(site.name, digest, self.clock())
        if files is not None and files.radio_map is not None:
            radio_map = files.radio_map
            version = self.add_radio_map(site, radio_map.read_bytes(), _OPERATOR, radio_map.name)
            if self.published(site.name) != version:
                self.publish(site.name, version, _OPERATOR)
        world = World(
            site,
            lambda version: self.sites.archive(site.name, version),
            method=self.settings.method,
            n_particles=self.settings.particles,
            fences=self._fences.get(site.name, ()),
            anchors=lambda version: self.anchors.of(site, version),
        )
        self.make_ready(world)
        return world

    def make_ready(self, world: World) -> None:
        """Build what tracks that begin now go by: now, not when the first phone waits."""
        basis = self._in_use(world)
        if basis is not None:
            world.tracker(*basis)

    def add_radio_map(self, site: Site, archive: bytes, actor: str, note: str) -> int:
        """Check and keep a radio map; its version.

        Raises
        ------
        RadioMapError : it is none, or of another site.
        """
        survey_of(site, archive)
        added = self.sites.add_radio_map(site.name, archive, self.clock(), note)
        self.audit.add(self.clock(), actor, "add radio map", site.name, f"version {added.version}")
        return added.version

    def published(self, site: str) -> int | None:
        """The version of a site's radio map that is in use; remembered until another is published here."""
        if site not in self._published:
            self._published[site] = self.sites.published(site)
        return self._published[site]

    def in_use(self, site: str) -> Basis | None:
        """What tracks that begin now go by: the map published, else `NO_MAP` where there are anchors, else None."""
        return self._in_use(self.worlds[site])

    def _in_use(self, world: World) -> Basis | None:
        name = world.site.name
        version, anchors = self.published(name), self.anchors.version(name)
        if version is None and world.anchors(anchors) is None:
            return None
        return Basis(NO_MAP if version is None else version, anchors)

    def publish(self, site: str, version: int, actor: str) -> None:
        """Put a version of a radio map to use, for tracks that begin from now on.

        Raises
        ------
        RadioMapError : there is no such version.
        """
        self.sites.publish(site, version, self.clock(), actor)
        self._published[site] = version
        if site in self.worlds:
            self.make_ready(self.worlds[site])
        self.audit.add(self.clock(), actor, "publish radio map", site, f"version {version}")

    def roll_back(self, site: str, actor: str) -> int:
        """Put the version before to use; its number.

        Raises
        ------
        RadioMapError : there is none.
        """
        version = self.sites.roll_back(site, self.clock(), actor)
        self._published[site] = version
        self.audit.add(self.clock(), actor, "roll back radio map", site, f"version {version}")
        return version

    def first_admin_token(self, *, anew: bool = False) -> str | None:
        """The text of a new token for everything; None where there is one already, unless ``anew``."""
        if self.tokens.all() and not anew:
            return None
        text, made = self.tokens.create({"admin"}, self.clock(), label="administrator")
        self.audit.add(self.clock(), _OPERATOR, "create token", made.id, "admin")
        return text

    # --- life

    def start(self, loop: asyncio.AbstractEventLoop | None) -> int:
        """Read what the log has, then begin to work; how many entries were read again.

        loop : where events are published; None for nowhere.
        """
        next_seq = last_seq(self.engine) + 1
        recovered: list[Event] = []
        kept = max(self.tracks.round(), self.tracks.newest_seq())  # events before are not made again
        n = recover(
            self.log,
            self.live,
            self.tracks,
            self.clock(),
            self.settings.idle_s,
            lambda applied: recovered.extend(self._events(applied)),
        )
        self.hub = Hub(self.settings.events, kept)
        self.hub.publish([e for e in recovered if e.id > kept], next_seq - 1)
        self._loop = loop
        self.pipeline = Pipeline(
            self.log,
            self.live,
            self.tracks,
            next_seq,
            clock=self.clock,
            publish=self._publish,
            answer=self._in_loop,
            config=PipelineConfig(
                max_waiting=self.settings.max_waiting,
                checkpoint_every=self.settings.checkpoint_s,
                idle=self.settings.idle_s,
            ),
        )
        self.pipeline.start()
        return n

    def stop(self) -> None:
        """Write what waits and let go of everything."""
        if self.pipeline is not None:
            self.pipeline.stop()
        if self._lease is not None:
            self._lease.close()
        self.engine.dispose()
        os.close(self._lock)

    def clean(self) -> None:
        """Delete what is older than it may be, and give back its place on the disk, a bite at a time."""
        now = self.clock()
        self.log.trim(now - 3600.0 * self.settings.retain_log_h, self.tracks.round())
        self.tracks.trim(now - 86_400.0 * self.settings.retain_tracks_d)
        self.audit.trim(now - 86_400.0 * self.settings.retain_audit_d)
        with suppress(BusyError):  # the server is going down: the next one goes on with it
            while self.between(lambda: give_back(self.engine)):
                pass

    def between(self, do: Callable[[], T]) -> T:
        """Do something between two groups of batches, when no track moves and the database is not written.

        Raises
        ------
        BusyError : the server is not working.
        """
        if self.pipeline is None:
            raise BusyError("the server is starting", remedy="send it again in a moment")
        return self.pipeline.call(do).result()

    def forget(self, device: str) -> int:
        """Delete all that is kept of a device, by its pseudonym; how many tracks it had.

        Raises
        ------
        BusyError : the server is not working.
        """
        gone = self.between(lambda: self._forget(device))
        if self._loop is not None:
            self._loop.call_soon_threadsafe(self.hub.forget, gone)
        return len(gone)

    def _forget(self, device: str) -> set[str]:
        gone = self.live.forget(device)
        if self.pipeline is not None:
            self.pipeline.drop(gone)
        gone |= self.tracks.forget(device)
        self.devices.remove(device)
        return gone

    # --- what comes out

    def feature(self, view: View) -> Json | None:
        """GeoJSON of a track's latest position; None before the first."""
        if view.estimate is None or view.row.site not in self.worlds:
            return None
        more = {
            "track": view.row.track,
            "device": view.row.device,
            "n": view.number,
            "heard": view.row.heard,
            "is_ended": view.is_ended,
            "zones": list(view.zones),
        }
        return feature(self.worlds[view.row.site].site, view.estimate, more, view.ahead)

    def _events(self, applied: Applied) -> list[Event]:
        row, ahead = applied.view.row, applied.view.ahead
        who = {"track": row.track, "device": row.device, "site": row.site}
        out = [
            Event(applied.seq, row.site, row.track, msgspec.json.encode(who | told(crossing, ahead)), "zone")
            for crossing in applied.crossings
        ]
        body = {"changed": applied.changed, "feature": self.feature(applied.view)}
        return [*out, Event(applied.seq, row.site, row.track, msgspec.json.encode(body))]

    def _publish(self, changes: list[Applied], last: int) -> None:
        now = self.clock()
        for applied in changes:
            self.metrics.latency.observe(max(0.0, now - applied.view.row.heard))
        if self._loop is not None:
            events = [event for applied in changes for event in self._events(applied)]
            self._in_loop(lambda: self.hub.publish(events, last))

    def _in_loop(self, do: Callable[[], None]) -> None:
        """Do something where futures and events are waited for; here, where nobody waits."""
        if self._loop is None:
            do()
        elif not self._loop.is_closed():
            self._loop.call_soon_threadsafe(do)

    def _watch(self) -> None:
        watch = self.metrics.watch
        watch("wayfuse_tracks", "Tracks in memory.", lambda: len(self.live.views()))
        watch("wayfuse_waiting", "Batches that wait to be written.", lambda: self._of_pipeline("n_waiting"))
        watch(
            "wayfuse_applied_seq",
            "Last entry of the log in the tracks.",
            lambda: self._of_pipeline("applied"),
        )
        watch("wayfuse_streams", "Clients that listen to events.", lambda: self.hub.n_clients)

    def _of_pipeline(self, name: str) -> float:
        return float(getattr(self.pipeline, name)) if self.pipeline is not None else 0.0


def match_radio_maps(folders: Sequence[Path], radio_maps: Sequence[Path]) -> list[SiteFiles]:
    """Each radio map to the site it was made for.

    Raises
    ------
    UsageError : two maps of one site, or a map of none of the sites.
    """
    of_site: dict[str, Path] = {}
    for path in radio_maps:
        site = load(path).site
        if site in of_site:
            raise UsageError(f"a second radio map of site {site}", where=path, remedy="give one per site")
        of_site[site] = path
    files = [SiteFiles(folder, of_site.pop(Site.load(folder).name, None)) for folder in folders]
    for site, path in of_site.items():
        raise RadioMapError(f"radio map of site {site}, which is not served", where=path)
    return files


def _lock(data: Path) -> int:
    """Hold the data folder against a second server."""
    handle = os.open(data / "lock", os.O_RDWR | os.O_CREAT, 0o600)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(handle)
        raise UsageError(
            "another server uses this folder", where=data, remedy="stop it, or give another --data"
        ) from None
    return handle
