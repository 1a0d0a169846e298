"""Fixtures that run ``islands identify`` in this process, interrupt it and replace its engines."""

import signal
from contextlib import contextmanager

import pytest

from islands.cli.runs import identify as command
from islands.records.writer import write_record
from support.identify_runs import record
from support.undrawn import undrawn_figures


@pytest.fixture
def run(request, monkeypatch, command_line):
    """Run the command in a folder with ``r.csv``; return exit code, standard output, standard error.

    Figures are written only for tests that use ``with_figures``: they take most of the time of a small run.
    """
    write_record(record(), "r.csv")
    if "with_figures" not in request.fixturenames:
        monkeypatch.setattr("islands.report.figures.registry.model_figures", lambda _found, _model: ())
        monkeypatch.setattr("islands.report.figures.registry.search_figures", lambda _findings: ())

    def call(*arguments):
        code, out, err = command_line("identify", *arguments)
        return code, out, err.strip()

    return call


@pytest.fixture
def with_figures():
    """Write figures, as empty pictures."""
    with undrawn_figures():
        yield


@pytest.fixture
def watched(monkeypatch):
    """Return a function that registers an action to be run after each epoch."""

    def by(watch):
        monkeypatch.setattr(command.SearchDisplay, "show_epoch", lambda _, state, _settings: watch(state))

    return by


@pytest.fixture
def interrupted(watched):
    """Return a function that registers signals, Ctrl-C by default, to be sent in a generation."""

    def in_generation(chosen, *signals):
        def watch(state):
            if state.archipelago.generation == chosen:
                for number in signals or (signal.SIGINT,):
                    signal.raise_signal(number)

        watched(watch)

    return in_generation


@pytest.fixture
def engines(monkeypatch):
    """Return a function that replaces all engines by one and returns what was requested of `start_engine`."""

    def table(engine):
        requested = []

        @contextmanager
        def start(name, address, islands, tell):
            requested.append((name, address, islands))
            tell("[an engine] message")
            yield engine

        monkeypatch.setattr(command, "start_engine", start)
        return requested

    return table
