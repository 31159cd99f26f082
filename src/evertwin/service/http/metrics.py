"""Figures for Prometheus, taken when they are asked for."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from prometheus_client import CollectorRegistry, generate_latest
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, Metric
from prometheus_client.registry import Collector

from evertwin.service.service import Service

STATES = ("starting", "running", "ended", "quarantined", "stopped")
CONDITIONS = (
    "good", "unjudged", "check", "maintenance_required", "out_of_specification", "failure",
)  # fmt: skip


class Figures(Collector):
    """The figures of a service.

    >>> Figures.__name__
    'Figures'
    """

    def __init__(self, service: Service) -> None:
        self._service = service

    def collect(self) -> Iterator[Metric]:
        """All of them."""
        service = self._service
        lag = GaugeMetricFamily(
            "evertwin_loop_lag_seconds", "How late the event loop was, newest minute",
            labels=["quantile"],
        )  # fmt: skip
        lag.add_metric(["0.99"], service.lag.share(0.99))
        lag.add_metric(["1"], service.lag.worst)
        yield lag
        yield GaugeMetricFamily("evertwin_ready", "Every twin runs or is out", service.ready)
        yield CounterMetricFamily("evertwin_reloads", "Configurations taken", service.reloads)
        told = {name: runner.status() for name, runner in service.runners.items()}
        yield from self._twins(told)
        yield from self._sources(told)

    def _twins(self, told: dict[str, Any]) -> Iterator[Metric]:
        state = GaugeMetricFamily("evertwin_twin_state", "1 for the state it is in",
                                  labels=["twin", "state"])  # fmt: skip
        for name, status in told.items():
            for one in STATES:
                state.add_metric([name, one], status["state"] == one)
        yield state
        how = GaugeMetricFamily("evertwin_twin_condition", "1 for its condition (NE 107)",
                                labels=["twin", "condition"])  # fmt: skip
        alarm = GaugeMetricFamily("evertwin_twin_alarm", "Is an alarm out?", labels=["twin"])
        for name, status in told.items():
            for one in CONDITIONS:
                how.add_metric([name, one], status["condition"] == one)
            alarm.add_metric([name], status["alarm"] is not None)
        yield from (how, alarm)
        gauges = {"rows": "Rows so far", "waiting": "Pieces of samples that wait",
                  "champion": "Version that is live", "stale": "Is what it shows stale?",
                  "age": "Seconds since its newest samples came"}  # fmt: skip
        for key, text in gauges.items():
            gauge = GaugeMetricFamily(f"evertwin_twin_{key}", text, labels=["twin"])
            for name, status in told.items():
                if status[key] is not None:
                    gauge.add_metric([name], float(status[key]))
            yield gauge
        dropped = CounterMetricFamily("evertwin_twin_dropped", "Samples dropped: too many waited",
                                      labels=["twin"])  # fmt: skip
        for name, status in told.items():
            dropped.add_metric([name], status["dropped"])
        yield dropped
        for key, text in (("durable", "durable"), ("folded", "what is said of it is durable")):
            gauge = GaugeMetricFamily(
                f"evertwin_twin_{key}_seconds", f"From arrival until {text}, p99", labels=["twin"]
            )
            for name in told:
                if took := getattr(self._service.runners[name], key):
                    gauge.add_metric([name], float(np.quantile(took, 0.99)))
            yield gauge

    def _sources(self, told: dict[str, Any]) -> Iterator[Metric]:
        counts = {"received": "Samples that came", "repeated": "Samples that had come before",
                  "reconnects": "Connections after the first"}  # fmt: skip
        every = [(name, source, health) for name, status in told.items()
                 for source, health in status["sources"].items()]  # fmt: skip
        for key, text in counts.items():
            counter = CounterMetricFamily(f"evertwin_source_{key}", text, labels=["twin", "source"])
            for name, source, health in every:
                counter.add_metric([name, source], health[key])
            yield counter
        for key, label in (("rejected", "reason"), ("lost", "cause")):
            counter = CounterMetricFamily(
                f"evertwin_source_{key}", f"Samples {key}", labels=["twin", "source", label]
            )
            for name, source, health in every:
                for why, count in health[key].items():
                    counter.add_metric([name, source, why], count)
            yield counter


def exposition(service: Service) -> bytes:
    """The figures as Prometheus reads them."""
    registry = CollectorRegistry(auto_describe=False)
    registry.register(Figures(service))
    return generate_latest(registry)
