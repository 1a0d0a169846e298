"""The facade of evolution: settings in, a result out, and nothing that a library would have done better."""

from dataclasses import asdict, replace
from itertools import pairwise
from math import inf, nextafter

import numpy as np
import pytest

import islands
from islands.data.dataset import Dataset
from islands.data.split import split
from islands.errors import RecordError, SettingsError
from islands.estimation.estimation import estimate
from islands.evolution.archipelago import Archipelago, founded
from islands.evolution.engine import Epoch, SerialEngine
from islands.evolution.island import StepInfo
from islands.evolution.presets import PRESETS, settings_of
from islands.evolution.problem import problem
from islands.evolution.search import State, after, ended
from islands.identification import identify
from islands.io.checkpoints import read_checkpoint, write_checkpoint
from islands.model.library import full_set
from islands.simulation.predictors import free_run
from islands.validation.findings import Progress
from islands.validation.metrics import metrics
from islands.validation.physics import physics
from support.searches import distinct_genes

#: What the presets of our own are tuned in is set here: their numbers may change.
BUDGET = {
    "population": 30,
    "generations": 4,
    "max_terms": 5,
    "max_height": 5,
    "initial_terms": (2, 5),
    "shooting": 200,
    "elite": 0.2,
    "crossover": 0.4,
    "mutation": 1.0,
    "prune": 0.1,
    "tolerance": 1e-9,
    "outer": 0.7,
    "library": "phi-polynomial",
    "library_degree": 5,
    "library_lags": 3,
    "from_library": 0.6,
    "migrate_every": 1,
}


def record(samples=3000, seed=0, noise=2e-3, **changes):
    """Hysteresis under three sines: no library term by term, but close to some."""
    rng = np.random.default_rng(seed)
    time = np.arange(samples) * 1e-2
    u = sum(
        a * np.sin(2 * np.pi * f * time + rng.uniform(0, 6)) for a, f in ((1, 0.35), (0.6, 0.83), (0.4, 1.4))
    )
    y = np.zeros(samples)
    for k in range(2, samples):
        rise = u[k - 1] - u[k - 2]
        y[k] = y[k - 1] + 0.8 * rise - 0.35 * np.tanh(2 * y[k - 1]) * abs(rise) + 0.1 * u[k - 1] ** 2 * rise
    return Dataset(u, y + noise * rng.normal(size=samples), 1e-2, **changes)


@pytest.fixture(scope="module")
def data():
    return record()


@pytest.fixture(scope="module")
def search(data):
    """Return a search's result, and what was told of it meanwhile."""
    states = []
    return identify(data, **BUDGET, seed=5, progress=into(states)), states


@pytest.fixture(scope="module")
def result(search):
    return search[0]


@pytest.fixture(scope="module")
def states(search):
    return search[1]


def into(states):
    """Return a watcher that keeps what it sees. What it answers is nobody's business."""

    def watch(state, settings):
        assert settings.population == BUDGET["population"]
        states.append(state)
        return True

    return watch


def parameters(result):
    return [(fitted.model.regressors, fitted.model.parameters) for fitted in result.models]


# What a result says.


def test_a_result_says_what_the_search_did(result):
    search = result.findings.search
    assert search.generations == 4
    assert search.evaluations == 5 * 30
    assert sum(search.outcomes.values()) == search.evaluations
    assert 0 < search.duplicates < search.evaluations
    # Who was abandoned has a model: nobody needed to know how good it is.
    assert search.outcomes["abandoned"] > 0
    models = search.outcomes["ok"] + search.outcomes["abandoned"]
    assert search.feasible_share == models / search.evaluations > 0.5
    assert search.wall_s is None
    assert search.ended_by == "generations"


def test_a_result_holds_the_course_of_the_search(result, states):
    history = result.findings.search.history
    assert [point.generation for point in history] == [0, 1, 2, 3, 4]
    assert [point.evaluations for point in history] == [30, 60, 90, 120, 150]
    for before, behind in pairwise(history):
        assert all(behind.best[size] <= error for size, error in before.best.items())
    assert [state.archipelago.generation for state in states] == [0, 1, 2, 3, 4]
    assert [state.history for state in states] == [history[: count + 1] for count in range(5)]


