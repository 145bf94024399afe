"""Access points of a building and how strongly each of their radios arrives at a place.

Distance, walls and slabs after the multi-wall model of COST 231 [1]_ with both bands apart; on top of it
shadowing that is correlated in space, of which the two bands of one access point share a part. Through an
atrium no slab is crossed. A radio sends several networks (BSSIDs) from one antenna: twins that differ by
hardly a decibel.

References
----------
.. [1] COST Action 231, "Digital mobile radio towards future generation systems", 1999, Sec. 4.7.2.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.errors import UsageError
from wayfuse.core.types import Array, BoolArray, IdArray, IntArray
from wayfuse.simulator.building import Building, Storey
from wayfuse.simulator.chu2009_world import draw_pattern
from wayfuse.simulator.fields import WaveField, exponential_field
from wayfuse.simulator.free_space import first_metre_db
from wayfuse.simulator.geometry import clearance, crossings, inside
from wayfuse.simulator.he2014_world import Room as EmptyRoom
from wayfuse.simulator.he2014_world import strength
from wayfuse.simulator.rays import RayField, RaysModel
from wayfuse.simulator.rim import RimModel, pattern_at, rim_level
from wayfuse.simulator.toml_tables import no_negative, require

__all__ = ["PHONE_HEIGHT", "AccessPoint", "RadioField", "RadioModel", "changed", "radio_field"]

_CHANNELS = ((2412, 2437, 2462), (5180, 5220, 5260, 5300, 5745, 5785, 5825))  # MHz, the usual ones per band
PHONE_HEIGHT = 1.2  # m above the floor
_CARRIERS = (2.437e9, 5.5e9)  # Hz, the middle of the bands
_GONE = -999.0  # dBm at 1 m of a radio that was taken away
_PUBLIC = ("centre_free", "centre_staff", "centre_pos")  # networks of the house on every radio of its own


class AccessPoint(NamedTuple):
    """A given place: metres of the site and the floor's name."""

    x: float
    y: float
    floor: str


@dataclass(frozen=True, slots=True, kw_only=True)
class RadioModel:
    """Access points and propagation; pairs are (2.4 GHz, 5 GHz).

    model : ``log-distance`` with walls, slabs and shadowing; ``rim``, the model of chu2009 with slabs; ``images``, the
    rays of an empty room; ``rays``, ray tracing in the building (the extra ``sionna``).
    """

    model: str = field(default="log-distance", metadata={"one_of": ("log-distance", "rim", "images", "rays")})
    access_points: tuple[AccessPoint, ...] = field(default=(), metadata={"of": AccessPoint})  # else random
    aps_per_floor: int = 24  # where they are not given
    ap_height: float = 3.0  # m above the floor
    house_share: float = 0.45  # of them the house's, over the corridors; the others stand in shops
    single_band_share: float = 0.2  # of the shops' access points: 2.4 GHz only
    power_dbm: tuple[float, float] = (
        -37.0,
        -43.0,
    )  # RSSI at 1 m: 20 dBm, free space loss and a phone's antenna
    power_sigma: float = 3.0  # dB, between access points
    exponent: tuple[float, float] = (2.2, 2.3)  # along corridors; free space has 2
    wall_db: tuple[float, float] = (3.4, 4.6)  # a light wall (COST 231: 3.4 dB at 1.8 GHz)
    wall_sigma: float = 1.2  # dB, between walls
    wall_cap_db: float = 26.0  # many walls: the wave goes around
    slab_db: tuple[float, float] = (18.3, 23.0)  # a slab (COST 231: 18.3 dB at 1.8 GHz)
    shadow_sigma: float = 4.0  # dB, of the shadowing
    shadow_m: float = 5.0  # m, decorrelation distance indoors
    shadow_shared: float = 0.6  # share of the variance common to both bands
    rim: RimModel = field(default_factory=RimModel)
    ceiling: float = 3.5  # m, of the empty room, and of the top storey for rays
    permittivity: float = 5.0  # relative, of the walls, floor and ceiling of the empty room
    rays: RaysModel = field(default_factory=RaysModel)

    def __post_init__(self) -> None:
        no_negative(self, but=("power_dbm",))
        shares = self.house_share, self.single_band_share, self.shadow_shared
        require("house_share, single_band_share, shadow_shared", max(shares) <= 1.0, shares, "from 0 to 1")
        require("shadow_m", self.shadow_m > 0.0, self.shadow_m, "a positive length in m")
        fits = self.model not in {"images", "rays"} or self.ceiling > max(self.ap_height, PHONE_HEIGHT)
        require("ceiling", fits, self.ceiling, "above ap_height")
        require("permittivity", self.permittivity >= 1.0, self.permittivity, "at least 1")


