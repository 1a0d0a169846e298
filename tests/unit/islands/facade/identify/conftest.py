"""One identification for all tests of its facade."""

import pytest

from islands.facade.identify import identify
from support.identifications import BUDGET, into, record


@pytest.fixture(scope="session")
def data():
    return record()


@pytest.fixture(scope="session")
def search(data):
    """Return a search's result, and what was told of it meanwhile."""
    states = []
    return identify(data, **BUDGET, seed=5, progress=into(states)), states


@pytest.fixture(scope="session")
def result(search):
    return search[0]


@pytest.fixture(scope="session")
def states(search):
    return search[1]