def test_the_full_set_is_that_of_the_lags_and_degree_of_what_was_found(result, states):
    """Equation (5); and the memory that its matrix would take, eight bytes a number."""
    found = [item for entry in states[-1].archipelago.hall.entries for item in entry.regressors]
    lags = max(lag for item in found for _, lag in item.lags)
    full = result.findings.search.full_set
    assert full["lags"] == lags >= 2
    assert full["degree"] == max(item.degree for item in found) >= 2
    assert full["candidates"] == full_set(full["degree"], lags, lags)
    rows = 2250 - settings_of("hysteresis", BUDGET).maximum_lag
    assert full["bytes"] == 8 * rows * full["candidates"]


def test_a_result_holds_every_setting_that_determines_it(result):
    described = dict(result.findings.settings)
    expected = asdict(settings_of("hysteresis", BUDGET))
    assert {name: described[name] for name in expected} == expected
    assert (described["method"], described["preset"], described["islands"]) == ("identify", "hysteresis", 1)
    assert described["validation"] == 0.25
    assert result.findings.seed == 5
    assert result.findings.record.samples == 3000


def test_models_come_best_first_one_a_size_and_none_larger_than_asked_for(result):
    sizes = [fitted.model.size for fitted in result.models]
    assert len(set(sizes)) == len(sizes)
    assert max(sizes) <= 5
    errors = [fitted.metrics["validation"]["free_run"].rmse for fitted in result.models]
    assert errors == sorted(errors)
    assert result.best.metrics["validation"]["free_run"].mape < 0.5


def test_every_constrained_model_has_property_1_and_its_uncertainty(result):
    for fitted in result.models:
        assert fitted.physics.property_1
        assert all(error >= 0.0 for error in fitted.model.standard_errors)


@pytest.mark.parametrize("seed", [0, 1, 3])
def test_a_model_without_property_1_is_never_the_answer_under_the_constraint(data, seed):
    """The sums alone let it pass: with y(k-2) for y(k-1) two solutions run side by side, none damped."""
    states = []
    budget = {"preset": "paper-case1", "population": 30, "generations": 2, "max_terms": 4, "shooting": 100}
    short = data[:1500]
    found = identify(short, **budget, seed=seed, progress=lambda state, _settings: states.append(state))
    assert all(fitted.physics.property_1 for fitted in found.models)
    estimation = split(short, 0.25).estimation
    known = [
        estimate(entry.regressors, estimation, "hysteresis", 26).model
        for entry in states[-1].archipelago.hall.entries
    ]
    assert not all(physics(model, estimation).property_1 for model in known)


# Seeds and starts.


def test_the_same_seed_gives_the_same_models_bit_for_bit_and_another_one_others(data, result):
    again = identify(data, **BUDGET, seed=5)
    assert parameters(again) == parameters(result)
    assert again.findings.search.history == result.findings.search.history
    other = identify(data, **BUDGET, seed=6)
    assert other.findings.search.history != result.findings.search.history


@pytest.mark.parametrize("stop", [0, 2, 4])
def test_a_start_goes_on_as_if_never_stopped(data, result, states, stop, tmp_path):
    write_checkpoint(states[stop].archipelago, tmp_path / "checkpoint.json", {})
    stored = replace(states[stop], archipelago=read_checkpoint(tmp_path / "checkpoint.json")[0])
    resumed = identify(data, **BUDGET, seed=5, start=stored)
    assert parameters(resumed) == parameters(result)
    assert resumed.findings.search.history == result.findings.search.history
    assert resumed.findings.search.evaluations == result.findings.search.evaluations
    assert resumed.findings.search.outcomes == result.findings.search.outcomes
    assert resumed.findings.search.duplicates == result.findings.search.duplicates
    assert resumed.findings.search.ended_by == result.findings.search.ended_by