@dataclass(frozen=True, slots=True, eq=False)
class RadioField:
    """All radios of a building.

    ap_xy (a, 2) m, ap_floor (a,). Per radio (r,): ``ap``, ``band`` (0, 1), ``frequency`` MHz, ``power`` dBm
    at 1 m (of the rim: radiated). Per network (b,): ``bssid``, ``radio``, and ``ssid``. pattern (a, 360): of the rim.
    """

    model: RadioModel
    storeys: tuple[Storey, ...]
    ap_xy: Array
    ap_floor: IntArray
    ap: IntArray
    band: IntArray
    frequency: NDArray[np.int32]
    power: Array
    bssid: IdArray
    radio: IntArray
    ssid: tuple[str, ...]
    wall_loss: tuple[Array, ...]  # per storey (w,) dB at 2.4 GHz
    ap_shadow: WaveField
    radio_shadow: WaveField
    pattern: Array = field(default_factory=lambda: np.empty((0, 360)))
    rays: RayField | None = None  # of the model ``rays``, once traced (`wayfuse.simulator.traced_site`)

    @property
    def carrier(self) -> Array:
        """Carrier (r,) Hz that stands for each radio's band."""
        return np.array(_CARRIERS)[self.band]

    @property
    def n_radios(self) -> int:
        """Number of radios."""
        return len(self.ap)

    @property
    def is_there(self) -> BoolArray:
        """Whether each radio (r,) has not been taken away."""
        return np.asarray(self.power > _GONE)

    def rssi(self, radio: IntArray, xy: Array, floor: int) -> Array:
        """RSSI (m,) dBm of radios (m,) at places (m, 2) m of a floor, the mean over fading."""
        ap, band = self.ap[radio], self.band[radio]
        if self.model.model == "rays":
            if self.rays is None:
                raise UsageError("no rays were traced yet", remedy="simulator.traced_site.traced")
            return np.asarray(self.power[radio] + self.rays.level(radio, xy, floor))
        if self.model.model == "images":
            return np.asarray(self.power[radio] + self._rays(ap, band, xy))
        slab = np.array(self.model.slab_db)[band] * self.slabs(ap, xy, floor)
        distance = self.distance(ap, xy, floor)
        if self.model.model == "rim":
            to = xy - self.ap_xy[ap]
            k = pattern_at(self.pattern[ap], np.arctan2(to[:, 1], to[:, 0]))
            n_walls = self.walls_between(ap, xy, floor).sum(axis=1)
            return rim_level(self.power[radio], distance, k, n_walls, self.model.rim) - slab
        exponent, wall = (np.array(pair)[band] for pair in (self.model.exponent, self.model.wall_db))
        walls = self.walls_between(ap, xy, floor) @ self.wall_loss[floor] * wall / self.model.wall_db[0]
        loss = 10.0 * exponent * np.log10(np.maximum(distance, 1.0)) + np.minimum(
            walls, self.model.wall_cap_db
        )
        loss += slab
        member = ap * len(self.storeys) + floor
        shadow = self.ap_shadow.at(member, xy) + self.radio_shadow.at(radio * len(self.storeys) + floor, xy)
        return np.asarray(self.power[radio] - loss + shadow)

    def distance(self, ap: IntArray, xy: Array, floor: int) -> Array:
        """Distance (m,) m in space from access points (m,) to a phone at places (m, 2) m of a floor."""
        rise = self._height(self.ap_floor[ap], self.model.ap_height) - self._height(floor, PHONE_HEIGHT)
        return np.asarray(np.sqrt(np.sum((self.ap_xy[ap] - xy) ** 2, axis=1) + rise**2))

    def walls_between(self, ap: IntArray, xy: Array, floor: int) -> BoolArray:
        """Which walls (m, w) of the floor lie between access points (m,) and places (m, 2) m of it."""
        return crossings(self.ap_xy[ap], xy, self.storeys[floor].walls)

    def slabs(self, ap: IntArray, xy: Array, floor: int) -> Array:
        """Slabs (m,) between access points and the phone, those left out that are crossed in a void."""
        source, source_floor = self.ap_xy[ap], self.ap_floor[ap]
        low, high = np.minimum(source_floor, floor), np.maximum(source_floor, floor)
        start, stop = self._height(source_floor, self.model.ap_height), self._height(floor, PHONE_HEIGHT)
        count = np.zeros(len(xy))
        for k in range(1, len(self.storeys)):
            level = self.storeys[k].elevation
            share = np.clip((level - start) / np.where(stop == start, 1.0, stop - start), 0.0, 1.0)
            place = source + share[:, None] * (xy - source)
            solid = np.ones(len(xy), dtype=bool)
            for void in self.storeys[k].voids:
                solid &= ~inside(void.polygon, place)
            count += solid & (low < k) & (k <= high)
        return count

    def _height(self, floor: IntArray | int, above: float) -> Array:
        return np.array([s.elevation for s in self.storeys])[floor] + above

    def _rays(self, ap: IntArray, band: IntArray, xy: Array) -> Array:
        """Gain (m,) dB of the rays of the empty room, over that of free space at 1 m."""
        places, inverse = np.unique(xy, axis=0, return_inverse=True)
        out = np.empty(len(xy))
        across = self.storeys[0].outline.max(axis=0).tolist()
        for b, carrier in enumerate(_CARRIERS):
            room = EmptyRoom(
                size=(across[0], across[1], self.model.ceiling),
                ap_xy=tuple((float(x), float(y)) for x, y in self.ap_xy),
                ap_height=self.model.ap_height,
                device_height=PHONE_HEIGHT,
                permittivity=self.model.permittivity,
                frequency=carrier,
                power_dbm=first_metre_db(carrier),
            )
            here = band == b
            if here.any():
                out[here] = strength(room, places)[inverse.ravel()[here], ap[here]]
        return out


