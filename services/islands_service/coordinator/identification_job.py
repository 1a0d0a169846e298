"""Identification job: the search on Ray, its progress, its checkpoints and its result."""

import json
from collections.abc import Callable, Generator, Sequence
from contextlib import closing
from dataclasses import replace
from functools import partial
from math import isfinite
from sys import maxsize
from time import monotonic
from typing import Any

from islands.evolution.archipelago import Archipelago
from islands.evolution.engine import ArchipelagoEpoch, Engine, SearchProblem
from islands.evolution.presets import AUTO
from islands.evolution.search_result import AnySearchResult, SearchResult, without_optional_steps
from islands.evolution.search_state import SearchState, sum_searches
from islands.evolution.settings import Settings
from islands.facade.automatic.choice import Choice
from islands.facade.automatic.preset_choice import choose_preset
from islands.facade.fit import fit_record
from islands.facade.front import StoppedFitError
from islands.facade.identification_progress import SEARCH, IdentificationProgress, class_phases
from islands.facade.identify import identify_record
from islands.facade.results.identification import Result
from islands.persistence.checkpoints import history_document
from islands.persistence.models import NARX
from islands.progress import AnswerFoundError, PhasedProgress, ProgressCallback, Stop, StoppedError, TimeLeft
from islands.records.coupled import AnyRecord, CoupledRecord, split_first
from islands.records.dataset import Dataset
from islands.records.split import describe_extrapolation
from islands_service.coordinator.checkpoints import CHECKPOINT_SHARE, JobCheckpoints, JobStart
from islands_service.coordinator.heartbeat import JobCancelled, RunTimeLimitError
from islands_service.coordinator.identification_outcome import (
    keep_free_runs,
    make_outcome,
    write_recommended,
)
from islands_service.coordinator.job_run import JobRun
from islands_service.coordinator.search_view import SearchFront, describe_fits, describe_migration
from islands_service.domain.free_runs import SearchFreeRun
from islands_service.domain.job import (
    BY_OWNER,
    RUN_TIME,
    SEARCH_FREE_RUN,
    Job,
    JobOutcome,
    JobState,
    ProgressReport,
)
from islands_service.domain.job_spec import Identification, parse_identification
from islands_service.domain.search_limits import resolve_job_settings
from islands_service.intake.job_inputs import read_record_and_validation
from islands_service.logs import OutageLog
from islands_service.runtime import ClusterError
from islands_service.store.blobs import Blobs
from islands_service.store.database import StoreError

#: Least number of seconds between two free runs that are stored.
FREE_RUN_EVERY = 2.0


class StoredFreeRun:
    """The free run that the store has, or gets with the next report."""

    def __init__(self, job: Job, blobs: Blobs) -> None:
        self._job, self._blobs = job.id, blobs
        self._due = 0.0
        #: The newest one that was written, its blob, and whether the store is known to name it.
        self._written: SearchFreeRun | None = None
        self._blob, self._is_named = "", False
        #: Blob that the store named before.
        self._earlier: str | None = None
        self._outage = OutageLog("free run not stored", "free runs stored again")

    def write(self, found: SearchFreeRun | None) -> dict[str, str]:
        """Write a free run; return the blob that the next report has to name, by artefact name.

        None is written if another one was written a moment ago, or if the disk is full or the object store
        does not answer: the progress of the job is reported without it.
        """
        pending = self._written is not None and not self._is_named
        if found is not None and found is not self._written and not pending and monotonic() >= self._due:
            self._due = monotonic() + FREE_RUN_EVERY
            # The name of the job keeps the blob apart from that of an equal search.
            document = json.dumps({"job": self._job, **found.document})
            try:
                blob = self._blobs.write(document.encode())
            except StoreError as error:
                self._outage.fail(error, job=self._job)
                return {}
            self._outage.succeed(job=self._job)
            if self._earlier is not None:
                self._blobs.discard(self._earlier)
            self._earlier = self._blob or None
            self._written, self._blob, self._is_named, pending = found, blob, False, True
        return {SEARCH_FREE_RUN: self._blob} if pending else {}

    def confirm(self) -> None:
        """Keep in mind that the store durably names the newest blob."""
        self._is_named = True

    def describe(self) -> dict[str, Any]:
        """Return the part of the progress about the free run that the store names, or gets with it."""
        return {} if self._written is None else {"free_run": self._written.mark}


