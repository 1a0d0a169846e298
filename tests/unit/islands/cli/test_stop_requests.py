"""Signals: a step with results polls them, and everywhere else they end the command."""

import signal
from pathlib import Path

import pytest
import typer

from islands.cli.stop_requests import Terminated, raise_on_signals, stop_requests
from islands.progress import StoppedError


@pytest.fixture(autouse=True)
def default_interrupt():
    """Interrupts are handled as in a terminal, even if the tests run in the background of a shell."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


BOTH = pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 0)])
def test_stopped_command_with_a_result_names_what_was_left_out(
    number: signal.Signals, code: int, capsys: pytest.CaptureFixture[str]
) -> None:
    with stop_requests() as stop:
        assert not stop()
        stop.end(Path("out"), ["figures"], "repeat it")  # no effect without a request
        signal.raise_signal(number)
        assert stop()
    with pytest.raises(typer.Exit) as ended:
        stop.end(Path("out"), ["refinement", "figures"], "repeat it")
    assert ended.value.exit_code == code
    said = "stopped: out has the result so far, without refinement, figures; repeat it\n"
    assert capsys.readouterr().err == said


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_stopped_command_without_a_result_says_so(
    number: signal.Signals, code: int, capsys: pytest.CaptureFixture[str]
) -> None:
    def search() -> None:
        signal.raise_signal(number)
        raise StoppedError("first populations")

    with pytest.raises(typer.Exit) as ended, stop_requests():
        search()
    assert ended.value.exit_code == code
    said = "stopped before this step: first populations; there is no result to keep\n"
    assert capsys.readouterr().err == said


def test_limit_without_a_signal_is_an_error_of_the_command() -> None:
    with pytest.raises(StoppedError), stop_requests():
        raise StoppedError("first populations")


def test_second_ctrl_c_ends_at_once_and_a_second_sigterm_does_not() -> None:
    with stop_requests():
        signal.raise_signal(signal.SIGTERM)
        signal.raise_signal(signal.SIGTERM)
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)


@BOTH
def test_signal_outside_of_such_steps_raises(number: signal.Signals) -> None:
    before = signal.getsignal(number)
    with raise_on_signals():
        with pytest.raises(Terminated if number == signal.SIGTERM else KeyboardInterrupt):
            signal.raise_signal(number)
        # Python ignores an exception in a callback of an import: the signal still ends the next step.
        with stop_requests() as stop:
            assert stop()
    assert signal.getsignal(number) is before
    with stop_requests() as stop:
        assert not stop()


@BOTH
def test_signal_that_the_parent_process_ignores_is_ignored(number: signal.Signals) -> None:
    before = signal.signal(number, signal.SIG_IGN)
    try:
        with raise_on_signals():
            signal.raise_signal(number)
    finally:
        signal.signal(number, before)
