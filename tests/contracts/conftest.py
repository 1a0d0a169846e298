"""Running service for the contract tests of the REST interface: one per file, emptied before every test."""

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
