"""Capacity of a service, computed from measured coefficients: many small jobs, and one large job.

    python -m lab.service.capacity jobs [--jobs 1000] [--retention 30] [...]
    python -m lab.service.capacity islands [--cores 1000] [--epoch 1] [...]

Nothing is measured here. Each option is a coefficient or an assumption, with its default and source in
`--help`; `docs/how-to/plan-capacity.md` explains the formulas.
"""

import argparse
import math
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, fields

#: Seconds of a day.
DAY = 86_400.0


def _option(default: float, text: str, most: float = math.inf) -> float:
    """Return a field with the default, the help text and the largest value of its option."""
    value: float = field(default=default, metadata={"help": text, "most": most})
    return value


@dataclass(frozen=True, slots=True)
class ManyJobs:
    """Load of many jobs, each on a few islands."""

    jobs: float = _option(1_000, "jobs of a day")
    individuals: float = _option(
        48_000, "individuals that a job evaluates: islands x population x generations"
    )
    islands: float = _option(2, "islands of a job, each on one core")
    cpu_individuals: float = _option(0.3, "seconds of CPU of 1 000 individuals, measured")
    cpu_job: float = _option(13, "seconds of CPU of a job in addition: actors, coordinator, result")
    utilisation: float = _option(0.5, "mean share of the cores that is used, assumed: days have peaks", 1.0)
    memory_idle: float = _option(740, "MB of a service without a job, measured")
    memory_actor: float = _option(300, "MB of an actor, measured: a process and its caches")
    record_kb: float = _option(4_500, "kB of the record of a job and of its reading, measured")
    result_kb: float = _option(150, "kB of blobs that a finished job keeps, measured")
    database_kb: float = _option(120, "kB of a finished job in the database, measured")
    checkpoint_kb: float = _option(150, "kB of checkpoints of a running job, measured")
    retention: float = _option(90, "days that a finished job is kept (ISLANDS_RETENTION)")
    requests: float = _option(10, "requests of a job in addition to those of its duration: upload to report")
    poll: float = _option(30, "seconds between two requests for a running job: the longest ?wait")

    @property
    def cpu(self) -> float:
        """Seconds of CPU of a job."""
        return self.cpu_individuals * self.individuals / 1e3 + self.cpu_job

    @property
    def duration(self) -> float:
        """Seconds of a job whose islands have a core each."""
        return self.cpu / self.islands

    @property
    def coordinators(self) -> int:
        """Coordinators, each with one job at a time."""
        return math.ceil(self.jobs * self.duration / DAY / self.utilisation)

    @property
    def cores(self) -> int:
        """Cores of the workers: enough for the work, and for all islands of the running jobs."""
        return math.ceil(max(self.jobs * self.cpu / DAY / self.utilisation, self.coordinators * self.islands))

    @property
    def request_count(self) -> float:
        """Requests of a day."""
        return self.jobs * (self.requests + self.duration / self.poll)

    def rows(self) -> Iterator[tuple[str, str]]:
        kept = self.jobs * self.retention
        memory = self.memory_idle + self.memory_actor * self.coordinators * self.islands
        yield "CPU of a job", f"{self.cpu:.0f} s"
        yield "duration of a job", f"{self.duration:.0f} s"
        yield "CPU of a day", f"{self.jobs * self.cpu / 3600:.1f} core hours"
        yield "cores", f"{self.cores}"
        yield "coordinators", f"{self.coordinators}"
        yield "memory", f"{memory / 1e3:.1f} GB"
        yield "database, growth of a day", f"{self.jobs * self.database_kb / 1e6:.2f} GB"
        yield f"database, {self.retention:g} days", f"{kept * self.database_kb / 1e6:.1f} GB"
        yield "records and results, growth of a day", f"{self.jobs * self._blobs_kb / 1e6:.2f} GB"
        yield f"records and results, {self.retention:g} days", f"{kept * self._blobs_kb / 1e6:.1f} GB"
        yield "checkpoints of running jobs", f"{self.coordinators * self.checkpoint_kb / 1e3:.2f} MB"
        yield "requests of a day", f"{self.request_count:.0f}"

    @property
    def _blobs_kb(self) -> float:
        return self.record_kb + self.result_kb