@pytest.mark.parametrize(
    "other",
    [
        founded(1, 5),
        founded(3, 5),
        founded(2, 6),
        Archipelago(),
        Archipelago(founded(2, 5).islands[::-1]),
        Archipelago(founded(3, 5).islands[1:]),
        Archipelago((founded(2, 5).islands[0], founded(2, 6).islands[1])),
    ],
)
def test_a_start_of_other_islands_or_another_seed_is_refused(data, other):
    with pytest.raises(SettingsError, match="the start has other islands than the settings, or another seed"):
        identify(data, **BUDGET, islands=2, seed=5, start=State(other), progress=pytest.fail)


def test_a_start_of_its_own_islands_that_nobody_lives_on_is_the_beginning(data, result):
    begun = identify(data, **BUDGET, seed=5, start=State(founded(1, 5)))
    assert parameters(begun) == parameters(result)
    assert begun.findings.search.history == result.findings.search.history


def islands_budget(**changes):
    return {**BUDGET, "population": 12, "generations": 3, "migrants": 3, "emigrants": "random", **changes}


def test_islands_evolve_beside_each_other(data):
    one, three, apart = [], [], []
    for states, changes in (
        (one, {}),
        (three, {"islands": 3}),
        (apart, {"islands": 3, "topology": "isolated"}),
    ):
        budget = islands_budget(**changes)
        result = identify(
            data[:1000], **budget, seed=5, progress=lambda state, _settings, to=states: to.append(state)
        )
        assert result.findings.settings["islands"] == len(states[0].archipelago.islands)
        assert result.findings.search.evaluations == 4 * 12 * result.findings.settings["islands"]
        for state in states:
            for place, island in enumerate(state.archipelago.islands):
                best = min(entry.fitness for entry in island.hall.entries)
                assert state.history[-1].islands[place] == best
            assert min(state.history[-1].islands) == min(state.history[-1].best.values())
    # Who receives from nobody evolves as if it were alone; nobody has left before the first epoch's end.
    assert [state.archipelago.islands[0] for state in apart] == [
        state.archipelago.islands[0] for state in one
    ]
    assert [state.archipelago for state in apart[:2]] == [state.archipelago for state in three[:2]]
    assert apart[-1].archipelago != three[-1].archipelago
    resumed = identify(data[:1000], **islands_budget(islands=3), seed=5, start=three[1])
    assert resumed.findings.search.history == three[-1].history


