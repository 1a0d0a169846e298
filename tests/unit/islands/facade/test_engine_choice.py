"""Choice of an engine by name."""

from contextlib import contextmanager
from importlib.metadata import EntryPoint

import pytest

import islands
from islands.evolution.engine import SerialEngine
from islands.facade import engine_choice
from islands.facade.engine_choice import open_engine
from support.searches import record

OPENED = []


class CountingEngine(SerialEngine):
    """Engine that is installed by another package."""


@contextmanager
def counting_engine(address, progress, cpus):
    OPENED.append((address, cpus))
    yield CountingEngine()
    OPENED.append("closed")


@contextmanager
def engine_without_its_package(*_):
    import not_installed

    yield not_installed


@pytest.fixture
def installed(monkeypatch):
    """Register this module's engines as those of an installed package."""
    entries = [
        EntryPoint("ray", f"{__name__}:counting_engine", engine_choice.GROUP),
        EntryPoint("broken", f"{__name__}:engine_without_its_package", engine_choice.GROUP),
    ]
    loaded = {"ray": counting_engine, "broken": engine_without_its_package}
    monkeypatch.setattr(EntryPoint, "load", lambda entry: loaded[entry.name])
    monkeypatch.setattr(engine_choice, "entry_points", lambda **_: entries)
    OPENED.clear()


@pytest.mark.nightly
def test_an_engine_is_found_by_name_and_closed_after_the_search(installed):
    settings = {"preset": "narx", "population": 20, "generations": 2, "shooting": 50}
    serial = islands.identify(record(300), **settings)
    named = islands.identify(record(300), **settings, engine="ray")
    assert OPENED == [(None, None), "closed"]
    assert named.best.model == serial.best.model


@pytest.mark.parametrize(
    ("choice", "opened"),
    [(islands.Ray(cpus=2), (None, 2)), (islands.Ray(address="head:6379"), ("head:6379", None))],
)
def test_ray_passes_its_address_and_its_cores(installed, choice, opened):
    with open_engine(choice) as engine:
        assert isinstance(engine, CountingEngine)
    assert OPENED[0] == opened


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("dask", "unknown engine 'dask': take one of serial, ray, broken"),
        ("broken", "the engine 'broken' needs the package not_installed"),
    ],
)
def test_an_engine_that_is_not_installed_is_named_in_one_line(installed, name, message):
    with pytest.raises(islands.SettingsError, match=message), open_engine(name):
        pass


@pytest.mark.parametrize("arguments", [{"cpus": 0}, {"address": "head:6379", "cpus": 2}])
def test_impossible_cores_of_ray_are_refused(arguments):
    with pytest.raises(islands.SettingsError, match="core"):
        islands.Ray(**arguments)