class StoppableEngine:
    """Engine wrapper that ends the epochs of a search at the request of the owner of the job.

    The steps after the epochs follow as after a complete search. The first population is always evaluated, so
    that there are models.

    Parameters
    ----------
    engine : Engine
    is_stopped : callable
        Returns whether the owner has asked for the end of the search.
    on_problem : callable
        Receives the problem of each search.
    least : int
        Generation before which the request ends no search: an earlier attempt, which was killed, has reached
        it, and the owner has seen its models.
    """

    def __init__(
        self, engine: Engine, is_stopped: Stop, on_problem: Callable[[SearchProblem], None], least: int = 0
    ) -> None:
        self._engine, self._is_stopped, self._on_problem = engine, is_stopped, on_problem
        self._least = least

    def run(self, problem: SearchProblem, start: Archipelago, stop: Stop) -> Generator[ArchipelagoEpoch]:
        """Yield the epochs of a search; see `islands.evolution.engine.Engine`."""
        self._on_problem(problem)
        reached, least = start.generation, min(self._least, problem.settings.generations)

        def ends() -> bool:
            return stop() or (reached >= least and self._is_stopped())

        with closing(self._engine.run(problem, start, ends)) as epochs:
            for epoch in epochs:
                reached = epoch.archipelago.generation
                yield epoch


#: Phase after the last step of the search.
STORING = "storing the result"

#: Seconds between two reports of progress.
REPORT_EVERY = 0.5


def run_identification_job(run: JobRun) -> JobOutcome:
    """Run an identification job from its last checkpoint.

    A job that is cancelled ends between two steps, with the models found so far. If its owner stops the
    search, the epochs end, and all other steps follow. The last attempt ends with the models of the search.

    Raises
    ------
    JobCancelled
        The job was cancelled before the first model.
    IslandsError
        The record or the settings are unusable, the cluster failed, or any other error that ``run.check``
        raises. At the limit of run time the search also ends with its models; without any it is an error.
    """
    spec = parse_identification(run.job.spec)
    datasets = {name: run.get_dataset(name) for name in spec.datasets}
    run.notes.begin("reading the record")
    record, validation = read_record_and_validation(spec, datasets, run.blobs)
    checkpoints = JobCheckpoints(run.job, run.blobs)
    start = checkpoints.read()
    stop = SearchStop(run.check)
    front = SearchFront()
    # Generations of several outputs are summed.
    reached = (run.job.progress or {}).get("generation", 0) if len(spec.outputs) == 1 else 0
    engine = StoppableEngine(run.engine, run.is_search_stopped, front.begin, reached)
    warnings = [
        f"validation extrapolates: {statement}"
        for statement in describe_extrapolation(split_first(record, validation))
    ]
    reporter = ProgressReporter(run, checkpoints, stop, start, spec, record.samples, front, warnings)
    try:
        result = _identify(record, validation, spec, start, engine, reporter, stop)
    except AnswerFoundError as ended:
        models = without_optional_steps(ended.found, str(ended))
        result = Result.from_search(models).with_wall_time(reporter.spent).search_result
    except StoppedError as stopped:
        raise stop.reason or stopped from stopped
    outcome = _end_job(partial(make_outcome, result), result.search.left_out, start.note, stop)
    return keep_free_runs(outcome, partial(write_recommended, result), run)


def _end_job(
    make: Callable[..., JobOutcome], left_out: Sequence[str], note: str, stop: "SearchStop"
) -> JobOutcome:
    """Return the outcome of a search that is complete, cancelled, stopped, or at its limit of run time."""
    if not left_out:
        return make(note)
    if stop.reason is None:
        stopped = f"the owner stopped the job, which leaves out: {', '.join(left_out)}"
        return make("; ".join(filter(None, [note, stopped])), BY_OWNER)
    if not isinstance(stop.reason, RunTimeLimitError):
        return replace(make(note), state=JobState.CANCELLED)
    limit = (
        f"the search ended at the limit of the run time of one job, {stop.reason.limit} s, with its "
        "best models so far; the operator can raise the limit"
    )
    return make("; ".join(filter(None, [note, limit])), RUN_TIME)


class SearchStop:
    """Stop request of all steps of a search: its job is cancelled, or at its limit of run time.

    Parameters
    ----------
    check : callable
        Raises the reason if the job must end early.

    Attributes
    ----------
    reason : JobCancelled or RunTimeLimitError
        Why the search is stopped; None before.
    """

    def __init__(self, check: Callable[[], None]) -> None:
        self._check = check
        self.reason: JobCancelled | RunTimeLimitError | None = None

    def __call__(self) -> bool:
        """Return whether the search is stopped; raise any other reason why the job must end."""
        try:
            self._check()
        except (JobCancelled, RunTimeLimitError) as error:
            self.reason = error
        return self.reason is not None


