"""Checkpoints of a discrepancy job: its fits, and the search for a formula of the residual."""

import hashlib
import json
from dataclasses import dataclass, field
from typing import Any, TextIO

import structlog

from islands.diagnosis.calibration.fit_journal import FitJournal, journal_from_document
from islands.diagnosis.result import Diagnosis
from islands.errors import ModelError
from islands.evolution.search_state import SearchState
from islands.persistence.checkpoints import (
    archipelago_from_document,
    checkpoint_text,
    compress_text,
    state_document,
    state_from_document,
)
from islands_service.coordinator.checkpoint_blobs import CheckpointBlobs

log = structlog.get_logger()

SCHEMA = "islands.diagnosis-checkpoint/1"

#: Notes in the progress and the summary of a job whose checkpoint was lost, or differs from its diagnosis.
RESTARTED = (
    "the last checkpoint was lost or damaged: the diagnosis started again, which gives the same result"
)
DIFFERENT = "the last checkpoint does not fit the diagnosis: fits in it were made again"


@dataclass(slots=True)
class DiagnosisState:
    """What a diagnosis has computed, so that it can continue.

    Attributes
    ----------
    journal : FitJournal
    residual : str
        SHA-256 of the residual for which a formula is searched; empty before this search.
    search : SearchState or None
        State of this search after its last epoch.
    spent : float
        Seconds spent until the last checkpoint.
    lost : bool
        Whether the last checkpoint was lost or damaged.
    """

    journal: FitJournal = field(default_factory=FitJournal)
    residual: str = ""
    search: SearchState | None = None
    spent: float = 0.0
    lost: bool = False

    @property
    def note(self) -> str:
        """What the owner of the job should know."""
        return RESTARTED if self.lost else DIFFERENT if self.journal.dropped else ""

    @property
    def reached(self) -> tuple[int, int]:
        """Number of fits that this process has made, and the generation of the search."""
        return self.journal.computed, -1 if self.search is None else self.search.archipelago.generation

    def begin_search(self, found: Diagnosis) -> SearchState | None:
        """Return the state from which a formula of the residual is searched for.

        It is None if the residual is not that of the checkpoint.
        """
        residual = hashlib.sha256((found.record.y - found.best.output).tobytes()).hexdigest()
        if residual != self.residual:
            self.residual, self.search = residual, None
        return self.search


class DiagnosisCheckpoints(CheckpointBlobs):
    """Checkpoints of a discrepancy job."""

    def read(self) -> DiagnosisState:
        """Return the state at the last checkpoint of the job.

        A diagnosis without its checkpoint gives the same result as one that continues.

        Raises
        ------
        JobDeclinedError, OSError, StoreError
            See `load`.
        """
        return self.load(self._parse) or DiagnosisState(lost=self._job.checkpoint is not None)

    def _parse(self, text: TextIO) -> DiagnosisState:
        document, name = json.load(text), f"the checkpoint of job {self._job.id}"
        if (document["schema"], document["job"]) != (SCHEMA, self._job.id):
            raise ModelError(f"{name} has another schema or belongs to another job")
        state = DiagnosisState(journal_from_document(document["fits"]), spent=float(document["wall_s"]))
        if (search := document["search"]) is not None:
            state.residual = str(search["residual"])
            state.search = state_from_document(*archipelago_from_document(search["state"], name))
        log.info("diagnosis continues", job=self._job.id, fits=len(document["fits"]), spent_s=state.spent)
        return state

    def write(self, state: DiagnosisState, spent: float) -> str:
        """Write a checkpoint; return its blob.

        Raises
        ------
        StorageFullError, ObjectStoreError
        """
        document: dict[str, Any] = {
            "schema": SCHEMA,
            "job": self._job.id,
            "wall_s": spent,
            "fits": state.journal.to_document(),
            "search": None,
        }
        if (search := state.search) is not None:
            text = checkpoint_text(search.archipelago, state_document(search))
            document["search"] = {"residual": state.residual, "state": text}
        return self.save([compress_text(json.dumps(document))])
