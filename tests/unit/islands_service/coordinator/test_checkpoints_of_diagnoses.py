"""Checkpoints of diagnoses: a job that continues gives the same bytes, and repeats no fit and no epoch."""

import gzip
import json
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import MappingProxyType, SimpleNamespace
from typing import Any

import numpy as np
import pytest
from sqlalchemy import update

from islands.diagnosis.inference import noise_floor
from islands.effects.catalogue import CATALOGUE
from islands.evolution import engine
from islands.evolution.archipelago import empty_archipelago
from islands.evolution.search_state import SearchState
from islands.facade import explain_residual
from islands_service.coordinator import diagnosis_job
from islands_service.coordinator.checkpoints import (
    DIAGNOSIS_RESTARTED,
    DIFFERENT,
    DiagnosisCheckpoints,
    DiagnosisState,
)
from islands_service.coordinator.job_failures import JobDeclinedError
from islands_service.domain.job import ISLANDS_VERSION, JobOutcome, Lease, ProgressReport
from islands_service.store import Store
from islands_service.store.blobs import Blobs
from islands_service.store.tables import jobs
from support.diagnosis_jobs import claim, run_job, submit_diagnosis, without_time
from support.stores import ALICE, claimed, submitted
from support.undrawn import undrawn_figures

#: A search of seven epochs for a formula.
SEARCH = {
    "population": 20,
    "generations": 6,
    "migrate_every": 1,
    "max_terms": 2,
    "initial_terms": (1, 2),
    "refine": False,
}


class ProcessEndedError(BaseException):
    """The process ended."""


class Work:
    """Fits and epochs of islands that were made; ends the process at the n-th of either."""

    def __init__(self, fits: int = -1, epochs: int = -1) -> None:
        self.fits = self.epochs = 0
        self._last_fit, self._last_epoch = fits, epochs

    def fit(self, function: Callable[[Any], Any], arguments: Iterable[Any]) -> Iterator[Any]:
        if not isinstance(function, partial):  # starting points and ranks of terms are found again
            yield from map(function, arguments)
            return
        for each in arguments:
            if self.fits == self._last_fit:
                raise ProcessEndedError
            self.fits += 1
            yield function(each)

    def run_epoch(self, *arguments: Any) -> Any:
        if self.epochs == self._last_epoch:
            raise ProcessEndedError
        self.epochs += 1
        return RUN_EPOCH(*arguments)


RUN_EPOCH = engine.run_epoch

#: Effects that are searched for, some of each kind of fit; a checkpoint is written after each fit.
EFFECTS = tuple(
    CATALOGUE[name] for name in ("absolute-value-sensor", "even-nonlinearity", "offset", "viscous", "delay")
)


@contextmanager
def cheap_analysis() -> Iterator[None]:
    """Shorten all parts but the fits, and write a checkpoint after each fit and each epoch."""
    with pytest.MonkeyPatch.context() as patch, undrawn_figures():
        patch.setattr(noise_floor, "RANDOM_FEATURES", 20)
        patch.setattr(noise_floor, "SURROGATES", 1)
        patch.setattr(explain_residual, "SEARCH", MappingProxyType({**explain_residual.SEARCH, **SEARCH}))
        patch.setattr(diagnosis_job, "diagnose", partial(diagnosis_job.diagnose, catalogue=EFFECTS))
        patch.setattr(diagnosis_job, "REPORT_EVERY", -1.0)
        patch.setattr(diagnosis_job, "CHECKPOINT_SHARE", 1e9)
        yield


