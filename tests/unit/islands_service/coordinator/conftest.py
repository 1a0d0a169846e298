"""A job in a store without Ray, and the result of the same search in one process."""

import json
from collections.abc import Callable, Iterator
from dataclasses import asdict
from pathlib import Path
from threading import Thread
from typing import Any

import pytest

from islands.evolution.engine import SerialEngine
from islands.facade.identify import identify
from islands.persistence.checkpoints import history_document
from islands.records.reading import read_record
from islands.records.reading.preview import preview
from islands.report.documents.result_folder import result_document
from islands_service.coordinator.main_loop import Coordinator
from islands_service.domain.job import Job, Submission
from islands_service.liveness import StopRequest
from islands_service.settings import ServiceSettings
from islands_service.store import Store
from islands_service.store.blobs import Blobs
from support.command_line import write_hysteresis
from support.coordinators import SerialCoordinator
from support.stores import ALICE

SETTINGS = {
    "population": 10,
    "generations": 30,
    "max_terms": 4,
    "max_height": 3,
    "shooting": 200,
    "average": 2,
    "islands": 2,
    "migrate_every": 1,
    "swap_search": False,
    "refine": False,
}
SEED = 2


@pytest.fixture(scope="module")
def record(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = write_hysteresis(tmp_path_factory.mktemp("record") / "record.csv")
    path.write_text("".join(path.read_text().splitlines(keepends=True)[:801]))
    return path


@pytest.fixture(scope="module")
def undisturbed(record: Path) -> tuple[list[Any], list[Any]]:
    """Models and history of the job in one uninterrupted process."""
    states = []
    found = identify(
        read_record(record, ["u_V"], "y_um"),
        preset="hysteresis",
        seed=SEED,
        on_epoch=lambda state, _: states.append(state),
        engine=SerialEngine(),
        **SETTINGS,
    )
    models = json.loads(json.dumps(result_document(found.search_result)["models"]))
    return models, json.loads(json.dumps(history_document(states[-1].history)))


@pytest.fixture
def settings(prepared_sqlite: Path, tmp_path: Path) -> ServiceSettings:
    (tmp_path / "islands.db").write_bytes(prepared_sqlite.read_bytes())
    return ServiceSettings(data_dir=tmp_path, lease=1.0)


@pytest.fixture
def store(settings: ServiceSettings) -> Iterator[Store]:
    with Store(settings.url) as opened:
        yield opened


@pytest.fixture
def blobs(settings: ServiceSettings) -> Blobs:
    return Blobs(settings.blobs)


@pytest.fixture
def job(store: Store, blobs: Blobs, record: Path) -> Job:
    data = record.read_bytes()
    described = asdict(preview(record))
    dataset, _ = store.datasets.add(ALICE, "record.csv", ".csv", blobs.write(data), len(data), described)
    columns = {"inputs": ["u_V"], "output": "y_um"}
    spec = {"dataset": dataset.id, **columns, "preset": "hysteresis", "seed": SEED, "settings": SETTINGS}
    return store.jobs.submit(Submission(ALICE, spec))[0]


@pytest.fixture
def coordinator(settings: ServiceSettings) -> Iterator[Callable[..., Thread]]:
    """Run a coordinator in a thread, and stop it after the test."""
    stopping = StopRequest()
    threads = []

    def run(kind: type[Coordinator] = SerialCoordinator, name: str = "me") -> Thread:
        thread = Thread(target=kind(settings, name, stopping).run)
        thread.stop = stopping.request  # type: ignore[attr-defined]
        thread.start()
        threads.append(thread)
        return thread

    yield run
    stopping.request()
    for thread in threads:
        thread.join(10.0)
        assert not thread.is_alive()
