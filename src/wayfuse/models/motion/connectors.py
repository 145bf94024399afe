r"""Particles on stairs, in lifts, on escalators: sampling cases 1 to 3 of chu2009 Section 3.2.

A reported movement (`inertial.vertical`) takes each particle through three phases. It *boards* (cases 1.2 and 1.3): a
particle that stands d metres from a landing with a way in the direction of the rise boards that connector with odds

.. math:: k \exp\frac{-d^2}{2 (\sigma + \rho n)^2}

(k: 1 for a connector of the reported kind, less for another; n steps since the movement began), an *unlisted* connector
with small odds, for plans are incomplete, or stays, for reports can be false. The sum of the odds is the likelihood of
the movement at its place. On the way it is where the rise says, between its landings (cases 2.2 and 3.1); steps do not
move it; a particle that stayed is ever less likely, the more the rise. When the movement *ends* it is on one of the
floors its connector serves, drawn by how well the floor's elevation agrees with the rise (case 3.2, "with a probability
distribution"), or half-way up the stairs, where the next movement finds it; a connector that serves no such floor is
unlikely. It *leaves* the connector at one of the next steps, for between a landing on a plan and the last stair lie a
few ("the first/last n stairs" of case 2.2).

Departures from the paper: places on stairs are a height, not a number of stairs, so that a barometer, counted stairs
and a lift's acceleration are one model; particles may board an unlisted connector; none is moved for certain.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.errors import ConfigError
from wayfuse.core.philox import Noise
from wayfuse.core.types import Array, BoolArray
from wayfuse.filters.cloud import NO_CONNECTOR, Cloud
from wayfuse.inertial.vertical import Behaviour, VerticalEvent
from wayfuse.maps.connectors import ConnectorKind
from wayfuse.maps.site import Site

__all__ = ["UNLISTED", "ConnectorMotion"]

_AT_A_FLOOR = 0.3  # m; nearer than this to a floor's elevation is on it
_LEAST = -8.0  # nats, the least agreement of a rise with a floor: pressure has its days
UNLISTED = -2  # `Cloud.connector` of a particle on a connector that the plan does not have
_KINDS = {
    Behaviour.STAIRS: (ConnectorKind.STAIRS, ConnectorKind.RAMP),
    Behaviour.LIFT: (ConnectorKind.LIFT,),
    Behaviour.ESCALATOR: (ConnectorKind.ESCALATOR,),
}
_LIKE = {  # taken for each other where somebody stands on an escalator, or walks up one
    Behaviour.STAIRS: (ConnectorKind.ESCALATOR,),
    Behaviour.LIFT: (ConnectorKind.ESCALATOR,),
    Behaviour.ESCALATOR: (ConnectorKind.LIFT, ConnectorKind.STAIRS, ConnectorKind.RAMP),
}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ConnectorMotion:
    """Moves the particles of a cloud through the connectors of a site.

    Parameters
    ----------
    site : floors with elevations, and connectors.
    sigma : m, distance to a landing at which a movement begins. per_step : m per step since then.
    false_alarm : odds of staying on the floor. unlisted : odds of an unlisted connector; ``unlisted_alone`` where the
    site has no connector at all. other_kind, like_kind : odds k of connectors of another kind than reported.
    elevation_sigma : m, error of a site's elevations; ``elevation_relative`` of their differences, as a share.
    half_way : odds of resting on the stairs when a movement ends; turn_back : of ending on the floor it began on.
    hysteresis : m a particle must be nearer another floor before it counts as there. scatter : m, where people stand
    when they arrive. leave_stairs, leave_lift : chance to leave a connector at a step.
    """

    site: Site
    sigma: float = 3.0
    per_step: float = 0.3
    false_alarm: float = 0.02
    unlisted: float = 0.005
    unlisted_alone: float = 0.5
    other_kind: float = 0.02
    like_kind: float = 0.3
    elevation_sigma: float = 0.4
    elevation_relative: float = 0.08
    half_way: float = 0.3
    turn_back: float = 0.1
    hysteresis: float = 0.3
    scatter: float = 0.7
    leave_stairs: float = 0.2
    leave_lift: float = 0.5
    _landing: Array = field(init=False, repr=False)
    _elevation: Array = field(init=False, repr=False)
    _shift: Array = field(init=False, repr=False)
    _leave: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        for name in ("sigma", "false_alarm", "unlisted", "unlisted_alone", "elevation_sigma", "half_way"):
            if not getattr(self, name) > 0.0:
                raise ConfigError(
                    f"{name} must be positive, got {getattr(self, name)}", where="ConnectorMotion"
                )
        site, n = self.site, len(self.site.floors)
        landing = np.full((len(site.connectors), n, 2), np.nan)  # connector, floor: x, y of the landing
        for c, connector in enumerate(site.connectors):
            for at in connector.landings:
                landing[c, at.floor] = at.x, at.y
        is_lift = [connector.kind == ConnectorKind.LIFT for connector in site.connectors]
        shift = np.array([[site.shift(a, b) for b in range(n)] for a in range(n)])
        object.__setattr__(self, "_landing", landing)
        object.__setattr__(self, "_elevation", np.array([floor.elevation for floor in site.floors]))
        object.__setattr__(self, "_shift", shift)
        object.__setattr__(self, "_leave", np.where(is_lift, self.leave_lift, self.leave_stairs))

    def board(self, noise: Noise, cloud: Cloud, event: VerticalEvent, log_weights: Array) -> Cloud:
        """Put the particles on connectors as a movement is first reported; adds its likelihood to the weights."""
        odds = self._odds(cloud, event)
        n = len(self.site.connectors)
        half_way = np.flatnonzero(self.is_half_way(cloud))
        odds[half_way] = 0.0
        odds[half_way, cloud.connector[half_way]] = 1.0
        total = odds.sum(axis=1)
        log_weights += np.log(total)
        u = noise.uniforms(cloud.n)[0] * total
        choice = np.minimum((np.cumsum(odds, axis=1) < u[:, None]).sum(axis=1), n + 1)
        connector = np.where(choice < n, choice, np.where(choice == n, UNLISTED, NO_CONNECTOR)).astype(
            np.int32
        )
        base = self._elevation[cloud.floor].astype(np.float32)
        base[half_way] = cloud.base[half_way]
        return self.ride(cloud._replace(connector=connector, base=base), event)

    def ride(self, cloud: Cloud, event: VerticalEvent) -> Cloud:
        """Where the rise has taken those aboard: between two landings, on the floor they are nearest.

        On an unlisted connector they keep their floor until the movement ends: which floors it serves is not known.
        In a lift they are not on the floors they pass: nobody knows where it stops until it does, or until only the
        last floor is left.
        """
        x, y, floor = cloud.x.copy(), cloud.y.copy(), cloud.floor.copy()
        listed = np.flatnonzero(cloud.connector >= 0)
        for rows, (c, base, now) in _groups(listed, cloud.connector, cloud.base, cloud.floor):
            f = self._nearest(self._within_reach(int(c), base, event.rise), base + event.rise, int(now))
            floor[rows] = f
            x[rows], y[rows] = self._between(int(c), base + event.rise, f).astype(np.float32)
        return cloud._replace(x=x, y=y, floor=floor)

    def doubt(self, cloud: Cloud, before: float, rise: float, sigma: float, log_weights: Array) -> None:
        """Lower the weights of particles that took no part, as the rise (m) grows from ``before``."""
        now, then = (self._agreement(np.zeros(1), r, sigma)[0] for r in (rise, before))
        log_weights[cloud.connector == NO_CONNECTOR] += now - then

    def end(self, noise: Noise, cloud: Cloud, event: VerticalEvent, log_weights: Array) -> Cloud:
        """Those aboard are on a floor of their connector, or half-way; weights get the agreement with the rise."""
        z, u = noise.normals(cloud.n), noise.uniforms(cloud.n)[0]
        cloud = self.ride(cloud, event)  # who rests does so where the last report puts them
        x, y, floor, base = cloud.x.copy(), cloud.y.copy(), cloud.floor.copy(), cloud.base.copy()
        aboard = np.flatnonzero(cloud.connector != NO_CONNECTOR)
        for rows, (c, start) in _groups(aboard, cloud.connector, cloud.base):
            served = self._served(int(c))
            logits = self._agreement(self._elevation[served] - start, event.rise, event.sigma)
            logits[np.abs(self._elevation[served] - start) < _AT_A_FLOOR] += np.log(self.turn_back)
            if c != UNLISTED and self._can_rest(int(c), start + event.rise):
                logits = np.append(logits, np.log(self.half_way))
            log_weights[rows] += logits.max()
            p = np.exp(logits - logits.max())
            choice = np.minimum(np.searchsorted(np.cumsum(p / p.sum()), u[rows]), len(p) - 1)
            arrived = choice < len(served)
            f = served[choice[arrived]]
            to, stay = rows[arrived], rows[~arrived]
            if c == UNLISTED:
                x[to] += self._shift[floor[to], f, 0].astype(np.float32)
                y[to] += self._shift[floor[to], f, 1].astype(np.float32)
            else:
                x[to], y[to] = self._landing[int(c), f].T.astype(np.float32)
            x[to] += np.float32(self.scatter) * z[0, to]
            y[to] += np.float32(self.scatter) * z[1, to]
            floor[to], base[to] = f, self._elevation[f]
            base[stay] = start + event.rise
        connector = np.where(cloud.connector == UNLISTED, NO_CONNECTOR, cloud.connector).astype(np.int32)
        return cloud._replace(x=x, y=y, floor=floor, base=base, connector=connector)

    def leave(self, noise: Noise, cloud: Cloud) -> Cloud:
        """One step while no movement is under way: some of those who rest at a landing walk on."""
        ready = (cloud.connector >= 0) & ~self.is_half_way(cloud)
        chance = (
            np.where(ready, self._leave[np.maximum(cloud.connector, 0)], 0.0) if len(self._leave) else 0.0
        )
        off = noise.uniforms(cloud.n)[0] < chance
        return cloud._replace(connector=np.where(off, NO_CONNECTOR, cloud.connector).astype(np.int32))

    def settle(self, cloud: Cloud) -> Cloud:
        """Nobody stays half-way for long: those who do are on the nearest floor after all."""
        x, y, base = cloud.x.copy(), cloud.y.copy(), cloud.base.copy()
        floor = cloud.floor.copy()
        for rows, (c, at) in _groups(np.flatnonzero(self.is_half_way(cloud)), cloud.connector, cloud.base):
            served = self._served(int(c))
            f = int(served[np.argmin(np.abs(self._elevation[served] - at))])
            x[rows], y[rows] = self._landing[int(c), f].astype(np.float32)
            floor[rows], base[rows] = f, np.float32(self._elevation[f])
        return cloud._replace(x=x, y=y, floor=floor, base=base)

    def is_half_way(self, cloud: Cloud) -> BoolArray:
        """(N,) which particles rest on a connector between floors."""
        off = np.abs(cloud.base - self._elevation[cloud.floor]) > _AT_A_FLOOR
        return np.asarray((cloud.connector >= 0) & off)

    def _odds(self, cloud: Cloud, event: VerticalEvent) -> Array:
        """(N, connectors + 2): of each connector, of an unlisted one, of none."""
        n = len(self.site.connectors)
        odds = np.zeros((cloud.n, n + 2))
        width = self.sigma + self.per_step * event.n_steps
        for c, connector in enumerate(self.site.connectors):
            for at, landing in enumerate(connector.landings):
                up, down = at + 1 < len(connector.landings), at > 0
                if not (up if event.rise > 0.0 else down) or connector.direction * event.rise < 0.0:
                    continue
                on = cloud.floor == landing.floor
                d2 = (cloud.x[on] - landing.x) ** 2 + (cloud.y[on] - landing.y) ** 2
                odds[on, c] = self._kind_odds(event.behaviour, connector.kind) * np.exp(-0.5 * d2 / width**2)
        odds[:, n] = self.unlisted if n else self.unlisted_alone
        odds[:, n + 1] = self.false_alarm
        return odds

    def _kind_odds(self, behaviour: Behaviour, kind: ConnectorKind) -> float:
        if kind in _KINDS[behaviour]:
            return 1.0
        return self.like_kind if kind in _LIKE[behaviour] else self.other_kind

    def _served(self, connector: int) -> NDArray[np.int64]:
        if connector == UNLISTED:
            return np.arange(len(self._elevation))
        return np.flatnonzero(np.isfinite(self._landing[connector, :, 0]))

    def _within_reach(self, connector: int, base: float, rise: float) -> NDArray[np.int64]:
        """Floors somebody can be said to be on while under way."""
        served = self._served(connector)
        if self.site.connectors[connector].kind != ConnectorKind.LIFT:
            return served
        start = served[np.argmin(np.abs(self._elevation[served] - base))]
        return np.array([start, served[-1] if rise > 0.0 else served[0]])

    def _nearest(self, served: NDArray[np.int64], z: float, now: int) -> int:
        off = np.abs(self._elevation[served] - z)
        best = int(served[np.argmin(off)])
        return best if float(off.min()) + self.hysteresis < abs(self._elevation[now] - z) else now

    def _between(self, connector: int, z: float, floor: int) -> Array:
        """Place (2,) m at height z between the landings, in the frame of ``floor``."""
        served = self._served(connector)
        heights = self._elevation[served]
        places = np.array([self._landing[connector, f] + self._shift[f, floor] for f in served])
        return np.array([np.interp(z, heights, places[:, 0]), np.interp(z, heights, places[:, 1])])

    def _can_rest(self, connector: int, z: float) -> bool:
        heights = self._elevation[self._served(connector)]
        off = float(np.abs(heights - z).min())  # at a floor between it has arrived there, not half-way
        inside = heights[0] < z < heights[-1] and off > _AT_A_FLOOR
        return bool(inside) and self.site.connectors[connector].kind != ConnectorKind.LIFT

    def _agreement(self, difference: Array, rise: float, sigma: float) -> Array:
        """Log-likelihood of a rise for differences in elevation (m), 0 at best."""
        sd = np.hypot(sigma, self.elevation_sigma + self.elevation_relative * np.abs(difference))
        return np.maximum(-0.5 * ((difference - rise) / sd) ** 2, _LEAST)


def _groups(
    rows: NDArray[np.intp], *columns: NDArray[Any]
) -> Iterator[tuple[NDArray[np.intp], tuple[float, ...]]]:
    """Rows with equal values in all columns, and these values: a movement takes them alike."""
    if len(rows):
        keys = np.stack([column[rows].astype(np.float64) for column in columns], axis=1)
        unique, member = np.unique(keys, axis=0, return_inverse=True)
        for g, key in enumerate(unique.tolist()):
            yield rows[member.ravel() == g], tuple(key)
