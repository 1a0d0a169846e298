"""Checkpoints of an identification job."""

from dataclasses import dataclass
from typing import Any, TextIO

from islands.evolution.search_state import SearchState
from islands.facade.automatic.kind_choice import Choice, choice_from_document
from islands.persistence.checkpoints import (
    compressed_checkpoint,
    read_archipelago,
    state_document,
    state_from_document,
)
from islands_service.coordinator.checkpoint_blobs import CheckpointBlobs
from islands_service.runtime.packed_epoch import pack_islands

#: Note in the progress and the summary of a job whose checkpoint was lost.
RESTARTED = "the last checkpoint was lost or damaged: the search started again, which gives the same result"


@dataclass(frozen=True, slots=True)
class JobStart:
    """Where a search starts.

    Attributes
    ----------
    state : SearchState or None
        State at the last checkpoint; None if the search starts from the beginning.
    spent : float
        Seconds spent until then.
    choice : Choice or None
        Choice of the preset auto.
    note : str
        What the owner of the job should know.
    """

    state: SearchState | None = None
    spent: float = 0.0
    choice: Choice | None = None
    note: str = ""


class JobCheckpoints(CheckpointBlobs):
    """Checkpoints of an identification job."""

    def read(self) -> JobStart:
        """Return the state at the last checkpoint of the job.

        A search without its checkpoint gives the same result as one that continues. Therefore a lost
        checkpoint costs only time.

        Raises
        ------
        JobDeclinedError, OSError, StoreError
            See `load`.
        """
        return self.load(self._parse) or JobStart(note=RESTARTED if self._job.checkpoint else "")

    def _parse(self, text: TextIO) -> JobStart:
        # Packed islands take a tenth of the memory.
        name = f"the checkpoint of job {self._job.id}"
        archipelago, about = read_archipelago(text, name, keep=pack_islands)
        choice = choice_from_document(about["choice"]) if about.get("choice") else None
        return JobStart(state_from_document(archipelago, about), float(about["wall_s"]), choice)

    def write(self, state: SearchState, spent: float, choice: Choice | None) -> str:
        """Write a checkpoint; return its blob.

        Raises
        ------
        StorageFullError, ObjectStoreError
        ClusterError
            Islands that are not in this process were lost.
        """
        about: dict[str, Any] = {
            "job": self._job.id,
            "wall_s": spent,
            "choice": None if choice is None else choice.to_document(),
            **state_document(state),
        }
        return self.save(compressed_checkpoint(state.archipelago, about))
