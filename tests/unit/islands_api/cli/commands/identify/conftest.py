"""A folder in which ``islands identify`` runs in this process, and what happens to it there."""

import signal
from contextlib import contextmanager

import pytest

from islands.io.records import write_record
from islands_api.cli import identify_run as command
from support.identify_runs import record
from support.undrawn import undrawn_figures


@pytest.fixture
def run(request, monkeypatch, command_line):
    """Run the command in a folder that holds ``r.csv``; return exit code, standard output, standard error.

    Figures take most of a small run's time: only a test that asks for them has them.
    """
    write_record(record(), "r.csv")
    if "with_figures" not in request.fixturenames:
        monkeypatch.setattr("islands.figures.registry.FIGURES", {})
        monkeypatch.setattr("islands.figures.registry.search_figures", lambda _findings: ())

    def call(*arguments):
        code, out, err = command_line("identify", *arguments)
        return code, out, err.strip()

    return call


@pytest.fixture
def with_figures():
    """Ask for figures, whose files hold an empty picture."""
    with undrawn_figures():
        yield


@pytest.fixture
def watched(monkeypatch):
    """Do something after every epoch."""

    def by(watch):
        monkeypatch.setattr(command, "search_progress", lambda _tell: lambda state, _settings: watch(state))

    return by


@pytest.fixture
def interrupted(watched):
    """Send signals, Ctrl-C unless told otherwise, in a generation of one's choice."""

    def in_generation(chosen, *signals):
        def watch(state):
            if state.archipelago.generation == chosen:
                for number in signals or (signal.SIGINT,):
                    signal.raise_signal(number)

        watched(watch)

    return in_generation


@pytest.fixture
def engines(monkeypatch):
    """Tell which engine is asked for, at which address; all are serial ones, or what is given."""

    def table(engine):
        asked = []

        def entry(name):
            @contextmanager
            def carry_out(address, tell):
                asked.append((name, address))
                tell("[an engine] speaks")
                yield engine

            return carry_out

        monkeypatch.setattr(command, "ENGINES", {name: entry(name) for name in command.ENGINES})
        return asked

    return table
