"""A running service for the contracts of its doors: one a file, emptied before every test."""

import shutil

import pytest

from support.service import emptied, held, kept, served


@pytest.fixture(scope="module")
def shared(tmp_path_factory, prepared_sqlite):
    folder = tmp_path_factory.mktemp("service")
    shutil.copyfile(prepared_sqlite, folder / "islands.db")
    with served(folder) as running:
        yield running


@pytest.fixture
def service(shared):
    return emptied(shared)


@pytest.fixture
def order(service):
    return held(kept(service.store))