def test_an_epoch_ends_where_the_schedule_says_and_its_generations_are_all_told(data):
    states, longer = [], []
    for to, every in ((states, 3), (longer, "2,3:1")):
        identify(
            data[:1000],
            **{**islands_budget(), "generations": 4, "migrate_every": every, "seed": 5},
            progress=lambda state, _settings, to=to: to.append(state),
        )
    assert [state.archipelago.generation for state in states] == [0, 3, 4]
    assert [state.archipelago.generation for state in longer] == [0, 2, 3, 4]
    assert [state.history[-1].generation for state in states] == [0, 3, 4]
    assert [state.evaluations // states[0].evaluations for state in states] == [1, 4, 5]
    # A single island does not notice.
    assert states[-1].history == longer[-1].history


class Telling(SerialEngine):
    """Keeps what it yields, and knows whether it was left."""

    def __init__(self):
        self.epochs, self.left = [], False

    def run(self, problem, start, stop):
        try:
            for epoch in super().run(problem, start, stop):
                self.epochs.append(epoch)
                yield epoch
        finally:
            self.left = True


def test_another_engine_may_carry_it_out(data, result):
    engine = Telling()
    found = identify(data, **BUDGET, seed=5, engine=engine)
    assert parameters(found) == parameters(result)
    infos = [info for epoch in engine.epochs for (info,) in epoch.steps]
    assert len(infos) == 5
    search = found.findings.search
    assert search.duplicates == sum(info.duplicates for info in infos)
    assert search.outcomes["ok"] == sum(info.outcomes["ok"] for info in infos)
    assert search.caches == engine.epochs[-1].caches


# How a search ends.


def told(*best, evaluations=10):
    return StepInfo(3, evaluations, 4, {"ok": evaluations - 1, "diverged": 1}, dict(best))


def test_what_islands_did_in_a_generation_is_gathered():
    before = State(founded(2, 0), 100, 7, {"ok": 100}, (Progress(2, 100, {1: 9.0}, (9.0, inf)),))
    steps = ((told((2, 0.5), (1, 4.0)), told((1, 2.0), (2, 0.5))), (told(), told((3, 1.0), (2, 0.25))))
    state = after(before, Epoch(founded(2, 1), steps, {"pairs": (1, 2)}))
    assert state.archipelago == founded(2, 1)
    assert (state.evaluations, state.duplicates) == (140, 23)
    assert state.outcomes == {"ok": 136, "diverged": 4}
    assert state.history == (
        *before.history,
        Progress(3, 120, {1: 4.0, 2: 0.5}, (0.5, inf)),
        Progress(3, 140, {1: 2.0, 2: 0.25, 3: 1.0}, (0.5, 0.25)),
    )
    assert [list(point.best) for point in state.history] == [[1], [1, 2], [1, 2, 3]]
    assert state.caches == {"pairs": (1, 2)}
    assert before.outcomes == {"ok": 100}


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({}, ""),
        ({"generations": 7}, "generations"),
        ({"generations": 6}, "generations"),
        ({"generations": 8}, ""),
        ({"max_evaluations": 400}, "evaluations"),
        ({"max_evaluations": 399}, "evaluations"),
        ({"max_evaluations": 401}, ""),
        ({"target_error": 0.5}, "target error"),
        ({"target_error": nextafter(0.5, 1.0)}, "target error"),
        ({"target_error": nextafter(0.5, 0.0)}, ""),
        # Squares of these are no numbers.
        ({"target_error": 1e200}, "target error"),
        ({"target_error": 1.7976931348623157e308}, "target error"),
        ({"target_error": 1e-200}, ""),
        ({"target_error": 0.5, "max_evaluations": 401}, "target error"),
        ({"target_error": 0.4, "max_evaluations": 400}, "evaluations"),
        ({"target_error": 0.5, "max_evaluations": 400, "generations": 7}, "generations"),
    ],
)
def test_a_search_has_ended_when_one_of_its_budgets_is_used_up(changes, expected):
    """The error is that of the best island, in the output's unit, as it is now."""
    archipelago = Archipelago(tuple(replace(island, generation=7) for island in founded(2, 0).islands))
    history = (Progress(6, 350, {3: 0.3}, (inf, 0.3)), Progress(7, 400, {3: 0.25}, (inf, 0.25)))
    state = State(archipelago, 400, history=history)
    assert ended(state, settings_of("narx", changes)) == expected


@pytest.mark.parametrize("target", [0.0, 1.0, 1.7976931348623157e308])
def test_a_search_has_not_ended_before_anybody_has_a_model(target):
    settings = settings_of("narx", {"target_error": target, "max_evaluations": 1, "generations": 0})
    assert ended(State(founded(2, 0)), settings) == ""
    waiting = State(founded(2, 0), history=(Progress(0, 0, {}, (inf, inf)),))
    assert ended(waiting, replace(settings, generations=1)) == ""


def test_an_exact_model_meets_every_target_and_without_a_target_none():
    exact = State(founded(1, 0), history=(Progress(0, 0, {1: 0.0}, (0.0,)),))
    assert ended(exact, settings_of("narx", {"target_error": 1e-9})) == "target error"
    assert ended(exact, settings_of("narx", {"target_error": 0.0})) == ""


@pytest.mark.parametrize("budget", [1, 30, 31, 90, 91, 150, 151])
def test_a_search_ends_with_the_first_epoch_that_reaches_its_evaluations(data, states, budget):
    seen = []
    found = identify(data, **BUDGET, max_evaluations=budget, seed=5, progress=into(seen))
    last = next((place for place, state in enumerate(states) if state.evaluations >= budget), 4)
    assert seen == states[: last + 1]
    search = found.findings.search
    assert search.evaluations == states[last].evaluations
    assert search.ended_by == ("generations" if last == 4 else "evaluations")
    assert found.findings.settings["max_evaluations"] == budget