def _identify(
    record: AnyRecord,
    validation: AnyRecord | float,
    spec: Identification,
    start: JobStart,
    engine: Engine,
    reporter: "ProgressReporter",
    stop: SearchStop,
) -> AnySearchResult:
    if spec.model != NARX:
        fitted = fit_record(
            record,
            validation,
            model=spec.model,
            seed=spec.seed,
            refit=spec.changes.get("refit", "none"),
            constraints=spec.changes.get("constraints"),
            progress=reporter.report_stage,
            stop=stop,
            on_models=reporter.keep_answer,
        )
        return fitted.with_wall_time(reporter.spent).search_result
    preset: str | Choice = spec.preset
    if preset == AUTO and start.choice is not None:
        preset = start.choice
    elif preset == AUTO and isinstance(record, Dataset):
        assert not isinstance(validation, CoupledRecord)
        try:
            preset = choose_preset(
                record, validation, spec.changes, reporter.report_stage, stop, reporter.keep_fits
            )
        except StoppedFitError as stopped:
            return Result.from_search(stopped.found).with_wall_time(reporter.spent).search_result
    reporter.choice = preset if isinstance(preset, Choice) else None
    result = identify_record(
        record,
        validation,
        preset=preset,
        seed=spec.seed,
        progress=reporter.report_stage,
        on_epoch=reporter,
        stop=stop,
        start=start.state,
        engine=engine,
        on_models=reporter.keep_answer,
        **spec.changes,
    )
    reporter.flush()
    return result.with_wall_time(reporter.spent).search_result


def _make_progress(progress: ProgressCallback, spec: Identification, samples: int) -> PhasedProgress:
    if spec.model != NARX:
        return PhasedProgress(progress, class_phases(spec.model, samples, spec.outputs))
    settings, *_ = resolve_job_settings(spec, maxsize, maxsize)
    return IdentificationProgress(progress, spec.preset, samples, settings, spec.outputs)