def radio_field(building: Building, model: RadioModel, rng: np.random.Generator) -> RadioField:
    """Draw the access points of a building and their fields."""
    n_floors = len(building.storeys)
    ap_xy, ap_floor, house = _given(building, model) if model.access_points else _drawn(building, model, rng)
    dual = house | (rng.random(len(ap_xy)) >= model.single_band_share)
    ap = np.concatenate([np.arange(len(ap_xy)), np.flatnonzero(dual)])
    band = np.repeat([0, 1], [len(ap_xy), int(dual.sum())])
    frequency = [_CHANNELS[b][int(rng.integers(len(_CHANNELS[b])))] for b in band]
    gain = rng.normal(0.0, model.power_sigma, len(ap_xy))
    bssid, radio, ssid = _networks(ap, band, house, rng)
    shared = model.shadow_shared
    power = np.array(model.power_dbm)[band] + gain[ap]
    pattern = np.empty((0, 360))
    if model.model == "rim":
        power = (
            (np.array(model.rim.power_dbm)[band]) * (1.0 + model.rim.vsp * rng.normal(size=len(ap_xy)))[ap]
        )
        pattern = np.array([draw_pattern(model.rim.doi, rng) for _ in ap_xy])
    return RadioField(
        model=model,
        storeys=building.storeys,
        ap_xy=ap_xy,
        ap_floor=ap_floor,
        ap=ap,
        band=band,
        frequency=np.array(frequency, dtype=np.int32),
        power=power,
        bssid=bssid,
        radio=radio,
        ssid=ssid,
        wall_loss=tuple(
            np.maximum(rng.normal(model.wall_db[0], model.wall_sigma, len(s.walls)), 0.5)
            for s in building.storeys
        ),
        ap_shadow=exponential_field(
            len(ap_xy) * n_floors, model.shadow_sigma * shared**0.5, model.shadow_m, rng
        ),
        radio_shadow=exponential_field(
            len(ap) * n_floors, model.shadow_sigma * (1.0 - shared) ** 0.5, model.shadow_m, rng
        ),
        pattern=pattern,
    )