@pytest.mark.parametrize("place", range(5))
def test_a_search_ends_with_the_first_epoch_that_reaches_its_error(data, states, place):
    seen = []
    target = nextafter(min(states[place].history[-1].islands) ** 0.5, inf)
    found = identify(data, **BUDGET, target_error=target, seed=5, progress=into(seen))
    last = next(at for at, state in enumerate(states) if min(state.history[-1].islands) <= target**2)
    assert last <= place
    assert seen == states[: last + 1]
    assert found.findings.search.ended_by == ("generations" if last == 4 else "target error")
    assert found.findings.search.history == states[last].history


def test_a_budget_that_is_reached_within_an_epoch_ends_with_it(data, states):
    """Every epoch is one that a longer run has too: nobody is cut off in the middle."""
    seen = []
    changes = {**BUDGET, "migrate_every": 3, "max_evaluations": 31}
    found = identify(data, **changes, seed=5, progress=into(seen))
    assert [state.evaluations for state in seen] == [30, 120]
    assert seen[-1].history == states[3].history
    assert (found.findings.search.generations, found.findings.search.ended_by) == (3, "evaluations")


def test_a_search_that_ends_early_leaves_its_engine(data):
    engine = Telling()
    identify(data, **BUDGET, max_evaluations=60, seed=5, engine=engine)
    assert (len(engine.epochs), engine.left) == (2, True)


def test_a_search_that_fails_leaves_its_engine(data):
    def broken(_state, _settings):
        raise ZeroDivisionError

    engine = Telling()
    with pytest.raises(ZeroDivisionError) as failed:
        identify(data, **BUDGET, seed=5, engine=engine, progress=broken)
    # At once, and not when the error's trace is forgotten.
    assert (len(engine.epochs), engine.left) == (1, True), failed


def test_told_to_stop_a_search_keeps_its_last_epoch(data, states):
    seen = []
    found = identify(data, **BUDGET, seed=5, progress=into(seen), stop=lambda: len(seen) == 2)
    assert seen == states[:2]
    assert found.findings.search.ended_by == "stopped"
    assert found.findings.search.generations == 1
    assert found.findings.search.history == states[1].history


def test_told_to_stop_within_an_epoch_a_search_keeps_the_one_before(data, states):
    asked = []

    def stop():
        asked.append(True)
        return len(asked) > 6

    seen = []
    found = identify(data, **{**BUDGET, "migrate_every": 4}, seed=5, progress=into(seen), stop=stop)
    assert seen == states[:1]
    assert (found.findings.search.generations, found.findings.search.ended_by) == (0, "stopped")
    # It goes on from there as if never stopped.
    go_on = identify(data, **{**BUDGET, "migrate_every": 4}, seed=5, start=seen[-1])
    assert go_on.findings.search.history == states[-1].history


def test_told_to_stop_where_it_has_ended_anyway_a_search_has_ended(data, states):
    seen = []
    found = identify(data, **BUDGET, seed=5, progress=into(seen), stop=lambda: len(seen) == 5)
    assert seen == states
    assert found.findings.search.ended_by == "generations"


def test_stopped_before_there_is_any_model_says_so(data):
    with pytest.raises(SettingsError, match="stopped before the first populations were evaluated"):
        identify(data, **BUDGET, progress=pytest.fail, stop=lambda: True)


# Validation selects among the models.


def test_validation_may_be_a_record_of_its_own(data, result):
    parts = split(data, 0.25)
    own = identify(parts.estimation, parts.validation, **BUDGET, seed=5)
    assert parameters(own) == parameters(result)
    assert own.findings.split.validation is parts.validation
    elsewhere = identify(parts.estimation, record(seed=9), **BUDGET, seed=5)
    assert own.findings.settings["validation"] != elsewhere.findings.settings["validation"]
    assert elsewhere.findings.search.history == result.findings.search.history