@pytest.fixture(scope="module")
def record(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A record that no effect explains completely."""
    time = 0.01 * np.arange(400)
    u = 40 * np.sin(2 * np.pi * 1.1 * time) * np.sin(2 * np.pi * 0.3 * time + 1)
    simulated = 0.8 * u + 0.001 * u**2
    missing = 5 * np.tanh(np.r_[0, u[:-1]] * np.r_[0, 0, u[:-2]] / 200)
    y = simulated + missing + 0.1 * np.random.default_rng(8).standard_normal(time.size)
    path = tmp_path_factory.mktemp("remainder") / "record.csv"
    columns = np.column_stack([time, u, simulated, y])
    np.savetxt(path, columns, fmt="%.6f", delimiter=",", header="t_s,u_V,theirs_um,y_um", comments="")
    return path


def run(lease: Lease, store: Store, blobs: Blobs, work: Work | None = None) -> JobOutcome:
    work = work or Work()
    with cheap_analysis(), pytest.MonkeyPatch.context() as patch:
        patch.setattr(engine, "run_epoch", work.run_epoch)
        return run_job(lease, store, blobs, fits=work.fit, every=1e-9)


def comparable(outcome: JobOutcome, blobs: Blobs, job: str) -> tuple[JobOutcome, bytes]:
    """Return an outcome without its times, and its report without the id of the job."""
    artefacts = dict(outcome.artefacts)
    report = blobs.read(artefacts.pop("report.html")).replace(job.encode(), b"JOB")
    return replace(without_time(outcome), artefacts=artefacts), report


def interrupt(store: Store, blobs: Blobs, work: Work) -> Path:
    """Run a job until its process ends; return the path of its checkpoint."""
    lease = claim(store)
    with pytest.raises(ProcessEndedError):
        run(lease, store, blobs, work)
    blob = store.jobs.get(ALICE, lease.job.id).checkpoint
    assert blob is not None
    return blobs.path(blob)


@pytest.fixture(scope="module")
def undisturbed(
    prepared_sqlite: Path, tmp_path_factory: pytest.TempPathFactory, record: Path
) -> tuple[tuple[JobOutcome, bytes], Work]:
    """Outcome and work of a job that is not interrupted."""
    folder, work = tmp_path_factory.mktemp("undisturbed"), Work()
    (folder / "islands.db").write_bytes(prepared_sqlite.read_bytes())
    with Store(f"sqlite:///{folder / 'islands.db'}") as store:
        blobs = Blobs(folder / "blobs")
        job = submit_diagnosis(store, blobs, record)
        return comparable(run(claim(store), store, blobs, work), blobs, job.id), work


@pytest.mark.ci
def test_continued_diagnosis_gives_the_same_bytes_and_repeats_nothing(
    store: Store, blobs: Blobs, record: Path, undisturbed: tuple[tuple[JobOutcome, bytes], Work]
) -> None:
    expected, once = undisturbed
    assert expected[0].document is not None
    assert expected[0].document["proposal"] is not None
    job, before = submit_diagnosis(store, blobs, record), set(dict(blobs.all()))
    attempts = [Work(fits=20), Work(fits=once.fits - 21), Work(epochs=5), Work()]
    for work in attempts[:-1]:
        interrupt(store, blobs, work)
    # Blobs are named by content: report and extended simulation are equal, too.
    outcome = run(claim(store), store, blobs, attempts[-1])
    assert comparable(outcome, blobs, job.id) == expected
    assert [work.fits for work in attempts] == [20, once.fits - 21, 1, 0]
    # The second of the two islands was interrupted in its third epoch: both repeat that one.
    assert [work.epochs for work in attempts] == [0, 0, 5, once.epochs - 4]
    named = store.jobs.get(ALICE, job.id)
    assert named.versions["checkpoint"] == ISLANDS_VERSION
    # Superseded checkpoints are deleted.
    assert set(dict(blobs.all())) - before == {named.checkpoint, *outcome.artefacts.values()}


def truncate(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-40])


def swap_fits(path: Path) -> None:
    """Give the fits from the tenth on the values of others."""
    document = json.loads(gzip.decompress(path.read_bytes()))
    document["fits"][9:] = [[digest[::-1], document["fits"][0][1]] for digest, _ in document["fits"][9:]]
    path.write_bytes(gzip.compress(json.dumps(document).encode()))


@pytest.mark.ci
def test_harmed_checkpoint_costs_only_time(
    store: Store, blobs: Blobs, record: Path, undisturbed: tuple[tuple[JobOutcome, bytes], Work]
) -> None:
    expected, once = undisturbed
    job, again, last = submit_diagnosis(store, blobs, record), Work(fits=12), Work()

    def read_note() -> object:
        return (store.jobs.get(ALICE, job.id).progress or {})["note"]

    truncate(interrupt(store, blobs, Work(fits=20)))
    path = interrupt(store, blobs, again)
    assert (again.fits, read_note()) == (12, DIAGNOSIS_RESTARTED)
    swap_fits(path)
    outcome = run(claim(store), store, blobs, last)
    assert outcome.summary is not None
    assert last.fits == once.fits - 9
    assert read_note() == outcome.summary["note"] == DIFFERENT
    assert outcome.summary["words"].endswith(f"Note: {DIFFERENT}.")
    found, report = comparable(outcome, blobs, job.id)
    assert (found.document, found.artefacts, report) == (
        expected[0].document,
        expected[0].artefacts,
        expected[1],
    )


def stored(store: Store, blobs: Blobs, content: bytes | None) -> DiagnosisCheckpoints:
    """Make a job whose checkpoint has a content; None for a file that is lost."""
    lease = claimed(store)
    blob = blobs.write(content or b"")
    store.leases.report(lease, ProgressReport({}, checkpoint=blob))
    if content is None:
        blobs.path(blob).unlink()
    return DiagnosisCheckpoints(store.jobs.get(ALICE, lease.job.id), blobs)


@pytest.mark.parametrize("content", [None, b"", b"{}", b"[]", b'{"schema": 1}'])
def test_unreadable_checkpoint_is_lost(store: Store, blobs: Blobs, content: bytes | None) -> None:
    submitted(store)
    packed = content and gzip.compress(content)
    assert stored(store, blobs, packed).read().note == DIAGNOSIS_RESTARTED


def test_checkpoint_of_another_job_is_lost(store: Store, blobs: Blobs) -> None:
    job = submitted(store)
    checkpoints = DiagnosisCheckpoints(job, blobs)
    assert (checkpoints.read().note, checkpoints.read().spent) == ("", 0.0)
    own = checkpoints.write(DiagnosisState(), 7.0)
    read = stored(store, blobs, blobs.read(own)).read()
    assert (read.note, read.spent) == ("", 7.0)
    submitted(store)
    assert stored(store, blobs, blobs.read(own)).read().note == DIAGNOSIS_RESTARTED


def test_checkpoint_of_a_newer_version_is_left_to_its_coordinators(store: Store, blobs: Blobs) -> None:
    job = submitted(store)
    stored(store, blobs, b"another format")
    newer = update(jobs).values(checkpoint_version="999.0")
    store.database.write(lambda connection: connection.execute(newer))
    with pytest.raises(JobDeclinedError, match=r"islands 999\.0, which wrote the checkpoint"):
        DiagnosisCheckpoints(store.jobs.get(ALICE, job.id), blobs).read()


def test_search_continues_only_for_its_residual() -> None:
    state, searched = DiagnosisState(), SearchState(empty_archipelago(2, 0))

    def find(residual: float) -> Any:
        return SimpleNamespace(
            record=SimpleNamespace(y=np.ones(3)), best=SimpleNamespace(output=np.full(3, residual))
        )

    assert state.begin_search(find(0.5)) is None
    state.search = searched
    assert state.begin_search(find(0.5)) is searched
    assert state.begin_search(find(0.5 + 1e-15)) is None
