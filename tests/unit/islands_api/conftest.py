"""A service for the tests of a file."""

import shutil

import pytest

from support.service import served


@pytest.fixture(scope="module")
def service(tmp_path_factory, prepared_sqlite):
    folder = tmp_path_factory.mktemp("service")
    shutil.copyfile(prepared_sqlite, folder / "islands.db")
    with served(folder) as running:
        yield running