@dataclass(frozen=True, slots=True)
class LargeJob:
    """One job with an island on each core."""

    cores: float = _option(1_000, "cores, one for each island")
    epoch: float = _option(1.0, "seconds that an island computes between two stops")
    latency: float = _option(0.015, "seconds that an epoch takes in addition on its core, measured")
    region: float = _option(500, "largest number of islands of a coordinator, a constant of the service")
    flat: float = _option(
        0.001,
        "seconds of CPU of a single coordinator for each island: 0.00035 if tiny, 0.001 with 500, measured",
    )
    regional: float = _option(
        0.0005, "the same of the coordinator of a region, measured with 500 individuals"
    )
    driver: float = _option(0.00002, "seconds of CPU of the driver of all regions for each island, measured")
    checkpoint: float = _option(
        0.025, "seconds of the process that renders it for each island of a checkpoint, measured"
    )
    collection: float = _option(
        0.0002, "seconds of the driver of all regions for each island of a checkpoint, measured"
    )
    share: float = _option(0.05, "largest share of the time for checkpoints, a constant of the service", 1.0)
    checkpoint_every: float = _option(
        5, "seconds between two checkpoints at least (ISLANDS_CHECKPOINT_EVERY)"
    )
    ahead: float = _option(2, "epochs in the queue of an actor, a constant of the service")
    island_kb: float = _option(120, "kB of a packed island of 300 individuals, measured")
    memory_actor: float = _option(300, "MB of an actor, measured: a process and its caches")

    @property
    def regions(self) -> int:
        """Number of coordinators of regions; one without regions."""
        return math.ceil(self.cores / self.region)

    @property
    def coordinator_busy(self) -> float:
        """Seconds of the busiest coordinator for an epoch of its islands."""
        if self.regions == 1:
            return self.flat * self.cores
        return self.regional * math.ceil(self.cores / self.regions)

    @property
    def driver_busy(self) -> float:
        """Seconds of the driver for an epoch; a single coordinator is the driver."""
        return self.coordinator_busy if self.regions == 1 else self.driver * self.cores

    @property
    def period(self) -> float:
        """Seconds from one epoch to the next: of the slowest one of islands, coordinators and driver.

        They work at the same time, since calls are sent up to three epochs ahead.
        """
        return max(self.epoch + self.latency, self.coordinator_busy, self.driver_busy)

    @property
    def stall(self) -> float:
        """Seconds of a checkpoint. Regions are rendered at the same time, by a task each."""
        if self.regions == 1:
            return self.checkpoint * self.cores
        return self.checkpoint * math.ceil(self.cores / self.regions) + self.collection * self.cores

    @property
    def interval(self) -> float:
        """Seconds between two checkpoints."""
        return max(self.checkpoint_every, self.stall / self.share)

    @property
    def waiting(self) -> float:
        """Share of the time in which actors wait for a checkpoint, with empty queues."""
        return max(0.0, self.stall - self.ahead * self.period) / self.interval

    @property
    def efficiency(self) -> float:
        """Share of the cores' time that is spent on epochs."""
        return self.epoch / self.period * (1.0 - self.waiting)

    def rows(self) -> Iterator[tuple[str, str]]:
        collected = self.cores / self.regions * self.island_kb / 1e3 / self.period
        shortest = max(self.coordinator_busy, self.driver_busy) - self.latency
        yield "epoch, from one to the next", f"{self.period:.3f} s"
        yield "efficiency", f"{100 * self.efficiency:.0f} %"
        yield "speed-up", f"{self.cores * self.efficiency:.0f}"
        yield "regions", f"{self.regions}"
        yield "coordinator of a region, busy", f"{100 * self.coordinator_busy / self.period:.0f} %"
        yield "driver, busy", f"{100 * self.driver_busy / self.period:.0f} %"
        yield "shortest epoch without loss", f"{max(0.0, shortest):.2f} s"
        yield "a checkpoint takes", f"{self.stall:.0f} s"
        yield "actors wait for checkpoints", f"{100 * self.waiting:.1f} % of the time"
        yield "interval of checkpoints, at least", f"{self.interval:.0f} s"
        yield "network of the coordinator of a region", f"{collected:.0f} MB/s"
        yield "memory of all actors", f"{self.cores * self.memory_actor / 1e3:.0f} GB"


LOADS = {"jobs": ManyJobs, "islands": LargeJob}


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    commands = parser.add_subparsers(dest="load", required=True)
    for name, load in LOADS.items():
        command = commands.add_parser(
            name, help=load.__doc__, formatter_class=argparse.ArgumentDefaultsHelpFormatter
        )
        for each in fields(load):
            option = f"--{each.name.replace('_', '-')}"
            command.add_argument(
                option, type=_number(each.metadata["most"]), default=each.default, help=each.metadata["help"]
            )
    given = vars(parser.parse_args(arguments))
    load = LOADS[given.pop("load")](**given)
    for title, value in load.rows():
        print(f"{title:38s} {value}")
    return 0


def _number(most: float) -> Callable[[str], float]:
    def read(text: str) -> float:
        value = float(text)
        if not (0.0 < value <= most and math.isfinite(value)):
            limit = "" if math.isinf(most) else f" of at most {most:g}"
            raise argparse.ArgumentTypeError(f"{text} is not a positive number{limit}")
        return value

    return read


if __name__ == "__main__":
    sys.exit(main())
