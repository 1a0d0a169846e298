"""Rows of the peers on a benchmark: the run of a child process, and the errors of its simulations."""

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from islands.errors import IslandsError
from islands.progress import ProgressCallback, Stop, ignore_progress, never_stop
from islands.records.coupled import AnyRecord, CoupledRecord
from islands.simulation.predictors import divergence_bound_of_range
from lab.published_sets.definition import METRIC, Benchmark, BenchmarkData
from lab.published_sets.peers import child
from lab.published_sets.peers.catalogue import Peer
from lab.published_sets.peers.child import PeerRecording
from lab.published_sets.peers.environments import read_last_line
from lab.published_sets.peers.limited_command import run_command
from lab.published_sets.scoring import measure_simulation, separate_reason

#: Wall seconds for each CPU second of the limit, on a machine with other load.
_WALL = 10.0


@dataclass(frozen=True, slots=True)
class PeerRow:
    """Row of the table: one peer on one test.

    Attributes
    ----------
    benchmark, test, metric, unit, peer, version, setting : str
    error : float or None
        In the unit of the benchmark; None with a reason if there is none.
    reason : str or None
    chosen : str or None
        What the held-out data have chosen.
    cpu_s, wall_s : float
        Of the process for all tests of the set, without the installation.
    """

    benchmark: str
    test: str
    metric: str
    unit: str
    peer: str
    version: str
    setting: str
    error: float | None
    reason: str | None
    chosen: str | None
    cpu_s: float
    wall_s: float


@dataclass(frozen=True, slots=True)
class PeerOutcome:
    """Outcome of a run.

    Attributes
    ----------
    errors : mapping
        Error of each test, or the reason why there is none.
    chosen : str or None
    cpu_s, wall_s : float
    """

    errors: Mapping[str, float | str]
    chosen: str | None = None
    cpu_s: float = 0.0
    wall_s: float = 0.0


def compare_peer(
    name: str,
    benchmark: Benchmark,
    data: BenchmarkData,
    peer: Peer,
    python: str | Path = sys.executable,
    limit: float = 300.0,
    progress: ProgressCallback = ignore_progress,
    stop: Stop = never_stop,
) -> list[PeerRow]:
    """Run a peer on a benchmark, and return a row for each test; none if the run was stopped.

    Parameters
    ----------
    name : str
        Name of the benchmark.
    benchmark : Benchmark
    data : BenchmarkData
    peer : Peer
    python : str or Path
        Interpreter that can import the peer.
    limit : float
        CPU seconds of the run.
    progress : callable
    stop : callable
        Once it returns true, the process is ended.
    """
    found = _run(data, peer, python, limit, benchmark.scale, progress, stop)
    if found is None:
        return []
    rows = []
    for test, error in found.errors.items():
        value, reason = separate_reason(error)
        rows.append(
            PeerRow(
                benchmark=name,
                test=test,
                metric=METRIC,
                unit=benchmark.unit,
                peer=peer.package,
                version=peer.version,
                setting=peer.setting,
                error=value,
                reason=reason,
                chosen=found.chosen,
                cpu_s=found.cpu_s,
                wall_s=found.wall_s,
            )
        )
    return rows


def _run(
    data: BenchmarkData,
    peer: Peer,
    python: str | Path,
    limit: float,
    scale: float,
    progress: ProgressCallback,
    stop: Stop,
) -> PeerOutcome | None:
    """Return the outcome of a child process; None if it was stopped."""
    if isinstance(data.estimation, CoupledRecord) and not peer.reads_several_outputs:
        return PeerOutcome(dict.fromkeys(data.tests, f"{peer.package} has models of one output only"))
    with TemporaryDirectory() as name:
        folder = Path(name)
        tests = [each for test in data.tests.values() for each in _cut(test.record, test.known)]
        child.write_request(folder, _cut(data.estimation), tests, limit)
        log = folder / "log.txt"

        def must_end(wall_s: float) -> bool:
            progress(f"{wall_s:.0f} s", min(wall_s / limit, 0.99))
            return wall_s > _WALL * limit or stop()

        # Without the variables and the folders of this package: its modules are not for the peer.
        ended = run_command([python, "-I", child.__file__, peer.script, folder], log, must_end)
        if ended.is_stopped and stop():
            return None
        reason = None
        if ended.exceeds_cpu:
            reason = f"it exceeds the limit of {limit:g} s of CPU"
        elif ended.is_stopped:
            reason = f"it exceeds {_WALL * limit:g} s, {_WALL:g} times the limit of CPU seconds"
        elif ended.code < 0:
            reason = f"signal {-ended.code} has ended it, perhaps because memory was full"
        elif ended.code != 0:
            reason = read_last_line(log)
        if reason is not None:
            return PeerOutcome(dict.fromkeys(data.tests, reason), None, ended.cpu_s, ended.wall_s)
        simulated, chosen = child.read_answer(folder)
    return PeerOutcome(_measure(data, simulated, scale), chosen, ended.cpu_s, ended.wall_s)


def _measure(data: BenchmarkData, simulated: Sequence[child.Array], scale: float) -> dict[str, float | str]:
    """Return the error of each test, or the reason why there is none."""
    errors: dict[str, float | str] = {}
    parts = iter(simulated)
    bound = divergence_bound_of_range(data.estimation.y, complete=True)
    for name, test in data.tests.items():
        whole = np.vstack([next(parts) for _ in test.record.bounds]).reshape(test.record.y.shape)
        whole[~(np.abs(whole) <= bound)] = np.nan
        try:
            errors[name] = scale * measure_simulation(whole, test)
        except IslandsError as error:
            errors[name] = str(error)
    return errors


def _cut(record: AnyRecord, known: int | None = None) -> list[PeerRecording]:
    """Return the recordings of a record; of the outputs, the known first samples or all."""
    u, y = (np.asarray(each, float).reshape(record.samples, -1) for each in (record.u, record.y))
    return [
        PeerRecording(u[begin:end], y[begin : end if known is None else begin + known])
        for begin, end in record.bounds
    ]
