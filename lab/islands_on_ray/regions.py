"""CPU time of the coordinators of 10 000 islands, measured with simulated epochs; cost of a checkpoint.

    python -m lab.islands_on_ray.regions [region] [driver] [checkpoint] [--pace SECONDS] [--islands N]
                                         [--json FILE]

The tree has a driver, coordinators of regions of 500 islands each, and the actors of islands. Two levels are
measured, each with the real code of the level and with actors that answer without computing. Their answers
are those of a real epoch of an island of 500 individuals: packed bytes, emigrants and statistics.

``region``: the coordinator of 500 islands, which gets the packed islands one by one.

``driver``: the driver of 20 regions, whose reports arrive every ``--pace`` seconds, 10 % apart. It merges
the statistics and stores progress and history in a database on the disk, as a job of the service does. The
islands of a region stay with its actor and are not sent.

``checkpoint``: the driver, while it writes a checkpoint of ``--islands`` islands of 500 individuals whose
regions are in the object store, and one of 256 islands that are in its memory. The peak of the memory
includes the pages of the object store that the driver reads.

CPU times include all threads of the process. Epochs of a second are feasible if each level takes less.
"""

import argparse
import json
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from math import inf
from pathlib import Path
from threading import Event
from typing import Any
from uuid import uuid4

import numpy as np
import ray

from islands.distribution import read_version
from islands.evolution.archipelago import Archipelago, Island, empty_archipelago
from islands.evolution.engine import IslandEpoch, SerialEngine, select_migrants
from islands.evolution.presets import PRESETS
from islands.evolution.problem import Problem
from islands.evolution.search_state import SearchState, advance
from islands.records.dataset import Dataset
from islands_service.coordinator.checkpoints import JobCheckpoints, JobStart
from islands_service.coordinator.identification_job import ProgressReporter
from islands_service.coordinator.job_run import JobNotes, JobRun
from islands_service.coordinator.search_view import SearchFront
from islands_service.domain.job_spec import parse_identification
from islands_service.engines import ENGINES
from islands_service.runtime import actor_pool, regions
from islands_service.runtime.packed_epoch import PackedEpoch, PackedIslands, pack_epoch
from islands_service.runtime.ray_engine import RayEngine
from islands_service.runtime.regions import RegionIslands, RegionReport, RegionStatus
from islands_service.store import Store
from islands_service.store.blobs import Blobs
from support.stores import claimed, submitted

#: Islands of a region, and regions of the search.
ISLANDS, REGIONS = regions.REGION_SIZE, 20

#: Number of timed epochs, after the first one.
TIMED = 10

#: Islands of the checkpoint of a search without regions.
FLAT = 256


def never() -> bool:
    return False


def make_problem(islands: int) -> Problem:
    rng = np.random.default_rng(0)
    record = Dataset(np.cumsum(rng.normal(size=500)), np.cumsum(rng.normal(size=500)), 0.1)
    settings = replace(
        PRESETS["paper-case1"], islands=islands, migrate_every=1, generations=TIMED + 1, topology="torus"
    )
    return Problem(record, settings)


def make_answer() -> PackedEpoch:
    """Return a real epoch of an island of 500 individuals."""
    problem = make_problem(1)
    short = replace(problem, settings=replace(problem.settings, generations=2, topology="isolated"))
    *_, epoch = SerialEngine().run(short, empty_archipelago(1, 0), never)
    (island,) = epoch.archipelago.islands
    leaving = select_migrants(island, short.settings_of(0))
    return pack_epoch(IslandEpoch(island, leaving, epoch.steps[0]))


class NoCheckpoints(JobCheckpoints):
    """Empty checkpoints. Real ones are not part of an epoch: they take at most a twentieth of a search."""

    def write(self, *_: Any) -> str:
        return self._blobs.write(b"")


class SimulatedIslandActor:
    """Actor that answers without computing."""

    def __init__(self, given: tuple[Problem, PackedEpoch]) -> None:
        self._answer = given[1]

    def prepare(self) -> str:
        return read_version()

    @ray.method(concurrency_group="watch")
    def wait_until_killed(self) -> None:
        Event().wait()

    @ray.method(num_returns=2)
    def advance(self, before: PackedEpoch, *_arriving: bytes) -> tuple[PackedEpoch, bytes]:
        return replace(self._answer, index=before.index), self._answer.emigrants


