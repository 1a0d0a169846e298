"""A running service for the contracts of its doors: one a file, emptied before every test."""

import pytest

from support.service import emptied, held, kept


@pytest.fixture(scope="module")
def shared(serve):
    with serve() as running:
        yield running


@pytest.fixture
def service(shared):
    return emptied(shared)


@pytest.fixture
def order(service):
    return held(kept(service.store))
