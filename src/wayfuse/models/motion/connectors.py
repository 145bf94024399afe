r"""Particles on stairs, in lifts, on escalators: sampling cases 1 to 3 of chu2009 Section 3.2.

A reported movement (`inertial.vertical`) takes each particle through three phases. It *boards* (case 1.2 and 1.3): a
particle that stands d metres from a landing with a way in the direction of the rise boards that connector with odds

.. math:: k \exp\frac{-d^2}{2 (\sigma + \rho n)^2}

(k: 1 for a connector of the reported kind, less for another; n steps since the movement began), an *unlisted* connector
with small odds, for plans are incomplete, or stays, for reports can be false. The sum of the odds is the likelihood of
the movement at its place. On the way it is where the rise says, between its landings (cases 2.2 and 3.1); steps do not
move it. At the end it *alights* on one of the floors its connector serves, drawn by how well the floor's elevation
agrees with the rise (case 3.2, "with a probability distribution"); a connector that serves no such floor is unlikely.

Departure from the paper: places on stairs are a height, not a number of stairs, so that a barometer, counted stairs and
a lift's acceleration are one model; particles may board an unlisted connector and none is moved for certain.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.errors import ConfigError
from wayfuse.core.philox import Noise
from wayfuse.core.types import Array
from wayfuse.filters.cloud import NO_CONNECTOR, Cloud
from wayfuse.inertial.vertical import Behaviour, VerticalEvent
from wayfuse.maps.connectors import ConnectorKind
from wayfuse.maps.site import Site

__all__ = ["UNLISTED", "ConnectorMotion"]

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
    hysteresis : m a particle must be nearer another floor before it counts as there. scatter : m, where people stand
    when they alight.
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
    hysteresis: float = 0.3
    scatter: float = 0.7
    _landing: Array = field(init=False, repr=False)
    _elevation: Array = field(init=False, repr=False)
    _shift: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        for name in ("sigma", "false_alarm", "unlisted", "unlisted_alone", "elevation_sigma"):
            if not getattr(self, name) > 0.0:
                raise ConfigError(
                    f"{name} must be positive, got {getattr(self, name)}", where="ConnectorMotion"
                )
        site, n = self.site, len(self.site.floors)
        landing = np.full((len(site.connectors), n, 2), np.nan)  # connector, floor: x, y of the landing
        for c, connector in enumerate(site.connectors):
            for at in connector.landings:
                landing[c, at.floor] = at.x, at.y
        shift = np.array([[site.shift(a, b) for b in range(n)] for a in range(n)])
        object.__setattr__(self, "_landing", landing)
        object.__setattr__(self, "_elevation", np.array([floor.elevation for floor in site.floors]))
        object.__setattr__(self, "_shift", shift)

    def board(self, noise: Noise, cloud: Cloud, event: VerticalEvent, log_weights: Array) -> Cloud:
        """Put the particles on connectors as a movement is first reported; adds its likelihood to the weights."""
        odds = self._odds(cloud, event)
        total = odds.sum(axis=1)
        log_weights += np.log(total)
        u = noise.uniforms(cloud.n)[0] * total
        choice = np.minimum((np.cumsum(odds, axis=1) < u[:, None]).sum(axis=1), odds.shape[1] - 1)
        n = len(self.site.connectors)
        connector = np.where(choice < n, choice, np.where(choice == n, UNLISTED, NO_CONNECTOR)).astype(
            np.int32
        )
        aboard = connector != NO_CONNECTOR
        departure = np.where(aboard, cloud.floor, cloud.departure).astype(np.int32)
        return self.ride(cloud._replace(connector=connector, departure=departure), event)

    def ride(self, cloud: Cloud, event: VerticalEvent) -> Cloud:
        """Where the rise has taken those aboard: between two landings, on the floor they are nearest."""
        if not np.any(cloud.connector != NO_CONNECTOR):
            return cloud
        x, y, floor = cloud.x.copy(), cloud.y.copy(), cloud.floor.copy()
        # all particles of one connector, departure and present floor are at one place
        aboard = np.flatnonzero(cloud.connector != NO_CONNECTOR)
        keys = np.stack([cloud.connector[aboard], cloud.departure[aboard], cloud.floor[aboard]], axis=1)
        groups, member = np.unique(keys, axis=0, return_inverse=True)
        for g, (c, start, now) in enumerate(groups.tolist()):
            rows = aboard[member.ravel() == g]
            served = self._served(c)
            z = self._elevation[start] + event.rise
            f = self._nearest(served, z, now)
            floor[rows] = f
            if c == UNLISTED:
                x[rows] += np.float32(self._shift[now, f, 0])
                y[rows] += np.float32(self._shift[now, f, 1])
            else:
                x[rows], y[rows] = self._between(c, served, z, f).astype(np.float32)
        return cloud._replace(x=x, y=y, floor=floor)

    def alight(self, noise: Noise, cloud: Cloud, event: VerticalEvent, log_weights: Array) -> Cloud:
        """Put those aboard on a floor their connector serves; weights get the agreement of floors and rise."""
        z = noise.normals(cloud.n)
        u = noise.uniforms(cloud.n)[0]
        x, y, floor = cloud.x.copy(), cloud.y.copy(), cloud.floor.copy()
        aboard = cloud.connector != NO_CONNECTOR
        log_weights[~aboard] += self._agreement(np.zeros(1), event)[0]
        keys = np.stack([cloud.connector, cloud.departure], axis=1)
        groups, member = np.unique(keys[aboard], axis=0, return_inverse=True)
        members = np.flatnonzero(aboard)
        for g, (c, start) in enumerate(groups.tolist()):
            rows = members[member.ravel() == g]
            served = self._served(c)
            agreement = self._agreement(self._elevation[served] - self._elevation[start], event)
            p = np.exp(agreement - agreement.max())
            log_weights[rows] += agreement.max()
            f = served[np.minimum(np.searchsorted(np.cumsum(p / p.sum()), u[rows]), len(served) - 1)]
            if c == UNLISTED:
                x[rows] += self._shift[floor[rows], f, 0].astype(np.float32)
                y[rows] += self._shift[floor[rows], f, 1].astype(np.float32)
            else:
                x[rows], y[rows] = self._landing[c, f].T.astype(np.float32)
                x[rows] += np.float32(self.scatter) * z[0, rows]
                y[rows] += np.float32(self.scatter) * z[1, rows]
            floor[rows] = f
        off = np.full_like(cloud.connector, NO_CONNECTOR)
        return cloud._replace(x=x, y=y, floor=floor, connector=off)

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

    def _nearest(self, served: NDArray[np.int64], z: float, now: int) -> int:
        off = np.abs(self._elevation[served] - z)
        best = int(served[np.argmin(off)])
        return best if float(off.min()) + self.hysteresis < abs(self._elevation[now] - z) else now

    def _between(self, connector: int, served: NDArray[np.int64], z: float, floor: int) -> Array:
        """Place (2,) m at height z between the landings, in the frame of ``floor``."""
        heights = self._elevation[served]
        places = np.array([self._landing[connector, f] + self._shift[f, floor] for f in served])
        return np.array([np.interp(z, heights, places[:, 0]), np.interp(z, heights, places[:, 1])])

    def _agreement(self, difference: Array, event: VerticalEvent) -> Array:
        """Log-likelihood of a rise for differences in elevation (m), 0 at best."""
        sd = np.hypot(event.sigma, self.elevation_sigma + self.elevation_relative * np.abs(difference))
        return np.asarray(-0.5 * ((difference - event.rise) / sd) ** 2)
