"""View of a running search: the front has at most one bounded entry per size, and migrations are named."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from islands.estimation.fitted_state_space import FittedStateSpace
from islands.evolution.archipelago import Archipelago, Island
from islands.evolution.hall_of_fame import HallOfFame
from islands.evolution.individual import AnyIndividual, Individual
from islands.evolution.problem import Problem
from islands.evolution.search_state import HistoryPoint, SearchState
from islands.evolution.settings import Settings
from islands.expressions.parsing import parse
from islands.facade.fit import fit_record
from islands.models.narx import Model, canonical_order
from islands.models.regressor import regressor
from islands.records.dataset import Dataset
from islands.simulation.predictors import free_run
from islands_service.coordinator.search_view import (
    SearchFront,
    describe_fits,
    describe_migration,
)
from islands_service.domain.free_runs import SEARCH_POINTS
from islands_service.runtime import ClusterError

RECORD = Dataset(u=np.zeros((99, 1)), y=np.zeros(99), dt=0.1, input_names=("u_V",), output_name="y_um")
PROBLEM = Problem(RECORD, Settings())


def individual(size: int, fitness: float) -> Individual:
    terms = canonical_order(
        found for lag in range(1, size + 1) if (found := regressor(parse(f"y(k-{lag})"))[1]) is not None
    )
    return Individual((), tuple(terms), (0.5,) * size, fitness)


def searched(*islands: Sequence[AnyIndividual], generation: int = 7) -> SearchState:
    halls = [HallOfFame(tuple(sorted(each, key=lambda one: (one.size, one.fitness)))) for each in islands]
    made = tuple(Island(at, 3, generation, (), (), hall) for at, hall in enumerate(halls))
    best = {each.size: each.fitness for hall in halls for each in hall.entries}
    return SearchState(Archipelago(made), history=(HistoryPoint(generation, 1, best, ()),))


def shown(state: SearchState, problem: Problem = PROBLEM) -> list[dict[str, Any]]:
    front = SearchFront()
    front.begin(problem)
    return front.update(state)


def test_front_has_the_best_model_of_each_size_that_no_smaller_one_equals() -> None:
    islands = [individual(1, 9.0), individual(2, 4.0)], [individual(2, 1.0), individual(3, 2.0)]
    assert shown(searched(*islands)) == [
        {"size": 1, "error": 3.0, "equation": "y_um(k) = 0.5*y_um(k-1)"},
        {"size": 2, "error": 1.0, "equation": "y_um(k) = 0.5*y_um(k-1) + 0.5*y_um(k-2)"},
    ]


def test_state_spaces_are_described_by_their_states_and_units(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("islands_service.coordinator.search_view._simulate", lambda *_: None)

    def system(order: int, *units: str) -> FittedStateSpace:
        free = (True,) * (order + len(units))
        return FittedStateSpace(order, 1, units, (), free, (), 16.0 / len(free) ** 2, 1.0)

    systems = [system(1), system(2), system(2, "tanh"), system(2, "tanh", "cube", "tanh")]
    assert [(each["size"], each["equation"]) for each in shown(searched(systems))] == [
        (1, "1 state, linear"),
        (2, "2 states, linear"),
        (3, "2 states with tanh"),
        (5, "2 states with cube, 2 × tanh"),
    ]


def test_free_run_is_that_of_the_smallest_model_near_the_least_error() -> None:
    rng = np.random.default_rng(1)
    signals = {"u": rng.normal(size=(900, 1)), "y": rng.normal(size=900)}
    record = replace(RECORD, **signals, segments=(900,), start=2.0)
    front = SearchFront()
    front.begin(Problem(record, Settings(), offsets=(40.0, 0.0)))
    assert front.free_run is None
    # An error of 1.1 times the least one is near it, one of 1.2 times is not.
    state = searched([individual(1, 1.2**2), individual(2, 1.09**2), individual(3, 1.0)])
    front.update(state)
    found = front.free_run
    assert found is not None
    assert found.mark == {"size": 2, "generation": 7}
    model = Model(individual(2, 1.0).regressors, (0.5, 0.5), input_names=("u_V",), output_name="y_um")
    document = found.document
    assert (document["output"], document["start"], document["dt"]) == ("y_um", 2.0, 0.1)
    measured, simulated = document["outputs"]
    assert (measured["name"], simulated["name"]) == ("measured", "free_run")
    assert len(document["rows"]) == len(simulated["minimum"]) <= SEARCH_POINTS
    expected = 40.0 + free_run(model, record).y
    # The first part is of the warm-up, which has no prediction.
    assert (simulated["minimum"][0], simulated["maximum"][0]) == (None, None)
    for part, (first, stop) in [*enumerate(pairwise([*document["rows"], 900]))][1:]:
        for found_values, values in ((measured, 40.0 + record.y), (simulated, expected)):
            least, greatest = np.fmin.reduce(values[first:stop]), np.fmax.reduce(values[first:stop])
            assert found_values["minimum"][part] == pytest.approx(least, rel=1e-5)
            assert found_values["maximum"][part] == pytest.approx(greatest, rel=1e-5)
    # The next search of a job begins without it.
    front.begin(PROBLEM)
    assert front.free_run is None


def test_the_front_of_the_fits_has_models_of_every_form_with_falling_errors() -> None:
    rng = np.random.default_rng(5)
    u, y = rng.uniform(-1.0, 1.0, (300, 1)), np.zeros(300)
    for k in range(1, 300):
        y[k] = 0.8 * y[k - 1] + 0.2 * u[k - 1, 0] ** 2
    record = Dataset(u, y + 0.001 * rng.standard_normal(300), 0.1, ("valve",), "level")
    seen = []
    fit_record(record, library="polynomial", lags=1, max_terms=3, certificate=0, on_front=seen.append)
    (linear,) = describe_fits(seen[0])
    assert linear["equation"].startswith("linear, order ")
    front = describe_fits(fit_record(record, library="polynomial", lags=1, max_terms=3).search_result)
    assert [each["size"] for each in front] == sorted({each["size"] for each in front})
    assert all(larger["error"] < smaller["error"] for smaller, larger in pairwise(front))
    assert any("valve(k-1)^2" in each["equation"] for each in front)


def test_lost_islands_leave_the_front_as_it_is() -> None:
    class Lost(tuple[Island, ...]):
        def find_best(self) -> Iterator[Individual]:
            raise ClusterError("islands were lost")

    front = SearchFront()
    front.begin(PROBLEM)
    first = front.update(searched([individual(1, 1.0)]))
    front._due = 0.0
    state = searched([individual(1, 0.25)])
    assert front.update(replace(state, archipelago=Archipelago(Lost(state.archipelago.islands)))) is first
    front._due = 0.0
    assert front.update(state)[0]["error"] == 0.5


def migration(generation: int, islands: int = 3, **changes: Any) -> dict[str, Any] | None:
    settings = Settings(**{"generations": 100, "islands": islands, "topology": "ring", **changes})
    return describe_migration(searched(*[[]] * islands, generation=generation), settings, 3)


def test_last_migration_names_the_sources_of_every_island() -> None:
    assert migration(9, migrate_every=10) is None
    for generation in (10, 15, 19):
        assert migration(generation, migrate_every=10, migrants=2) == {
            "generation": 10,
            "emigrants": 2,
            "sources": [[2], [0], [1]],
        }
