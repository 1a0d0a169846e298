"""Discrepancy job: diagnose a simulation, write the report and the extended simulation."""

from collections.abc import Callable
from time import monotonic, sleep

import structlog

from islands.discrepancy.diagnosis import Diagnosis, ResidualFormula, diagnose
from islands.discrepancy.interfaces.parallel import ParallelMap
from islands.evolution.engine import Engine
from islands.facade.explain_residual import explain_residual
from islands.io.diagnosis_json import diagnosis_document
from islands.io.simulator_spec.document import extended_json
from islands.io.simulator_spec.factory import make_simulator
from islands_service.coordinator.diagnosis_progress import DiagnosisProgress
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
    _every: float,
    _notes: JobNotes | None = None,
    map_cases: ParallelMap | None = None,
) -> JobOutcome:
    """Run a discrepancy job.

    It takes seconds to minutes and has no checkpoints: after an interruption it starts again.

    Parameters
    ----------
    check : callable
        Raises the reason if the job must end early.
    map_cases : ParallelMap, optional
        Fits the effects; by default on the Ray cluster to which this process is connected.

    Raises
    ------
    IslandsError
        The record or the simulation is unusable, or any error that ``check`` raises.
    """
    started = monotonic()
    report = DiagnosisProgress(lease, store, check)
    spec = parse_discrepancy(lease.job.spec)
    datasets = {
        part.dataset: store.datasets.get(lease.job.owner, part.dataset, deleted=True) for part in spec.parts
    }
    report("reading the record", 0.0)
    record, columns = read_record_and_columns(spec, datasets, blobs)
    simulator = make_simulator(spec.simulation, record, columns)
    fits = map_cases or ray_map(check=check)
    found = diagnose(record, simulator, spec.tolerance, spec.seed, report, report.count(fits))
    report("a formula for the unexplained residual", 0.95)
    formula = explain_residual(found, spec.seed)
    wall_s = monotonic() - started
    report("writing the report", 0.98)
    names = ", ".join(datasets[part.dataset].name for part in spec.parts)
    artefacts = {REPORT: _keep(diagnosis_report(names, found, proposal=formula), blobs, check)}
    if found.gain is not None:
        artefacts[EXTENDED] = _keep(extended_json(found.best, found.record).encode(), blobs, check)
    document = diagnosis_document(found, wall_s, proposal=formula)
    return JobOutcome(
        JobState.SUCCEEDED,
        document,
        summary=_summary(found, formula, simulator.name, wall_s),
        artefacts=artefacts,
    )


def _keep(data: bytes, blobs: Blobs, check: Callable[[], None]) -> str:
    """Store a blob. Retry while the store is unavailable: the work is done."""
    while True:
        try:
            return blobs.write(data)
        except StoreError as error:
            log.warning("cannot store yet", reason=str(error))
            check()
            sleep(_RETRY_SECONDS)


def _summary(
    found: Diagnosis, formula: ResidualFormula | None, simulation: str, wall_s: float
) -> dict[str, object]:
    return {
        "simulation": simulation,
        "verdict": str(found.verdict),
        "effects": [finding.name for finding in found.effects],
        "reduction_percent": None if found.gain is None else found.gain.reduction_percent,
        "words": summarise(found, formula),
        "wall_s": wall_s,
    }
