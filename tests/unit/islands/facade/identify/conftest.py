"""One identification that the tests of `identify` share."""

import pytest

from support.identifications import BUDGET, identify, record, record_states


@pytest.fixture(scope="session")
def data():
    return record()


@pytest.fixture(scope="session")
def search(data):
    """Return the result of an identification and the states that it reported."""
    states = []
    return identify(data, **BUDGET, seed=5, on_epoch=record_states(states)), states


@pytest.fixture(scope="session")
def result(search):
    return search[0]


@pytest.fixture(scope="session")
def states(search):
    return search[1]
