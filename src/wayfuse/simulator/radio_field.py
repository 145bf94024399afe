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

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.types import Array, BoolArray, IdArray, IntArray
from wayfuse.simulator.building import Building, Storey
from wayfuse.simulator.fields import WaveField, exponential_field
from wayfuse.simulator.geometry import clearance, crossings, inside

__all__ = ["RadioField", "RadioModel", "radio_field"]

_CHANNELS = ((2412, 2437, 2462), (5180, 5220, 5260, 5300, 5745, 5785, 5825))  # MHz, the usual ones per band
_PHONE_HEIGHT, _AP_HEIGHT = 1.2, 3.0  # m above the floor
_PUBLIC = ("centre_free", "centre_staff", "centre_pos")  # networks of the house on every radio of its own


@dataclass(frozen=True, slots=True, kw_only=True)
class RadioModel:
    """Access points and propagation; pairs are (2.4 GHz, 5 GHz)."""

    aps_per_floor: int = 24
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
    shadow_sigma: float = 4.0  # dB
    shadow_m: float = 5.0  # m, decorrelation distance indoors
    shadow_shared: float = 0.6  # share of the variance common to both bands


@dataclass(frozen=True, slots=True, eq=False)
class RadioField:
    """All radios of a building.

    ap_xy (a, 2) m, ap_floor (a,). Per radio (r,): ``ap``, ``band`` (0, 1), ``frequency`` MHz, ``power`` dBm
    at 1 m. Per network (b,): ``bssid``, ``radio``, and ``ssid``.
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

    @property
    def n_radios(self) -> int:
        """Number of radios."""
        return len(self.ap)

    def rssi(self, radio: IntArray, xy: Array, floor: int) -> Array:
        """RSSI (m,) dBm of radios (m,) at places (m, 2) m of a floor, the mean over fading."""
        ap, band = self.ap[radio], self.band[radio]
        source, source_floor = self.ap_xy[ap], self.ap_floor[ap]
        rise = self._height(source_floor, _AP_HEIGHT) - self._height(floor, _PHONE_HEIGHT)
        distance = np.sqrt(np.sum((source - xy) ** 2, axis=1) + rise**2)
        exponent, wall, slab = (
            np.array(pair)[band] for pair in (self.model.exponent, self.model.wall_db, self.model.slab_db)
        )
        hit = crossings(source, xy, self.storeys[floor].walls)
        walls = hit @ self.wall_loss[floor] * wall / self.model.wall_db[0]
        loss = 10.0 * exponent * np.log10(np.maximum(distance, 1.0)) + np.minimum(
            walls, self.model.wall_cap_db
        )
        loss += slab * self._slabs(source, source_floor, xy, floor)
        member = ap * len(self.storeys) + floor
        shadow = self.ap_shadow.at(member, xy) + self.radio_shadow.at(radio * len(self.storeys) + floor, xy)
        return np.asarray(self.power[radio] - loss + shadow)

    def _height(self, floor: IntArray | int, above: float) -> Array:
        return np.array([s.elevation for s in self.storeys])[floor] + above

    def _slabs(self, source: Array, source_floor: IntArray, xy: Array, floor: int) -> Array:
        """Slabs (m,) between each access point and the phone, those left out that are crossed in a void."""
        low, high = np.minimum(source_floor, floor), np.maximum(source_floor, floor)
        start, stop = self._height(source_floor, _AP_HEIGHT), self._height(floor, _PHONE_HEIGHT)
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


def radio_field(building: Building, model: RadioModel, rng: np.random.Generator) -> RadioField:
    """Draw the access points of a building and their fields."""
    n_floors, n = len(building.storeys), model.aps_per_floor
    houses = round(model.house_share * n)
    ap_xy = np.concatenate([_places(storey, houses, n - houses, rng) for storey in building.storeys])
    ap_floor = np.repeat(np.arange(n_floors), n)
    house = np.tile(np.arange(n) < houses, n_floors)
    dual = house | (rng.random(len(ap_xy)) >= model.single_band_share)
    ap = np.concatenate([np.arange(len(ap_xy)), np.flatnonzero(dual)])
    band = np.repeat([0, 1], [len(ap_xy), int(dual.sum())])
    frequency = [_CHANNELS[b][int(rng.integers(len(_CHANNELS[b])))] for b in band]
    gain = rng.normal(0.0, model.power_sigma, len(ap_xy))
    bssid, radio, ssid = _networks(ap, band, house, rng)
    shared = model.shadow_shared
    return RadioField(
        model=model,
        storeys=building.storeys,
        ap_xy=ap_xy,
        ap_floor=ap_floor,
        ap=ap,
        band=band,
        frequency=np.array(frequency, dtype=np.int32),
        power=np.array(model.power_dbm)[band] + gain[ap],
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
    )


def _places(storey: Storey, n_house: int, n_shop: int, rng: np.random.Generator) -> Array:
    """Places (n, 2) m: the house's spread over its corridors, one other per shop, away from its walls."""
    nodes = storey.nodes + rng.uniform(-0.5, 0.5, storey.nodes.shape)
    chosen = [int(rng.integers(len(nodes)))]
    while len(chosen) < n_house:  # the place furthest from those chosen
        gap = np.linalg.norm(nodes[:, None] - nodes[chosen], axis=2).min(axis=1)
        chosen.append(int(np.argmax(gap)))
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
