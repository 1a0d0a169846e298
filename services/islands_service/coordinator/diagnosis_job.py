"""Discrepancy job: diagnose a simulation, write the report and the extended simulation."""

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import partial
from time import monotonic
from typing import TypeVar

from islands.diagnosis.interim_findings import InterimFindings
from islands.diagnosis.procedure import LEAST_FRACTION, diagnose
from islands.evolution.search_state import SearchState
from islands.evolution.settings import Settings
from islands.export.closed_form import find_closed_form
from islands.facade.explain_residual import (
    BEFORE_FORMULA,
    BEFORE_REPORT,
    FORMULA,
    FormulaProgress,
    explain_residual,
)
from islands.facade.results.complete_diagnosis import DiagnosisResult
from islands.models.narx import Model
from islands.parallel import ParallelMap
from islands.progress import Steps, TimeLeft, report_part
from islands.report.pages.origin import Origin
from islands.report.text.statements import describe_headline
from islands.simulators.fmu.instance import LOCAL_FMUS, FmuSource
from islands.simulators.specification.factory import make_simulator
from islands_service.coordinator.checkpoints import CHECKPOINT_SHARE, DiagnosisCheckpoints, DiagnosisState
from islands_service.coordinator.heartbeat import JobCancelled
from islands_service.coordinator.job_run import JobRun
from islands_service.domain.job import (
    EXTENDED,
    NEXT_EXPERIMENT,
    OUTPUTS,
    REPORT,
    JobOutcome,
    JobState,
    ProgressReport,
)
from islands_service.domain.job_spec import Discrepancy, parse_discrepancy
from islands_service.domain.plot_envelopes import write_outputs
from islands_service.intake.job_inputs import open_fmu, read_record_and_columns
from islands_service.logs import OutageLog
from islands_service.runtime.parallel_map import ray_map
from islands_service.settings import service_settings
from islands_service.store.blobs import Blobs
from islands_service.store.database import StoreError

#: Seconds between two reports within a step.
REPORT_EVERY = 0.5

A = TypeVar("A")
R = TypeVar("R")


class DiagnosisProgress:
    """Progress callback that stores progress and checkpoints of a diagnosis.

    Parameters
    ----------
    run : JobRun
        Its check is called at each call.
    checkpoints : DiagnosisCheckpoints
    state : DiagnosisState
        What the diagnosis has computed; read for each checkpoint.
    """

    def __init__(self, run: JobRun, checkpoints: DiagnosisCheckpoints, state: DiagnosisState) -> None:
        self._run, self._checkpoints, self._state = run, checkpoints, state
        self._reported_at = self._checkpoint_at = monotonic()
        self._started_at = self._reported_at - state.spent
        self._stored = state.reached
        self._left = TimeLeft(self._started_at, BEFORE_FORMULA * LEAST_FRACTION)
        self._formula = FormulaProgress()
        self._phase, self._fraction = "", 0.0
        self._report_outage = OutageLog("report failed", "reports stored again")
        self._checkpoint_outage = OutageLog("no checkpoint", "checkpoints stored again")

    @property
    def spent(self) -> float:
        """Seconds spent on the job, over all attempts."""
        return monotonic() - self._started_at

    def __call__(self, message: str, fraction: float | None = None, /) -> None:
        """Store the start of a step at once, and the fraction within a step if a report is due."""
        self._run.check()
        if fraction is not None:
            self._fraction = fraction
        if message != self._phase or monotonic() - self._reported_at > REPORT_EVERY:
            self._phase = message
            self._report()

    def count_epochs(self, state: SearchState, settings: Settings) -> None:
        """Store the state of the search for a formula; called every epoch."""
        self._state.search = state
        now = monotonic()
        fraction, left = self._formula.measure(state, settings, now)
        if left is not None:
            self._left.update(fraction, now)
            self._left.expect(left, now)
        self(self._phase, fraction)

    def _report(self) -> None:
        began = self._reported_at = monotonic()
        self._left.update(self._fraction, began)
        progress = {
            "phase": self._phase,
            "fraction": self._fraction,
            "seconds_left": self._left.at(began),
        }
        if self._state.note:
            progress["note"] = self._state.note
        reached = self._state.reached
        checkpoint = (
            self._write_checkpoint() if began >= self._checkpoint_at and reached != self._stored else None
        )
        try:
            report = ProgressReport(self._run.notes.complete(progress), checkpoint=checkpoint)
            self._run.store.leases.report(self._run.lease, report)
        except StoreError as error:
            # Continue the analysis. The next report has the progress.
            self._report_outage.fail(error, job=self._run.job.id)
            if checkpoint is not None:
                self._checkpoints.remember(checkpoint)
                self._checkpoint_at = monotonic() + self._run.checkpoint_every
            return
        self._report_outage.succeed(job=self._run.job.id)
        if checkpoint is not None:
            self._checkpoints.supersede(checkpoint)
            self._stored, now = reached, monotonic()
            self._checkpoint_at = now + max(self._run.checkpoint_every, (now - began) / CHECKPOINT_SHARE)
            self._run.let_others_pass()

    def _write_checkpoint(self) -> str | None:
        """Write a checkpoint; return its blob, or None if that is not possible now."""
        try:
            blob = self._checkpoints.write(self._state, self.spent)
        except StoreError as error:
            self._checkpoint_outage.fail(error, job=self._run.job.id)
            self._checkpoint_at = monotonic() + self._run.checkpoint_every
            return None
        self._checkpoint_outage.succeed(job=self._run.job.id)
        return blob


