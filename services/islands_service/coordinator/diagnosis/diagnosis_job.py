"""Discrepancy job: diagnose a simulation, write the report and the extended simulation."""

from collections.abc import Callable
from dataclasses import replace
from time import sleep

import structlog

from islands.discrepancy.diagnosis import diagnose
from islands.discrepancy.diagnosis_result import Diagnosis
from islands.discrepancy.findings import ResidualFormula
from islands.discrepancy.interfaces.parallel import ParallelMap
from islands.discrepancy.interim_findings import InterimFindings
from islands.evolution.engine import Engine
from islands.facade.explain_residual import FORMULA, explain_residual
from islands.io.diagnosis_json import diagnosis_document
from islands.io.simulator_spec.document import extended_json
from islands.io.simulator_spec.factory import make_simulator
from islands_service.coordinator.diagnosis.diagnosis_checkpoints import DiagnosisCheckpoints
from islands_service.coordinator.diagnosis.diagnosis_progress import DiagnosisProgress
from islands_service.coordinator.heartbeat import JobCancelled
from islands_service.coordinator.job_notes import JobNotes
from islands_service.domain.job import EXTENDED, REPORT, JobOutcome, JobState, Lease
from islands_service.domain.job_spec import parse_discrepancy
from islands_service.intake.job_inputs import read_record_and_columns
from islands_service.reports.diagnosis_report import diagnosis_report, summarise
from islands_service.runtime.parallel_map import ray_map
from islands_service.store import Store
from islands_service.store.blobs import Blobs
from islands_service.store.database import StoreError

log = structlog.get_logger()

#: Seconds between two attempts to store what a diagnosis has found.
_RETRY_SECONDS = 1.0


def run_diagnosis_job(
    lease: Lease,
    store: Store,
    blobs: Blobs,
    _engine: Engine,
    check: Callable[[], None],
    every: float,
    _notes: JobNotes | None = None,
    map_cases: ParallelMap | None = None,
) -> JobOutcome:
    """Run a discrepancy job from its last checkpoint.

    A job that is cancelled ends with its findings so far, without formula and report.

    Parameters
    ----------
    check : callable
        Raises the reason if the job must end early.
    every : float
        Least number of seconds between two checkpoints.
    map_cases : ParallelMap, optional
        Fits the effects; by default on the Ray cluster to which this process is connected.

    Raises
    ------
    JobCancelled
        The job was cancelled before the first result.
    IslandsError
        The record or the simulation is unusable, or any other error that ``check`` raises.
    """
    checkpoints = DiagnosisCheckpoints(lease.job, blobs)
    state = checkpoints.read()
    report = DiagnosisProgress(lease, store, check, checkpoints, state, every)
    spec = parse_discrepancy(lease.job.spec)
    datasets = {
        part.dataset: store.datasets.get(lease.job.owner, part.dataset, deleted=True) for part in spec.parts
    }
    report("reading the record", 0.0)
    record, columns = read_record_and_columns(spec, datasets, blobs)
    simulator = make_simulator(spec.simulation, record, columns)
    fits = state.journal.record(map_cases or ray_map(check=check))
    interim, formula, artefacts = InterimFindings(), None, dict[str, str]()
    left_out = [FORMULA, REPORT]

    def stop() -> bool:
        check()
        return False

    try:
        found = diagnose(
            record, simulator, spec.tolerance, spec.seed, report, report.count(fits), interim=interim
        )
        report(FORMULA, 0.95)
        start = state.begin_search(found)
        formula = explain_residual(found, spec.seed, progress=report.count_epochs, stop=stop, start=start)
        left_out.remove(FORMULA)
        wall_s = report.spent
        report("writing the report", 0.98)
        names = ", ".join(datasets[part.dataset].name for part in spec.parts)
        artefacts[REPORT] = _keep(diagnosis_report(names, found, proposal=formula), blobs, check)
        left_out.remove(REPORT)
        if found.gain is not None:
            artefacts[EXTENDED] = _keep(extended_json(found.best, found.record).encode(), blobs, check)
        ended = JobState.SUCCEEDED
    except JobCancelled:
        so_far = interim.make_diagnosis(spec.seed)
        if so_far is None:
            raise
        found = replace(so_far, left_out=(*so_far.left_out, *left_out))
        wall_s, ended = report.spent, JobState.CANCELLED
        if found.gain is not None and EXTENDED not in artefacts:
            artefacts[EXTENDED] = blobs.write(extended_json(found.best, found.record).encode())
    document = diagnosis_document(found, wall_s, proposal=formula)
    summary = _make_summary(found, formula, simulator.name, wall_s, state.note)
    return JobOutcome(ended, document, summary=summary, artefacts=artefacts)


def _keep(data: bytes, blobs: Blobs, check: Callable[[], None]) -> str:
    """Store a blob. Retry while the store is unavailable: the work is done."""
    while True:
        try:
            return blobs.write(data)
        except StoreError as error:
            log.warning("cannot store yet", reason=str(error))
            check()
            sleep(_RETRY_SECONDS)


def _make_summary(
    found: Diagnosis, formula: ResidualFormula | None, simulation: str, wall_s: float, note: str
) -> dict[str, object]:
    words = summarise(found, formula)
    return {
        "simulation": simulation,
        "verdict": str(found.verdict),
        "effects": [finding.name for finding in found.effects],
        "reduction_percent": None if found.gain is None else found.gain.reduction_percent,
        "words": f"{words}\nNote: {note}." if note else words,
        "wall_s": wall_s,
        **({"note": note} if note else {}),
    }
