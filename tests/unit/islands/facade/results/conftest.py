"""A small result, and the folder that it was saved to."""

import pytest

import islands
from support.searches import record
from support.undrawn import undrawn_figures


@pytest.fixture(scope="session")
def result():
    return islands.fit(record(200), library="polynomial", degree=1, max_terms=4, estimator="shooting")


@pytest.fixture(scope="session")
def folder(result, tmp_path_factory):
    with undrawn_figures():
        return result.save(tmp_path_factory.mktemp("result"))
