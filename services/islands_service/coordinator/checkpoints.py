"""Checkpoints of jobs as blobs: written, read, and deleted when they are superseded."""

import gzip
import hashlib
import json
import zlib
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Any, TextIO, TypeVar

import structlog

from islands.diagnosis.calibration.fit_journal import FitJournal, journal_from_document
from islands.diagnosis.result import Diagnosis
from islands.errors import IslandsError, ModelError
from islands.evolution.search_state import SearchState
from islands.facade.automatic.choice import Choice, choice_from_document
from islands.persistence.checkpoints import (
    archipelago_from_document,
    checkpoint_text,
    compress_text,
    compressed_checkpoint,
    read_archipelago,
    state_document,
    state_from_document,
)
from islands_service.coordinator.job_failures import check_readable
from islands_service.domain.job import Job
from islands_service.runtime.packed_epoch import pack_islands
from islands_service.store.blobs import BlobNotFoundError, Blobs
from islands_service.store.database import StoreError

log = structlog.get_logger()

#: Largest fraction of a run that checkpoints may take: one of a thousand islands takes half a minute.
CHECKPOINT_SHARE = 0.05

#: Errors of a lost or damaged checkpoint. Other errors of the operating system may pass.
_LOSS_ERRORS = (
    *(BlobNotFoundError, FileNotFoundError, gzip.BadGzipFile, EOFError, zlib.error),
    *(IslandsError, KeyError, TypeError, ValueError),
)

T = TypeVar("T")

#: Note in the progress and the summary of a job whose checkpoint was lost.
SEARCH_RESTARTED = (
    "the last checkpoint was lost or damaged: the search started again, which gives the same result"
)

#: Tag of the checkpoints of diagnoses.
SCHEMA = "islands.diagnosis-checkpoint/1"

#: Notes in the progress and the summary of a job whose checkpoint was lost, or differs from its diagnosis.
DIAGNOSIS_RESTARTED = (
    "the last checkpoint was lost or damaged: the diagnosis started again, which gives the same result"
)
DIFFERENT = "the last checkpoint does not fit the diagnosis: fits in it were made again"


class CheckpointBlobs:
    """Blobs of the checkpoints of a job while this process has its lease.

    Parameters
    ----------
    job : Job
        The job at the time of the claim.
    blobs : Blobs
    """

    def __init__(self, job: Job, blobs: Blobs) -> None:
        self._job, self._blobs = job, blobs
        # Blobs that the job named, or may have named, before its current checkpoint.
        self._earlier = set() if job.checkpoint is None else {job.checkpoint}

    def load(self, parse: Callable[[TextIO], T]) -> T | None:
        """Return the parsed text of the last checkpoint of the job; None if it is lost or damaged.

        Parameters
        ----------
        parse : callable
            Raises an `IslandsError`, KeyError, TypeError or ValueError if the text is no checkpoint of the
            job.

        Raises
        ------
        JobDeclinedError
            A newer version of islands wrote the checkpoint, and this one cannot read it.
        OSError, StoreError
            The file cannot be read now.
        """
        job = self._job
        if job.checkpoint is None:
            return None
        try:
            # Unlike `gzip.decompress`, the time of this is linear in the number of members.
            with (
                self._blobs.open(job.checkpoint) as stream,
                gzip.open(stream, "rt", encoding="utf-8") as text,
            ):
                return parse(text)
        except StoreError:
            raise
        except _LOSS_ERRORS as error:
            check_readable(job.versions["checkpoint"], "checkpoint", error)
            log.error("checkpoint lost", job=job.id, reason=str(error))
            return None

    def save(self, parts: Iterable[bytes]) -> str:
        """Write a checkpoint; return its blob.

        Parameters
        ----------
        parts : iterable of bytes
            Parts of a gzip file.

        Raises
        ------
        StorageFullError, ObjectStoreError
        """
        with self._blobs.receiving() as stream:
            stream.writelines(parts)
            return self._blobs.keep(stream)

    def remember(self, blob: str) -> None:
        """Remember a blob of which it is unknown whether the job names it."""
        self._earlier.add(blob)

    def supersede(self, blob: str) -> None:
        """Delete the earlier checkpoints after the job durably names a new one.

        The lease was valid then, so that any later reader of the job finds the new one.
        """
        for earlier in self._earlier - {blob}:
            self._blobs.discard(earlier)
        self._earlier = {blob}


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
        return self.load(self._parse) or JobStart(note=SEARCH_RESTARTED if self._job.checkpoint else "")

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
            "choice": None if choice is None else choice.to_checkpoint(),
            **state_document(state),
        }
        return self.save(compressed_checkpoint(state.archipelago, about))


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
        return DIAGNOSIS_RESTARTED if self.lost else DIFFERENT if self.journal.dropped else ""

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
