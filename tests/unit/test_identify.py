"""The facade of evolution: settings in, a result out, and nothing that a library would have done better."""

from dataclasses import asdict, replace
from itertools import pairwise

import numpy as np
import pytest
from searches import distinct_genes

import islands
from islands.data.dataset import Dataset
from islands.data.split import split
from islands.errors import RecordError, SettingsError
from islands.estimation.estimation import estimate
from islands.evolution.archipelago import Archipelago
from islands.evolution.engine import SerialEngine
from islands.evolution.presets import PRESETS
from islands.evolution.problem import problem
from islands.identify import State, identify, settings_of
from islands.io.checkpoints import read_checkpoint, write_checkpoint
from islands.model.library import full_set
from islands.simulation.predictors import free_run
from islands.validation.metrics import metrics
from islands.validation.physics import physics

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
def states():
    return []


@pytest.fixture(scope="module")
def result(data, states):
    return identify(data, **BUDGET, seed=5, progress=lambda state, _settings: states.append(state))


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


def test_a_result_holds_the_course_of_the_search(result, states):
    history = result.findings.search.history
    assert [point.generation for point in history] == [0, 1, 2, 3, 4]
    assert [point.evaluations for point in history] == [30, 60, 90, 120, 150]
    for before, after in pairwise(history):
        assert all(after.best[size] <= error for size, error in before.best.items())
    assert [state.archipelago.epoch for state in states] == [0, 1, 2, 3, 4]
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


def test_a_watcher_that_says_so_ends_the_search_there(data, states):
    seen = []

    def watch(state, settings):
        seen.append((state.archipelago.epoch, settings.generations))
        return state.archipelago.epoch == 1

    stopped = identify(data, **BUDGET, seed=5, progress=watch)
    assert seen == [(0, 4), (1, 4)]
    assert stopped.findings.search.generations == 1
    assert stopped.findings.search.history == states[1].history


def test_islands_evolve_beside_each_other(data, result, states):
    found = []
    both = identify(
        data, **BUDGET, seed=5, islands=2, progress=lambda state, _settings: found.append(state.archipelago)
    )
    assert both.findings.settings["islands"] == 2
    assert both.findings.search.evaluations == 2 * result.findings.search.evaluations
    assert [archipelago.islands[0] for archipelago in found] == [
        state.archipelago.islands[0] for state in states
    ]
    resumed = identify(data, **BUDGET, seed=5, start=State(found[3]))
    assert resumed.findings.settings["islands"] == 2
    assert parameters(resumed) == parameters(both)


def test_another_engine_may_carry_it_out(data, result):
    class Telling(SerialEngine):
        infos = ()

        def run(self, problem, seed, islands, start):
            for epoch in super().run(problem, seed, islands, start):
                self.infos = (*self.infos, epoch.info)
                yield epoch

    engine = Telling()
    found = identify(data, **BUDGET, seed=5, engine=engine)
    assert parameters(found) == parameters(result)
    assert len(engine.infos) == 5
    search = found.findings.search
    assert search.duplicates == sum(info.duplicates for info in engine.infos)
    assert search.outcomes["ok"] == sum(info.outcomes["ok"] for info in engine.infos)


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
        ({"islands": 0}, "there is at least one island, got 0"),
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
    assert State().archipelago == Archipelago()