def test_validation_data_never_reaches_the_search(data, result):
    """Only which models are kept, and in which order, may depend on it."""
    parts = split(data, 0.25)
    spoilt = replace(parts.validation, y=parts.validation.y[::-1].copy())
    other = identify(parts.estimation, spoilt, **BUDGET, seed=5)
    assert other.findings.search.history == result.findings.search.history
    assert other.findings.search.outcomes == result.findings.search.outcomes
    assert parameters(other) != parameters(result)


@pytest.mark.parametrize(
    ("seed", "changes"),
    # Pruned as hard as that, hardly a seed outlives the first generation: it is a candidate all the same.
    [(0, {}), (1, {}), (1, {"prune": 1.0, "tolerance": 0.05})],
)
def test_it_is_never_worse_than_the_forward_selection_that_seeds_it(seed, changes):
    """On the validation data, size for size, whatever the budget."""
    data = record(seed=seed)
    parts = split(data, 0.25)
    budget = {**BUDGET, "population": 8, "generations": 1, **changes}
    settings = settings_of("hysteresis", budget)
    found = identify(data, **budget, seed=seed)
    errors = {fitted.model.size: fitted.metrics["validation"]["free_run"].rmse for fitted in found.models}
    compared = 0
    for genes in problem(parts.estimation, settings).seeds:
        seeded = estimate(distinct_genes(genes), parts.estimation, "hysteresis", settings.maximum_lag).model
        simulated = free_run(seeded, parts.validation, settings.maximum_lag)
        if simulated.outcome and physics(seeded, parts.estimation).property_1:
            compared += 1
            assert errors[seeded.size] <= metrics(parts.validation.y, simulated.y).rmse * (1 + 1e-12)
    assert compared >= 3


def test_refinement_takes_nothing_away(data):
    """Refined models stand beside those that were estimated: validation chooses."""
    plain, refined = (identify(data, **BUDGET, seed=5, refine=refine) for refine in (False, True))
    assert plain.findings.search.history == refined.findings.search.history
    errors = {each.model.size: each.metrics["validation"]["free_run"].rmse for each in refined.models}
    for fitted in plain.models:
        assert errors[fitted.model.size] <= fitted.metrics["validation"]["free_run"].rmse
    assert min(errors.values()) < 0.999 * plain.best.metrics["validation"]["free_run"].rmse


def test_without_a_constraint_models_need_no_property_1(data):
    found = identify(data, **BUDGET, constraints="none", structure="free")
    assert any(not fitted.physics.property_1 for fitted in found.models)


def test_two_inputs_and_segments_are_identified():
    one, other = record(1200, seed=1), record(1200, seed=2)
    rng = np.random.default_rng(3)
    u2 = np.cumsum(rng.normal(size=2400)) / 50
    y = np.concatenate([one.y, other.y])
    data = Dataset(
        np.column_stack([np.concatenate([one.u, other.u])[:, 0], u2]), y, 1e-2, segments=(1200, 1200)
    )
    found = identify(data, one_record_of(seed=4), **{**BUDGET, "generations": 2})
    assert found.best.model.inputs == 2
    assert found.findings.record.segments == (1200, 1200)
    assert found.best.metrics["validation"]["free_run"].mape < 2.0


def one_record_of(seed):
    single = record(1200, seed=seed)
    u2 = np.cumsum(np.random.default_rng(seed).normal(size=1200)) / 50
    return Dataset(np.column_stack([single.u[:, 0], u2]), single.y, 1e-2)


@pytest.mark.parametrize("preset", PRESETS)
def test_every_preset_runs_on_a_small_budget(data, preset):
    found = identify(data[:1500], preset=preset, population=12, generations=1, max_terms=4)
    assert found.findings.settings["preset"] == preset
    search = found.findings.search
    assert search.evaluations == 24
    assert search.feasible_share == sum(search.outcomes.get(name, 0) for name in ("ok", "abandoned")) / 24
    assert all(fitted.model.size <= 4 for fitted in found.models)