def changed(
    radios: RadioField, building: Building, moved: int, removed: int, rng: np.random.Generator
) -> RadioField:
    """The field after some access points were moved on their floor, with new shadows, and others taken away."""
    chosen = rng.permutation(len(radios.ap_xy))[: moved + removed]
    elsewhere, gone = chosen[:moved], chosen[moved:]
    ap_xy = radios.ap_xy.copy()
    for a in elsewhere.tolist():
        storey = building.storeys[int(radios.ap_floor[a])]
        far = np.hypot(*(storey.nodes - ap_xy[a]).T)
        node = storey.nodes[int(rng.choice(np.flatnonzero(far >= np.median(far))))]
        ap_xy[a] = node + rng.uniform(-0.5, 0.5, 2)
    shadows = []
    for old, owner in ((radios.ap_shadow, np.arange(len(ap_xy))), (radios.radio_shadow, radios.ap)):
        fresh = exponential_field(len(old.vector), old.sigma, radios.model.shadow_m, rng)
        new = np.repeat(np.isin(owner, elsewhere), len(radios.storeys))
        shadows.append(
            replace(
                old,
                vector=np.where(new[:, None, None], fresh.vector, old.vector),
                phase=np.where(new[:, None], fresh.phase, old.phase),
            )
        )
    power = np.where(np.isin(radios.ap, gone), _GONE, radios.power)
    return replace(radios, ap_xy=ap_xy, power=power, ap_shadow=shadows[0], radio_shadow=shadows[1])


def _given(building: Building, model: RadioModel) -> tuple[Array, IntArray, BoolArray]:
    """Places (a, 2) m, floors (a,) of the access points given, all of the house."""
    floors = np.array([building.floor_index(ap.floor) for ap in model.access_points])
    return np.array([(ap.x, ap.y) for ap in model.access_points]), floors, np.ones(len(floors), dtype=bool)


def _drawn(
    building: Building, model: RadioModel, rng: np.random.Generator
) -> tuple[Array, IntArray, BoolArray]:
    """Places (a, 2) m, floors (a,) and whether the house's (a,) of access points drawn at random."""
    n_floors, n = len(building.storeys), model.aps_per_floor
    houses = round(model.house_share * n)
    parts = [_places(s, houses if s.rooms else n, n - houses, rng) for s in building.storeys]
    house = np.concatenate([np.arange(n) < (houses if s.rooms else n) for s in building.storeys])
    return np.concatenate(parts), np.repeat(np.arange(n_floors), n), house


def _places(storey: Storey, n_house: int, n_shop: int, rng: np.random.Generator) -> Array:
    """Places (n, 2) m: the house's spread over its corridors, one other per shop, away from its walls."""
    nodes = storey.nodes + rng.uniform(-0.5, 0.5, storey.nodes.shape)
    chosen = [int(rng.integers(len(nodes)))][:n_house]
    while len(chosen) < n_house:  # the place furthest from those chosen
        gap = np.linalg.norm(nodes[:, None] - nodes[chosen], axis=2).min(axis=1)
        chosen.append(int(np.argmax(gap)))
    if not storey.rooms:
        return nodes[chosen]
    rooms = rng.choice(len(storey.rooms), n_shop, replace=n_shop > len(storey.rooms))
    shops = [_in_room(storey.rooms[int(i)].polygon, storey.walls, rng) for i in rooms]
    return np.concatenate([nodes[chosen], np.array(shops).reshape(-1, 2)])


def _in_room(polygon: Array, walls: Array, rng: np.random.Generator) -> Array:
    draws = rng.uniform(polygon.min(axis=0), polygon.max(axis=0), (64, 2))
    good: BoolArray = inside(polygon, draws) & (clearance(draws, walls) > 0.5)
    return np.asarray(draws[np.argmax(good)] if good.any() else polygon.mean(axis=0))


def _networks(
    ap: IntArray, band: IntArray, house: BoolArray, rng: np.random.Generator
) -> tuple[IdArray, IntArray, tuple[str, ...]]:
    """BSSIDs of every radio: three if the house's, one or two if a shop's; siblings differ in one octet."""
    vendor = rng.integers(0, 1 << 20, int(ap.max()) + 1)
    guests = rng.random(len(vendor)) < 0.4
    bssid: list[int] = []
    radio: list[int] = []
    ssid: list[str] = []
    for r, (a, b) in enumerate(zip(ap.tolist(), band.tolist(), strict=True)):
        names = _PUBLIC if house[a] else (f"shop-{a:03d}", f"shop-{a:03d}-guest")[: 1 + int(guests[a])]
        for k, name in enumerate(names):
            octet = 0x02 | (k << 2)  # locally administered: no vendor's own range
            bssid.append((octet << 40) | (0x5A3C << 24) | (int(vendor[a]) << 4) | (b << 3) | k)
            radio.append(r)
            ssid.append(name)
    return np.array(bssid, dtype=np.uint64), np.array(radio), tuple(ssid)
