"""Steps of a computation: a stop request ends it before a needed step and leaves out the optional ones."""

import pytest

from islands.errors import IslandsError
from islands.progress import (
    Failure,
    Phase,
    PhasedProgress,
    Steps,
    StoppedError,
    TimeLeft,
    TimeLimit,
    attempt,
    report_part,
)


def test_needed_steps_are_reported_until_a_stop_is_requested() -> None:
    reported, requests = [], []
    steps = Steps(lambda message, fraction=None: reported.append((message, fraction)), lambda: bool(requests))
    steps("reading", 0.25)
    steps.check("reading")
    requests.append("stop")
    with pytest.raises(StoppedError, match="stopped before this step: search") as stopped:
        steps("search")
    assert reported == [("reading", 0.25)]
    assert stopped.value.step == "search"
    with pytest.raises(StoppedError, match="search"):
        steps.check("search")
    assert issubclass(StoppedError, IslandsError)


def test_optional_steps_are_left_out_in_their_order_and_named_once() -> None:
    requests: list[str] = []
    steps = Steps(stop=lambda: bool(requests))
    assert not steps.skip("refinement")
    assert steps.left_out == ()
    requests.append("stop")
    assert [steps.skip(name) for name in ("refinement", "figures", "refinement")] == [True] * 3
    assert steps.left_out == ("refinement", "figures")


PHASES = (Phase("read", 1.0), Phase("trial of", 2.0, 4), Phase("search", 4.0), Phase("assess", 1.0))


def phased(phases: tuple[Phase, ...] = PHASES) -> tuple[PhasedProgress, list[tuple[str, float]]]:
    reported: list[tuple[str, float]] = []
    return PhasedProgress(
        lambda message, fraction=None: reported.append((message, fraction)), phases
    ), reported


def test_fractions_are_those_of_the_whole_by_the_shares_of_the_phases() -> None:
    progress, reported = phased()
    for message, fraction in (("reading", None), ("trial of a", None), ("search", 0.5), ("assess", None)):
        progress(message, fraction)
    assert [fraction for _, fraction in reported] == pytest.approx([0.0, 1 / 8, 5 / 8, 7 / 8])


def test_messages_and_calls_of_a_phase_increase_the_fraction() -> None:
    progress, reported = phased()
    progress("trial of a")
    progress("trial of b")
    assert reported[-1][1] == pytest.approx(0.5 / 7)
    assert list(progress.count(map)(abs, [-1, -2])) == [1, 2]
    assert [fraction for _, fraction in reported[-2:]] == pytest.approx([0.75 / 7, 1 / 7])
    progress("a message of no phase", 0.1)
    progress("reading again", 0.0)
    progress("search: first of four", 0.25)
    progress("search: second of four", 0.5)
    assert reported[-1][1] == pytest.approx(4 / 7)
    progress("search", 0.2)
    fractions = [fraction for _, fraction in reported]
    assert fractions == sorted(fractions)
    for _ in range(20):
        list(progress.count(map)(abs, [1]))
    assert reported[-1][1] == pytest.approx(6 / 7)


def test_a_part_of_a_computation_takes_it_from_one_fraction_to_another() -> None:
    reported: list[float | None] = []
    report = report_part(lambda _, fraction=None: reported.append(fraction), 0.6, 0.8)
    report("begins", 0.0)
    report("unknown")
    report("ends", 1.0)
    assert reported == pytest.approx([0.6, None, 0.8])


def test_time_left_decreases_between_reports_until_it_is_unknown() -> None:
    left = TimeLeft(100.0)
    left.update(0.5, 100.4)
    assert left.at(100.5) is None  # in the first moments
    left.update(0.6, 106.0)
    assert [left.at(now) for now in (106.0, 107.0, 109.0, 109.1)] == pytest.approx([4.0, 3.0, 1.0, None])
    left.update(0.6, 110.0)
    assert left.at(110.0) is None  # the same fraction is no progress
    left.update(0.8, 120.0)
    assert left.at(120.0) == pytest.approx(5.0)


def test_parts_of_a_computation_share_the_time_that_is_left() -> None:
    now, requests = [0.0], []
    limit = TimeLimit(9.0, lambda: now[0], lambda: bool(requests))
    first = limit.share(3)
    assert not first()
    now[0] = 3.0
    assert (first(), limit()) == (True, False)
    now[0] = 5.0  # the first part ended late
    second = limit.share(2)
    now[0] = 6.9
    assert not second()
    now[0] = 7.0
    assert (second(), limit()) == (True, False)
    requests.append("stop")
    assert limit()
    assert limit.share(1)()


def test_an_error_of_the_caller_ends_the_computation() -> None:
    asked: list[int] = []

    def stop() -> bool:
        asked.append(1)
        if len(asked) > 1:
            raise ZeroDivisionError("the caller ends the job")
        return False

    steps = Steps(stop=stop)
    with pytest.raises(ZeroDivisionError):
        steps.attempt("step", steps.stop)
    assert not steps.not_computed


def test_a_stop_within_an_optional_step_leaves_it_out() -> None:
    def compute() -> None:
        raise StoppedError("step")

    steps = Steps()
    assert steps.attempt("step", compute) is None
    assert steps.left_out == ("step",)
    assert not steps.not_computed


def test_an_optional_step_that_fails_is_recorded_with_its_reason_and_place() -> None:
    steps = Steps()
    assert steps.attempt("ratio", lambda: 1 // 0) is None
    assert steps.not_computed["ratio"].startswith("ZeroDivisionError: ")
    assert "(test_progress.py, line" in steps.not_computed["ratio"]
    assert steps.attempt("next", lambda: 7) == 7
    assert steps.left_out == ()


def test_the_reason_of_a_deliberate_error_is_its_message() -> None:
    def refuse() -> None:
        raise IslandsError("give a longer record")

    assert attempt(refuse) == Failure("give a longer record")
