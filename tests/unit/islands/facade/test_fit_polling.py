"""Stop functions: every computation calls them often enough to end within two seconds."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from itertools import pairwise
from time import process_time

import pytest

import islands
from islands.progress import Stop, StoppedError
from islands.records.coupled import CoupledRecord
from islands.records.dataset import Dataset
from islands.systems.catalogue import make_record
from support.levels import nightly_but

#: Seconds of CPU between two calls. Two seconds are promised; slower machines and the saving need the rest.
LONGEST = 1.0

SEARCH = {"population": 40, "generations": 4, "max_terms": 4, "initial_terms": (1, 4), "max_height": 4}


@cache
def record(samples: int) -> Dataset:
    whole = make_record("bouc-wen-piezo", "authors", "estimation")
    return Dataset(whole.u[:samples], whole.y[:samples], whole.dt)


def both(samples: int) -> CoupledRecord:
    one = record(samples)
    return CoupledRecord((one, replace(one, y=0.5 * one.y[::-1], output_name="other")))


#: Computations with a stop function.
RUNS: dict[str, Callable[[int, Stop], object]] = {
    "fit": lambda samples, stop: islands.fit(record(samples), stop=stop),
    "identify": lambda samples, stop: islands.identify(record(samples), stop=stop, **SEARCH),
    "fit of several outputs": lambda samples, stop: islands.fit(both(samples), max_terms=4, stop=stop),
    "identify of several outputs": lambda samples, stop: islands.identify(both(samples), stop=stop, **SEARCH),
}


@pytest.mark.ci
@pytest.mark.parametrize("name", nightly_but(("fit", "identify of several outputs"), RUNS))
def test_stop_function_is_called_at_least_every_second(name: str) -> None:
    record(3000)  # the simulation of the record is no part of the computation
    calls = [process_time()]

    def stop() -> bool:
        calls.append(process_time())
        return False

    RUNS[name](3000, stop)
    calls.append(process_time())
    gaps = [after - before for before, after in pairwise(calls)]
    assert max(gaps) < LONGEST


def test_search_that_is_stopped_before_its_first_step_has_no_result() -> None:
    for run in RUNS.values():
        with pytest.raises(StoppedError):
            run(400, lambda: True)
