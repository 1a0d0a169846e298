"""Comparison: every implementation is measured, and different work is refused."""

from dataclasses import asdict, replace

import pytest

from islands.errors import ModelError
from islands.export.fmu.compiler import find_compiler
from islands.models.narx import Model
from islands.simulation.predictors import multiple_shooting
from islands_measurements.speed import comparison, kernel_evaluator
from islands_measurements.speed.workload import (
    CASE1,
    INTERVAL,
    WARM_UP,
    benchmark_record,
    monomial,
    random_workload,
)


@pytest.fixture(scope="module")
def state():
    return kernel_evaluator.prepare_record(benchmark_record(3_000))


def test_kernel_error_counts_only_whole_intervals(state):
    (one,) = random_workload(monomial, 1)
    whole = state.record[: WARM_UP + 5 * INTERVAL]
    simulated = multiple_shooting(Model(one.regressors, one.theta), whole, INTERVAL, WARM_UP)
    assert state.record.samples > whole.samples
    assert kernel_evaluator.squared_error(state, one) == pytest.approx(
        simulated.mean_squared_error * 5 * INTERVAL, rel=1e-12
    )


@pytest.mark.parametrize("cached", [False, True])
@pytest.mark.parametrize("pruned", [False, True])
def test_kernel_evaluation_simulates_the_given_parameters(state, pruned, cached):
    """Estimated parameters may diverge, and a simulation that ends early would flatter the kernels."""
    (one,) = random_workload(monomial, 1)
    kernel_evaluator._evaluation(state, one, pruned, cached)()
    growing = replace(one, theta=(1.5, *one.theta[1:]))
    with pytest.raises(ModelError, match="ends early"):
        kernel_evaluator._evaluation(state, growing, pruned, cached)


def test_every_time_of_every_side_is_measured(state, tmp_path):
    fractions = []
    found = comparison.compare(random_workload(monomial, 2, terms=3), state, 1, tmp_path, fractions.append)
    assert fractions == [0.5, 1.0]
    times = asdict(found)
    without = {"c_simulation_ms", "simulation_fraction_of_c"} if find_compiler() is None else set()
    assert {name for name, time in times.items() if time is None} == without
    assert all(time > 0.0 for name, time in times.items() if name not in without)


def test_times_of_c_are_absent_without_a_compiler(state, tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path))
    found = comparison.compare(random_workload(monomial, 1, terms=2), state, 1, tmp_path, lambda _share: None)
    assert found.c_simulation_ms is None
    assert found.simulation_fraction_of_c is None
    assert found.simulation_ms > 0.0
    # Rate of one individual: three columns, six pairs, two operations per row.
    assert found.gram_flops * found.gram_ms == pytest.approx(1e3 * 2 * 6 * (3_000 - WARM_UP), rel=1e-9)


@pytest.mark.parametrize("side", ["plain numpy", "compiled C"])
def test_implementation_that_simulates_another_model_is_refused(state, tmp_path, monkeypatch, side):
    if side == "compiled C" and find_compiler() is None:
        pytest.skip("no C compiler is called cc")
    module = comparison.plain_numpy if side == "plain numpy" else comparison.compiled_c
    name = "simulate" if side == "plain numpy" else "c_source_of_model"
    right = getattr(module, name)

    def wrong(regressors, *arguments):
        return right(regressors[::-1], *arguments)

    monkeypatch.setattr(module, name, wrong)
    with pytest.raises(ModelError, match=f"{side} simulates another model"):
        comparison.compare(random_workload(monomial, 1, terms=2), state, 1, tmp_path, lambda _share: None)


@pytest.mark.parametrize(("share", "expected"), [(0.5, 3.0), (0.0, 1.0), (1.0, 5.0), (0.25, 2.0)])
def test_pruned_evaluations_count_as_often_as_a_search_prunes(monkeypatch, share, expected):
    monkeypatch.setattr(comparison, "CASE1", replace(CASE1, prune=share))
    assert comparison._evaluation(lambda pruned: 5.0 if pruned else 1.0) == expected
