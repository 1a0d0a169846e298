"""Functions that run the jobs of each kind."""

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Protocol

from islands_service.coordinator.job_notes import JobNotes
from islands_service.domain.job import DISCREPANCY, IDENTIFICATION, MONITORING, JobOutcome, Lease
from islands_service.store import Store
from islands_service.store.blobs import Blobs

if TYPE_CHECKING:
    from islands.evolution.engine import Engine


class JobRunner(Protocol):
    """Runs a job of one kind."""

    def __call__(
        self,
        lease: Lease,
        store: Store,
        blobs: Blobs,
        engine: "Engine",
        check: Callable[[], None],
        every: float,
        notes: JobNotes,
        /,
    ) -> JobOutcome:
        """Run a job and return its outcome.

        Parameters
        ----------
        check : callable
            Raises the reason if the job must end early.
        every : float
            Least number of seconds between two checkpoints.
        notes : JobNotes
            Messages that the progress of the job contains.
        """


def _run_identification(*arguments: Any) -> JobOutcome:
    # These imports take half a second: claim the job before them.
    from islands_service.coordinator.identification_job import run_identification_job  # noqa: PLC0415

    return run_identification_job(*arguments)


def _run_diagnosis(*arguments: Any) -> JobOutcome:
    from islands_service.coordinator.diagnosis.diagnosis_job import run_diagnosis_job  # noqa: PLC0415

    return run_diagnosis_job(*arguments)


def _run_monitoring(*arguments: Any) -> JobOutcome:
    from islands_service.coordinator.monitoring_job import run_monitoring_job  # noqa: PLC0415

    return run_monitoring_job(*arguments)


#: Runner of each kind of job.
JOB_RUNNERS: Mapping[str, JobRunner] = MappingProxyType(
    {IDENTIFICATION: _run_identification, DISCREPANCY: _run_diagnosis, MONITORING: _run_monitoring}
)
