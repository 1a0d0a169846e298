"""Steps of a computation: a stop request ends it before a needed step and leaves out the optional ones."""

import pytest

from islands.errors import IslandsError
from islands.progress import Steps, StoppedError


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


def test_without_a_stop_function_no_step_is_left_out() -> None:
    steps = Steps()
    steps("search")
    assert not steps.skip("figures")
