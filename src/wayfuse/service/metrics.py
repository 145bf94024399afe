"""What an operator watches: counters and gauges in a registry of the server's own, for Prometheus."""

from __future__ import annotations

from collections.abc import Callable

from prometheus_client import CollectorRegistry, Counter, Gauge, Histogram, generate_latest

__all__ = ["Metrics"]

_LATENCY_S = (0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 5.0, 10.0)


class Metrics:
    """The metrics of one server."""

    def __init__(self) -> None:
        self.registry = CollectorRegistry()
        self.bodies = Counter(
            "wayfuse_bodies", "Bodies received.", ["adapter", "outcome"], registry=self.registry
        )
        self.records = Counter("wayfuse_records", "Records accepted.", ["adapter"], registry=self.registry)
        self.latency = Histogram(
            "wayfuse_ingest_to_position_seconds",
            "From the arrival of a batch to the position it gave.",
            buckets=_LATENCY_S,
            registry=self.registry,
        )

    def watch(self, name: str, what: str, value: Callable[[], float]) -> None:
        """A gauge that is asked when somebody looks."""
        Gauge(name, what, registry=self.registry).set_function(value)

    def page(self) -> bytes:
        """The text that Prometheus reads."""
        return generate_latest(self.registry)
