"""Progress of a diagnosis: its phase, the completed fraction, the time left, and its checkpoints."""

from collections.abc import Callable, Iterable, Iterator
from time import monotonic
from typing import TypeVar

from islands.evolution.search_state import SearchState
from islands.evolution.settings import Settings
from islands.parallel import ParallelMap
from islands_service.coordinator.checkpoint_blobs import CHECKPOINT_SHARE
from islands_service.coordinator.diagnosis.checkpoints import DiagnosisCheckpoints, DiagnosisState
from islands_service.coordinator.job_run import JobRun
from islands_service.domain.job import ProgressReport
from islands_service.outage_log import OutageLog
from islands_service.store.database import StoreError

#: Seconds between two reports within a step.
REPORT_EVERY = 0.5

#: Fraction of a diagnosis that the fits of a step take.
STEP = 0.2

#: Fraction of a diagnosis that the search for a formula takes.
SEARCH = 0.03

#: Fraction from which the time left is estimated.
MIN_FRACTION = 0.05

A = TypeVar("A")
R = TypeVar("R")


class DiagnosisProgress:
    """Progress callback that stores progress and checkpoints of a diagnosis.

    Parameters
    ----------
    run : JobRun
        Its check is called at the start of each step.
    checkpoints : DiagnosisCheckpoints
    state : DiagnosisState
        What the diagnosis has computed; read for each checkpoint.
    """

    def __init__(self, run: JobRun, checkpoints: DiagnosisCheckpoints, state: DiagnosisState) -> None:
        self._run, self._checkpoints, self._state = run, checkpoints, state
        self._reported_at = self._checkpoint_at = monotonic()
        self._started_at = self._reported_at - state.spent
        self._stored = state.reached
        self._phase, self._begin = "", 0.0
        self._report_outage = OutageLog("report failed", "reports stored again")
        self._checkpoint_outage = OutageLog("no checkpoint", "checkpoints stored again")

    @property
    def spent(self) -> float:
        """Seconds spent on the job, over all attempts."""
        return monotonic() - self._started_at

    def __call__(self, message: str, fraction: float | None = None, /) -> None:
        """Store the start of a step."""
        self._run.check()
        self._phase = message
        self._begin = self._begin if fraction is None else fraction
        self._report(self._begin)

    def count(self, parallel_map: ParallelMap) -> ParallelMap:
        """Return a map that reports how many of its calls have ended, as a part of the current step."""

        def counted_map(function: Callable[[A], R], arguments: Iterable[A], /) -> Iterator[R]:
            listed = list(arguments)
            for ended, result in enumerate(parallel_map(function, listed), start=1):
                yield result
                if monotonic() - self._reported_at > REPORT_EVERY:
                    self._report(min(1.0, self._begin + STEP * ended / len(listed)))

        return counted_map

    def count_epochs(self, state: SearchState, settings: Settings) -> None:
        """Store the state of the search for a formula, as a part of the current step; called every epoch."""
        self._run.check()
        self._state.search = state
        if monotonic() - self._reported_at > REPORT_EVERY:
            self._report(self._begin + SEARCH * state.archipelago.generation / settings.generations)

    def _report(self, fraction: float) -> None:
        began = self._reported_at = monotonic()
        left = self.spent * (1.0 - fraction) / fraction if fraction >= MIN_FRACTION else None
        progress = {"phase": self._phase, "fraction": fraction, "seconds_left": left}
        if self._state.note:
            progress["note"] = self._state.note
        reached = self._state.reached
        checkpoint = (
            self._write_checkpoint() if began >= self._checkpoint_at and reached != self._stored else None
        )
        try:
            self._run.store.leases.report(self._run.lease, ProgressReport(progress, checkpoint=checkpoint))
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