class SimulatedRegionActor:
    """Actor whose reports arrive at a steady pace, with one island of the region."""

    def __init__(
        self,
        given: tuple[PackedEpoch, float],
        _sources: Any,
        border: frozenset[int],
        generation: int,
        state: tuple[PackedEpoch, ...],
        *_: Any,
    ) -> None:
        self._answer, self._pace = given
        self._border, self._generation, self._islands = border, generation, len(state)
        self._pause = np.random.default_rng(state[0].index)
        self._next = time.monotonic()

    @ray.method(concurrency_group="watch")
    def check(self) -> RegionStatus:
        return RegionStatus(read_version())

    @ray.method(num_returns=2)
    def advance(self, *_arriving: Any) -> tuple[RegionReport, tuple[PackedEpoch, ...]]:
        self._next += self._pace * self._pause.uniform(0.9, 1.1)
        time.sleep(max(0.0, self._next - time.monotonic()))
        self._generation += 1
        steps = tuple(replace(info, generation=self._generation) for info in self._answer.steps[-1:])
        leaving = dict.fromkeys(self._border, self._answer.emigrants)
        # Distinct objects, as those of real islands are after their journey.
        report = RegionReport(tuple(copy_steps(steps) for _ in range(self._islands)), leaving)
        # The driver reads the generation of the first island.
        return report, (self._answer,)


def copy_steps(steps: tuple[Any, ...]) -> tuple[Any, ...]:
    return tuple(replace(info, outcomes=dict(info.outcomes), best=dict(info.best)) for info in steps)


@contextmanager
def replaced(module: Any, name: str, value: Any) -> Iterator[None]:
    before = getattr(module, name)
    setattr(module, name, value)
    try:
        yield
    finally:
        setattr(module, name, before)


def measure_region(answer: PackedEpoch) -> dict[str, float]:
    """Measure the coordinator of a region, which is this process."""
    options = {"max_restarts": 0, "max_task_retries": 0, "concurrency_groups": {"watch": 1}}
    problem = make_problem(ISLANDS)
    cpu, wall = [], []
    with (
        replaced(actor_pool, "_ACTOR", ray.remote(**options)(SimulatedIslandActor)),
        replaced(actor_pool, "put_problem", lambda posed: ray.put((posed, answer))),
    ):
        for _ in RayEngine(print).run(problem, empty_archipelago(ISLANDS, 0), never):
            cpu.append(time.process_time())
            wall.append(time.perf_counter())
    states = tuple(replace(answer, index=index, packed=bytes([*answer.packed])) for index in range(ISLANDS))
    began = time.process_time()
    reference = ray.put(states)
    put = time.process_time() - began
    del reference
    return {
        "islands": ISLANDS,
        "packed island, bytes": len(answer.packed),
        "CPU of an epoch, s": (cpu[-1] - cpu[1]) / TIMED,
        "CPU of storing the islands of an epoch, s": put,
        "epoch on this machine, s": (wall[-1] - wall[1]) / TIMED,
    }


