"""What the runner of a job works with."""

from collections.abc import Callable
from dataclasses import dataclass
from time import sleep
from typing import TYPE_CHECKING

from islands.progress import Stop, never_stop
from islands_service.coordinator.job_notes import JobNotes
from islands_service.domain.job import Job, Lease
from islands_service.store import Store
from islands_service.store.blobs import Blobs
from islands_service.store.datasets import StoredDataset

if TYPE_CHECKING:
    from islands.evolution.engine import Engine

#: Seconds between two attempts to write to a store that is unavailable or full.
RETRY_SECONDS = 0.5


@dataclass(frozen=True, slots=True, eq=False)
class JobRun:
    """A job that this process runs under its lease.

    Attributes
    ----------
    lease : Lease
    store : Store
    blobs : Blobs
    engine : Engine
        Engine for searches.
    check : callable
        Raises the reason if the job must end early.
    checkpoint_every : float
        Least number of seconds between two checkpoints.
    notes : JobNotes
        Messages that the progress of the job contains.
    connect : callable
        Connects this process to the Ray cluster, unless it is connected.
    is_search_stopped : callable
        Returns whether the owner has asked that the search ends with its best models.
    let_others_pass : callable
        Called after each checkpoint. Raises the reason if the job should return to the queue now.
    pause : callable
        Waits after the store has refused the result, before it is tried again.
    """

    lease: Lease
    store: Store
    blobs: Blobs
    engine: "Engine"
    check: Callable[[], None]
    checkpoint_every: float
    notes: JobNotes
    connect: Callable[[], None]
    is_search_stopped: Stop = never_stop
    let_others_pass: Callable[[], None] = lambda: None
    pause: Callable[[Exception], None] = lambda _error: sleep(RETRY_SECONDS)

    @property
    def job(self) -> Job:
        """The job at the time of the claim."""
        return self.lease.job

    def get_dataset(self, identity: str) -> StoredDataset:
        """Return a data set or the FMU of the job, which may have been deleted since its submission."""
        return self.store.datasets.get(self.job.owner, identity, deleted=True, is_fmu=None)
