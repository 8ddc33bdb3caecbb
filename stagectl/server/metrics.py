"""Figures for Prometheus, on this computer only: `stagectl serve --metrics PORT`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from stagectl.errors import StagectlError, missing_extra
from stagectl.protocol.state import Notice, State

if TYPE_CHECKING:
    from prometheus_client import CollectorRegistry

_SETTLING = (0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0)
"""Bounds of the settling times [s]."""


class Metrics:
    """The figures, served until the process ends.

    Args:
        port: on 127.0.0.1; 0 for none (a test reads the registry).

    Attributes:
        registry: of the figures.

    Raises:
        UnusableInput: prometheus-client is not installed.
        StagectlError: the port cannot be used.
    """

    def __init__(self, port: int) -> None:
        try:
            import prometheus_client as prometheus
        except ImportError as why:
            raise missing_extra("--metrics needs", "prometheus-client", "metrics") from why
        self.registry: CollectorRegistry = prometheus.CollectorRegistry()
        own = self.registry
        self._moves = prometheus.Counter("stagectl_moves", "Moves begun", ["kind"], registry=own)
        self._settling = prometheus.Histogram(
            "stagectl_settling_seconds", "From the end of a move's demand until the axes had "
            "stayed in the window", ["kind"], buckets=_SETTLING, registry=own,
        )  # fmt: skip
        self._timeouts = prometheus.Counter(
            "stagectl_not_settled", "Waits that timed out", registry=own
        )
        self._runs = prometheus.Counter("stagectl_runs", "Runs ended", ["outcome"], registry=own)
        self._alarms = prometheus.Counter("stagectl_alarms", "Faults of the stage", registry=own)
        self._late = prometheus.Gauge("stagectl_late_syncs", "SYNCs that left late", registry=own)
        self._missed = prometheus.Gauge("stagectl_missed_samples", "Samples missed", registry=own)
        self._queue = prometheus.Gauge("stagectl_queue_waiting", "Recipes that wait", registry=own)
        if port:
            try:
                prometheus.start_http_server(port, "127.0.0.1", self.registry)
            except OSError as why:
                raise StagectlError(f"--metrics {port}: {why.strerror}") from why

    def take(self, notice: Notice) -> None:
        """Count what has happened."""
        data = notice.data
        match notice.kind:
            case "move_started":
                self._moves.labels(data["kind"]).inc()
            case "settled" if data["settled"]:
                self._settling.labels(data["kind"]).observe(data["duration"])
            case "settled":
                self._timeouts.inc()
            case "end":
                self._runs.labels(data["outcome"]).inc()
            case "alarm" if "axis" in data:
                self._alarms.inc()

    def look(self, state: State) -> None:
        """Take over the counts of a state."""
        self._late.set(state.late)
        self._missed.set(state.missed)
        self._queue.set(sum(entry.status == "waiting" for entry in state.queue))
