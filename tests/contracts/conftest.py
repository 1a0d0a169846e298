"""Running service for the contract tests of the REST interface: one per file, emptied before every test."""

from types import SimpleNamespace

import pytest

from islands_api.web.routes import simulations
from support.service import emptied, held, kept


@pytest.fixture(autouse=True)
def _late_simulation_server(monkeypatch):
    """Start the server of simulations, which takes seconds, with the first preview, not with their list."""
    monkeypatch.setattr(simulations, "SIMULATION_SERVER", SimpleNamespace(ensure_running=lambda: None))


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