def run_diagnosis_job(run: JobRun, map_cases: ParallelMap | None = None) -> JobOutcome:
    """Run a discrepancy job from its last checkpoint.

    A job that is cancelled ends with its findings so far, without formula and report. So does the last
    attempt, once the causes are named.

    Parameters
    ----------
    run : JobRun
    map_cases : ParallelMap, optional
        Fits the effects; by default on the Ray cluster.

    Raises
    ------
    JobCancelled
        The job was cancelled before the first result.
    IslandsError
        The record or the simulation is unusable, or any other error that ``run.check`` raises.
    """
    spec = parse_discrepancy(run.job.spec)
    with _open_fmus(run, spec) as fmus:
        return _run(run, spec, fmus, map_cases)


@contextmanager
def _open_fmus(run: JobRun, spec: Discrepancy) -> Iterator[FmuSource]:
    """Provide the FMU of a job in a process that can do no harm, for the duration of the job."""
    if spec.fmu is None:
        yield LOCAL_FMUS
        return
    seconds = run.job.max_run_seconds or service_settings().max_run_seconds
    with open_fmu(run.get_dataset(spec.fmu.file), run.blobs, seconds, run.check) as source:
        yield source


def _run(run: JobRun, spec: Discrepancy, fmus: FmuSource, map_cases: ParallelMap | None) -> JobOutcome:
    checkpoints = DiagnosisCheckpoints(run.job, run.blobs)
    state = checkpoints.read()
    report = DiagnosisProgress(run, checkpoints, state)
    datasets = {part.dataset: run.get_dataset(part.dataset) for part in spec.parts}
    report("reading the record", 0.0)
    record, columns = read_record_and_columns(spec, datasets, run.blobs)
    simulator = make_simulator(spec.simulation, record, columns, fmus)
    # The process of an FMU serves this one alone.
    fits = state.journal.record(map_cases or (_map_on_ray(run) if spec.fmu is None else map))
    interim, artefacts = InterimFindings(run.keep_answer), dict[str, str]()
    formula, left_out = None, [FORMULA, REPORT]

    def stop() -> bool:
        run.check()
        return False

    steps = Steps(report, stop)
    steps.refusal = run.refusal
    try:
        diagnosed = diagnose(
            *(record, simulator, spec.tolerance, spec.seed, report_part(report, 0.0, BEFORE_FORMULA), fits),
            interim=interim,
            noise_level=spec.noise_level,
        )
        steps(FORMULA, BEFORE_FORMULA)
        start = state.begin_search(diagnosed)
        count = partial(steps.call, report.count_epochs)
        search = partial(explain_residual, diagnosed, spec.seed, on_epoch=count, stop=steps.stop, start=start)
        formula = steps.attempt(FORMULA, search)
        left_out.remove(FORMULA)
        result = DiagnosisResult.from_diagnosis(diagnosed, formula, wall_s=report.spent)
        steps("writing the report", BEFORE_REPORT)
        names = ", ".join(datasets[part.dataset].name for part in spec.parts)
        origin = Origin.from_seconds(names, run.job.created, run.job.owner, run.job.id)
        made = {REPORT: steps.attempt(REPORT, partial(result.write_report, origin))}
        left_out.remove(REPORT)
        steps.refusal = ""  # the extended simulation is part of the answer
        made |= _make_artefacts(result, steps)
        for name, data in made.items():
            if data is not None:
                artefacts[name] = _keep(data, run.blobs, run.check, run.pause)
        ended = JobState.SUCCEEDED
    except JobCancelled:
        so_far = interim.make_diagnosis(spec.seed)
        if so_far is None:
            raise
        result = DiagnosisResult.from_diagnosis(so_far, formula, wall_s=report.spent)
        steps = Steps()
        for each in left_out:
            steps.leave_out(each)
        ended = JobState.CANCELLED
        for name, data in _make_artefacts(result, steps).items():
            if data is not None and name not in artefacts:
                artefacts[name] = run.blobs.write(data)
    model, last = None, Steps()
    if result.gain is not None:
        model = last.attempt("equation", lambda: find_closed_form(result.extension.spec))
    complete = result.with_steps(steps).with_steps(last)
    summary = _make_summary(complete, simulator.name, model, state.note)
    return JobOutcome(ended, complete.document, summary=summary, artefacts=artefacts)


