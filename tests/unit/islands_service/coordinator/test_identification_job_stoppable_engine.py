"""`StoppableEngine`: the owner of a job ends the epochs, and no step after them."""

from collections.abc import Generator
from types import SimpleNamespace
from typing import Any

import pytest

from islands.evolution.archipelago import Archipelago, Island, empty_archipelago
from islands.evolution.engine import ArchipelagoEpoch
from islands.evolution.hall_of_fame import HallOfFame
from islands.evolution.settings import Settings
from islands_service.coordinator.identification_job import StoppableEngine


def archipelago(generation: int) -> Archipelago:
    return Archipelago((Island(0, 1, generation, (), (), HallOfFame()),))


class Counting:
    """Engine that asks for a stop before every epoch, and notes whether it was closed."""

    closed = False

    def run(self, _problem: Any, start: Archipelago, stop: Any) -> Generator[ArchipelagoEpoch]:
        try:
            for generation in range(start.generation + 1, 5):
                if stop():
                    return
                yield ArchipelagoEpoch(archipelago(generation), ())
        finally:
            self.closed = True


#: A problem, of which the engine reads the settings only.
PROBLEM: Any = SimpleNamespace(settings=Settings(generations=4))


def reached(is_stopped: bool, start: Archipelago, stop: bool = False, least: int = 0) -> list[int]:
    engine = StoppableEngine(Counting(), lambda: is_stopped, lambda _: None, least)
    return [epoch.archipelago.generation for epoch in engine.run(PROBLEM, start, lambda: stop)]


@pytest.mark.parametrize(("least", "last"), [(1, 2), (3, 3), (9, 4)])
def test_search_that_continues_reaches_the_generation_that_its_owner_has_seen(least: int, last: int) -> None:
    assert reached(True, archipelago(2), least=least) == [*range(3, last + 1)]


def test_closing_the_epochs_closes_those_of_the_engine() -> None:
    counting = Counting()
    problems: list[Any] = []
    engine = StoppableEngine(counting, lambda: False, problems.append)
    epochs = engine.run(PROBLEM, empty_archipelago(1, 1), lambda: False)
    next(epochs)
    epochs.close()
    assert counting.closed
    assert problems == [PROBLEM]
