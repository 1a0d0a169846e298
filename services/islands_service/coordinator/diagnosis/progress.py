"""Progress of a diagnosis: its phase, the completed fraction, the time left, and its checkpoints."""

from time import monotonic

from islands.diagnosis.procedure import LEAST_FRACTION
from islands.evolution.search_state import SearchState
from islands.evolution.settings import Settings
from islands.facade.explain_residual import BEFORE_FORMULA, FormulaProgress
from islands.progress import TimeLeft
from islands_service.coordinator.checkpoint_blobs import CHECKPOINT_SHARE
from islands_service.coordinator.diagnosis.checkpoints import DiagnosisCheckpoints, DiagnosisState
from islands_service.coordinator.job_run import JobRun
from islands_service.domain.job import ProgressReport
from islands_service.outage_log import OutageLog
from islands_service.store.database import StoreError

#: Seconds between two reports within a step.
REPORT_EVERY = 0.5


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