def _map_on_ray(run: JobRun) -> ParallelMap:
    """Return a parallel map on the Ray cluster, to which its first call connects."""
    parallel_map = ray_map(check=run.check)

    def map_on_ray(function: Callable[[A], R], arguments: Iterable[A], /) -> Iterator[R]:
        run.connect()
        return parallel_map(function, arguments)

    return map_on_ray


def _keep(data: bytes, blobs: Blobs, check: Callable[[], None], pause: Callable[[StoreError], None]) -> str:
    """Store a blob. Retry while the store is unavailable: the work is done."""
    outage = OutageLog("cannot store yet", "stored")
    while True:
        try:
            blob = blobs.write(data)
        except StoreError as error:
            outage.fail(error)
            check()
            pause(error)
        else:
            outage.succeed()
            return blob


def _make_artefacts(found: DiagnosisResult, steps: Steps) -> dict[str, bytes | None]:
    """Return the artefacts besides the report: the outputs, and what the diagnosis has of the others."""
    outputs = partial(write_outputs, found.record.y, found.simulated_outputs)
    texts = {EXTENDED: "extended_document", NEXT_EXPERIMENT: "next_input"}
    made = {name: steps.attempt(name, partial(getattr, found, text)) for name, text in texts.items()}
    written = {name: None if text is None else text.encode() for name, text in made.items()}
    return {OUTPUTS: steps.attempt(OUTPUTS, outputs), **written}


def _make_summary(
    found: DiagnosisResult, simulation: str, model: Model | None, note: str
) -> dict[str, object]:
    words = found.summary
    return {
        "simulation": simulation,
        "verdict": str(found.verdict),
        "effects": list(found.claimed_names),
        "reduction_percent": None if found.gain is None else found.gain.reduction_percent,
        "headline": "\n".join(describe_headline(found.document)),
        "words": f"{words}\nNote: {note}." if note else words,
        "wall_s": found.wall_s,
        **({} if model is None else {"equation": model.equation().line}),
        **({"note": note} if note else {}),
    }
