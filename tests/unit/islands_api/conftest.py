"""A service for the tests of a file."""

import pytest


@pytest.fixture(scope="module")
def service(serve):
    with serve() as running:
        yield running