def measure_driver(answer: PackedEpoch, pace: float) -> dict[str, float]:
    """Measure the driver of all regions with a database on the disk."""
    options = {"max_restarts": 0, "max_task_retries": 0, "num_cpus": 0, "concurrency_groups": {"watch": 1}}
    problem = make_problem(ISLANDS * REGIONS)
    cpu, wall, merging = [], [], 0.0
    with (
        tempfile.TemporaryDirectory() as folder,
        replaced(regions, "_ACTOR", ray.remote(**options)(SimulatedRegionActor)),
        replaced(regions, "put_problem", lambda _problem: ray.put((answer, pace))),
    ):
        store = Store(f"sqlite:///{folder}/islands.db")
        submitted(store)
        lease = claimed(store)
        blobs = Blobs(Path(folder) / "blobs")
        checkpoints = NoCheckpoints(lease.job, blobs)
        notes = JobNotes(lease, store)
        run = JobRun(lease, store, blobs, SerialEngine(), lambda: None, inf, notes, lambda: None)
        spec = parse_identification({"dataset": uuid4().hex, "inputs": ["u"], "output": "y"})
        front = SearchFront()
        reporter = ProgressReporter(
            run, checkpoints, lambda: None, JobStart(), spec, problem.record.samples, front
        )
        state = SearchState(empty_archipelago(ISLANDS * REGIONS, 0))
        for epoch in regions.run_regions(problem, state.archipelago, never, REGIONS, print):
            began = time.process_time()
            state = advance(state, epoch)
            reporter(state, problem.settings)
            cpu.append(time.process_time())
            merging += cpu[-1] - began
            wall.append(time.perf_counter())
            print(f"epoch {len(wall)}: {wall[-1] - wall[max(0, len(wall) - 2)]:.2f} s", flush=True)
            if len(wall) == TIMED + 2:
                break
        store.close()
    return {
        "islands": ISLANDS * REGIONS,
        "pace, s": pace,
        "CPU of an epoch, s": (cpu[-1] - cpu[1]) / TIMED,
        "of that, merging and storing, s": merging / (TIMED + 2),
        "epoch, s": (wall[-1] - wall[1]) / TIMED,
    }


def measure_checkpoint(answer: PackedEpoch, size: int) -> dict[str, float]:
    """Measure a checkpoint of islands in regions, and one of islands in this process."""
    problem = make_problem(1)
    reports = [replace(answer, index=index, packed=bytes([*answer.packed])) for index in range(size)]
    starts = range(0, size, ISLANDS)
    states = [ray.put(tuple(reports[start : start + ISLANDS])) for start in starts]
    flat = PackedIslands(reports[:FLAT], problem.settings.primitive_table)
    del reports
    found = _write_checkpoint(RegionIslands(starts, size, states, problem, ray.put(problem)))
    local = _write_checkpoint(flat)
    return {"islands": size, **found, **{f"{FLAT} local islands: {name}": local[name] for name in local}}


def _write_checkpoint(islands: Sequence[Island]) -> dict[str, float]:
    """Measure this process while it writes a checkpoint."""
    with tempfile.TemporaryDirectory() as folder:
        store, blobs = Store(f"sqlite:///{folder}/islands.db"), Blobs(Path(folder) / "blobs")
        submitted(store)
        checkpoints = JobCheckpoints(claimed(store).job, blobs)
        Path("/proc/self/clear_refs").write_text("5")  # forget the peak so far
        memory, wall, cpu = _read_memory("VmRSS"), time.perf_counter(), time.process_time()
        blob = checkpoints.write(SearchState(Archipelago(islands)), 0.0, None)
        found = {
            "time, s": time.perf_counter() - wall,
            "CPU, s": time.process_time() - cpu,
            "peak of the memory in addition, MB": _read_memory("VmHWM") - memory,
            "file, MB": blobs.path(blob).stat().st_size / 1e6,
        }
        store.close()
        return found


def _read_memory(name: str) -> float:
    """Return a figure of the memory of this process in MB."""
    (line,) = (line for line in Path("/proc/self/status").read_text().splitlines() if line.startswith(name))
    return float(line.split()[1]) * 1024 / 1e6


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("levels", nargs="*", help="region, driver, checkpoint; all by default")
    parser.add_argument("--pace", type=float, default=1.0, help="seconds between two reports of a region")
    parser.add_argument("--islands", type=int, default=1_000, help="islands of the checkpoint")
    parser.add_argument("--json", type=Path)
    given = parser.parse_args()
    found: dict[str, dict[str, float]] = {}
    answer = make_answer()
    with ENGINES["ray"](None, print):
        if "region" in given.levels or not given.levels:
            found["region"] = measure_region(answer)
        if "driver" in given.levels or not given.levels:
            found["driver"] = measure_driver(answer, given.pace)
        if "checkpoint" in given.levels or not given.levels:
            found["checkpoint"] = measure_checkpoint(answer, given.islands)
    for level, figures in found.items():
        for name, value in figures.items():
            print(f"{level:10s} {name:60s} {value:10.3g}")
    if given.json:
        given.json.write_text(json.dumps(found, indent=2))


if __name__ == "__main__":
    main()