class ProgressReporter:
    """Progress callback that stores progress, history and checkpoints of a search."""

    def __init__(
        self,
        run: JobRun,
        checkpoints: JobCheckpoints,
        stop: Callable[[], object],
        start: JobStart,
        spec: Identification,
        samples: int,
        front: SearchFront,
        warnings: Sequence[str] = (),
    ) -> None:
        self._warnings = {"warnings": list(warnings)} if warnings else {}
        self._outputs, self._seed, self._front = len(spec.outputs), spec.seed, front
        self._fits: list[dict[str, Any]] = []
        self._free_run = StoredFreeRun(run.job, run.blobs)
        self._phases = _make_progress(self._keep_stage, spec, samples)
        self._run, self._checkpoints, self._stop = run, checkpoints, stop
        self.keep_answer = run.keep_answer
        self._started_at = monotonic() - start.spent
        state = start.state and sum_searches(start.state)
        #: Number of the search of an output, and time and evaluations after its first epoch in this process.
        self._first: tuple[int, float, int] | None = None
        self._left = TimeLeft(self._started_at)
        self._stage: dict[str, Any] = {}
        self._note = {"note": start.note} if start.note else {}
        # Number of stored points that will not change. The last point of a history is replaced until the best
        # improves.
        self._stored_points = 0 if state is None else len(state.history) - 1
        self._report_at = self._checkpoint_at = monotonic()  # store the first populations immediately
        self._last: tuple[SearchState, Settings] | None = None
        self._outage = OutageLog("report failed", "reports stored again")
        #: Choice of the preset auto, which checkpoints contain.
        self.choice: Choice | None = None

    @property
    def spent(self) -> float:
        """Seconds spent on the job, over all attempts."""
        return monotonic() - self._started_at

    def __call__(self, state: SearchState, settings: Settings) -> None:
        """Store the state of the search if a report is due."""
        self._stop()
        self._last = state, settings
        if monotonic() >= min(self._report_at, self._checkpoint_at):
            self._report(state, settings)

    def report_stage(self, message: str, fraction: float | None = None, /) -> None:
        """Store the stage before or after the epochs as the phase."""
        self._stop()
        self._phases(message, fraction)
        reached = self._progress(*self._last) if self._last else self._reached_before()
        try:
            self._run.store.leases.report(self._run.lease, self._make_report(reached))
            self._free_run.confirm()
        except StoreError as error:
            # Continue the search. The next report has the progress.
            self._outage.fail(error, job=self._run.job.id)

    def keep_fits(self, found: SearchResult) -> None:
        """Keep the models of the fits so far as the front of the next reports, until the search has one."""
        self._fits = describe_fits(found)

    def _keep_stage(self, message: str, fraction: float | None = None, /) -> None:
        """Keep the phase, the completed fraction of the job and the time left for the next report."""
        now = monotonic()
        assert fraction is not None
        # Before the first epoch a search may have waited for its actors: only its speed gives the time left.
        if not message.endswith(SEARCH):
            self._left.update(fraction, now)
        self._stage = {
            "phase": message,
            "fraction": fraction,
            "seconds_left": self._left.at(now),
            **self._warnings,
        }

    def _make_report(self, reached: dict[str, Any]) -> ProgressReport:
        """Return the report of a progress, with the free run of the best model."""
        artefacts = self._free_run.write(self._front.free_run)
        progress = self._run.notes.complete({**reached, **self._stage, **self._free_run.describe()})
        return ProgressReport(progress, artefacts=artefacts)

    def _reached_before(self) -> dict[str, Any]:
        """Return the progress of earlier attempts, without their note."""
        before = {} if self._note else {**(self._run.job.progress or {})}
        before.pop("note", None)
        return {**before, **({"front": self._fits} if self._fits else {}), **self._note}

    def flush(self) -> None:
        """Store the last state. Retry while the store is unavailable, unless the job is cancelled."""
        self._stage |= {"phase": STORING, "seconds_left": None}
        while self._last is not None and (error := self._report(*self._last, False)) is not None:
            self._stop()
            self._run.pause(error)

    def _report(
        self, state: SearchState, settings: Settings, searching: bool = True
    ) -> StoreError | ClusterError | None:
        """Store the progress of the search, or after it; return the error if the store refuses it."""
        started = monotonic()
        summed = sum_searches(state)
        points, after = self._points(summed)
        reached = self._progress(state, settings)
        if searching:
            self._keep_search(state, settings, reached["evaluations_per_second"])
        report = replace(self._make_report(reached), points=points, after=after)
        try:
            if started >= self._checkpoint_at:
                blob = self._checkpoints.write(state, self.spent, self.choice)
                report = replace(report, checkpoint=blob)
            self._run.store.leases.report(self._run.lease, report)
        except (StoreError, ClusterError) as error:
            # Continue the search. The next report contains the same points.
            self._outage.fail(error, job=self._run.job.id)
            if report.checkpoint is not None:
                self._checkpoints.remember(report.checkpoint)
            self._schedule(started)
            return error
        self._outage.succeed(job=self._run.job.id)
        self._free_run.confirm()
        self._stored_points = len(summed.history) - 1
        self._schedule(started)
        if report.checkpoint is not None:
            self._checkpoints.supersede(report.checkpoint)
            if searching:
                self._run.let_others_pass()
        return None

    def _schedule(self, started: float) -> None:
        """Set the times of the next report and, if one was due, of the next checkpoint."""
        now = monotonic()
        self._report_at = now + REPORT_EVERY
        if started >= self._checkpoint_at:
            # Also after a failure: a checkpoint of thousands of islands takes long, and may fail at its end.
            self._checkpoint_at = now + max(self._run.checkpoint_every, (now - started) / CHECKPOINT_SHARE)

    def _keep_search(self, state: SearchState, settings: Settings, rate: float) -> None:
        """Keep the completed fraction, and the time left by the speed of the search."""
        assert isinstance(self._phases, IdentificationProgress)
        left, now = self._phases.report_epoch(state, settings, rate), monotonic()
        if left is not None:
            self._left.expect(left, now)
        self._stage |= {"phase": SEARCH, "seconds_left": self._left.at(now)}

    def _progress(self, searched: SearchState, settings: Settings) -> dict[str, Any]:
        state, outputs = sum_searches(searched), self._outputs
        last, generations = state.history[-1], (settings.generations + 1) * outputs - 1
        now, number = monotonic(), len(searched.earlier)
        if self._first is None or self._first[0] != number:
            self._first = number, now, state.evaluations
        _, since, before = self._first
        rate = (state.evaluations - before) / max(now - since, 1e-9)
        best = {size: error**0.5 for size, error in last.best.items()}
        return {
            "model": settings.model_class,
            "generation": last.generation,
            "generations": generations,
            "evaluations": state.evaluations,
            "evaluations_per_second": rate,
            "best_error": min((error for error in best.values() if isfinite(error)), default=None),
            "best_by_size": best,
            "islands": [least**0.5 if isfinite(least) else None for least in last.islands],
            **self._describe_search(searched, settings),
            **self._note,
        }

    def _describe_search(self, searched: SearchState, settings: Settings) -> dict[str, Any]:
        """Return the front and the last migration, as far as they are known."""
        front, migration = self._front.update(searched), describe_migration(searched, settings, self._seed)
        return {
            **({"front": front} if front else {}),
            **({} if migration is None else {"migration": migration}),
        }

    def _points(self, state: SearchState) -> tuple[tuple[Any, ...], int]:
        new = history_document(state.history[self._stored_points :])
        after = state.history[self._stored_points - 1].generation if self._stored_points else -1
        return tuple((*point[:3], tuple(point[3])) for point in new), after