# Messages before the search, not after it.


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"preset": "hystersis"}, "unknown preset 'hystersis': take one of paper-case1"),
        ({"populatoin": 3}, "unknown setting 'populatoin': take one of population, generations"),
        ({"population": 0}, "population is at least 1, got 0"),
        ({"generations": -1}, "generations is at least 0, got -1"),
        ({"max_terms": 0}, "max_terms is at least 1, got 0"),
        ({"max_height": -1}, "max_height is at least 0, got -1"),
        ({"shooting": 0}, "shooting is at least 1, got 0"),
        ({"primitives": ["mul", "gamma"]}, "unknown primitive 'gamma': take one of mul, sub"),
        ({"constraints": "physics"}, "unknown constraints 'physics': take one of none, hysteresis"),
        ({"islands": 0}, "islands is at least 1, got 0"),
        ({"topology": "rong"}, "unknown topology 'rong': take one of isolated, ring"),
        ({"characters": ["plain", "lazy"]}, "unknown character 'lazy': take one of plain, explorer"),
        ({"migrate_every": "5,3:2,3:1"}, "its generations ascend, from 1 on"),
        ({"islands": 4, "migrants": 301}, "301 individuals would arrive on an island of 300"),
        ({"target_error": -1.0}, "target_error is a number and not negative, got -1.0"),
        ({"seed": -1}, "a seed is not negative, got -1"),
        ({"validation": 1.5}, "the validation fraction lies between 0 and 1, got 1.5"),
    ],
)
def test_a_bad_budget_is_refused_by_name(data, changes, message):
    with pytest.raises(SettingsError, match=message):
        identify(data, progress=pytest.fail, **changes)


def test_records_that_are_too_short_are_refused_before_the_search(data):
    with pytest.raises(RecordError, match="the validation data has 20 samples: with lags down to"):
        identify(data, data[:20], progress=pytest.fail, **BUDGET)
    with pytest.raises(RecordError, match="the validation data has 25 samples"):
        identify(data[:100], progress=pytest.fail, **BUDGET)
    with pytest.raises(RecordError, match="take a longer recording"):
        identify(data[:20], data, progress=pytest.fail, **BUDGET)


def test_validation_data_of_another_system_is_refused(data):
    with pytest.raises(RecordError, match="the validation data 2"):
        identify(data, one_record_of(seed=1), progress=pytest.fail)
    with pytest.raises(RecordError, match="resample one of them"):
        identify(data, replace(data, dt=0.5), progress=pytest.fail)


def test_where_no_model_is_found_the_outcomes_say_why():
    """What grows by 5 % a sample while it is measured runs out of all bounds on a longer record."""
    u = np.random.default_rng(0).normal(size=1000)
    growing = Dataset(u[:150], 1.05 ** np.arange(150.0), 0.1)
    with pytest.raises(SettingsError, match=r"no model was found: \{'ok': 1\}; take another preset, more"):
        identify(
            growing,
            Dataset(u, np.sin(np.arange(1000.0)), 0.1),
            preset="narx",
            population=1,
            generations=0,
            max_terms=3,
            library_degree=1,
            library_lags=1,
        )


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"max_terms": 1}, {"initial_terms": (1, 1)}),
        ({"max_terms": 3}, {"initial_terms": (1, 3)}),
        ({"max_terms": 100}, {"initial_terms": (1, 10)}),
        ({"max_terms": 3, "initial_terms": (2, 2)}, {"initial_terms": (2, 2)}),
        ({"max_height": 1}, {"initial_height": 1}),
        ({"max_height": 0}, {"initial_height": 0}),
        ({"max_height": 9}, {"initial_height": 3}),
    ],
)
def test_smaller_models_begin_smaller(changes, expected):
    made = asdict(settings_of("paper-case1", changes))
    assert {name: made[name] for name in expected} == expected
    assert {name: made[name] for name in changes} == changes


def test_it_is_among_the_public_names():
    assert islands.identify is identify


def test_a_state_is_that_of_an_archipelago():
    with pytest.raises(TypeError, match="archipelago"):
        State()
