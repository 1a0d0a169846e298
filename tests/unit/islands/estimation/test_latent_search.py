"""Search of latent models: the structure of the system, the same result every time."""

from dataclasses import replace

import numpy as np
import pytest
from islands.estimation.latent_search import search_latent_models, search_linear_models

from islands.data.dataset import Dataset
from islands.progress import Steps, StoppedError, ignore_progress, never_stop
from islands.simulation.predictors import free_run
from support.latent_systems import smooth_input, spring_record


def search(record, seed=0, stop=never_stop):
    return search_latent_models(record, seed, Steps(ignore_progress, stop))


def rmse(model, record):
    run = free_run(model, record, 100)
    return float(np.sqrt(np.mean((run.y - record.y)[100:] ** 2)))


def saturated_record(samples, seed):
    """Return a record of two lags behind a saturation of the input, with noise of 0.01."""
    u, x, y = 1.5 * smooth_input(samples, seed), np.zeros(2), np.empty(samples)
    for k in range(samples):
        y[k] = x[0]
        x = np.array([0.9 * x[0] + 0.2 * x[1], 0.7 * x[1] + 0.3 * np.clip(u[k], -1.0, 1.0)])
    return Dataset(u, y + 0.01 * np.random.default_rng(seed + 50).standard_normal(samples), 0.01)


@pytest.fixture(scope="module")
def springs():
    return search(spring_record(900, noise=0.02))


@pytest.mark.ci
def test_the_cubic_spring_is_found(springs):
    (found,) = (each for each in springs if (each.order, each.units) == (2, ("cube",)))
    assert rmse(found, spring_record(1500, noise=0.02, seed=9)) == pytest.approx(0.02, rel=0.1)
    assert "resonance at 5.1" in found.equation().plain
    # The unit reads the states, so the system is no Hammerstein system.
    assert any(name.startswith("w1") for name in found.names)


@pytest.mark.ci
def test_linear_models_are_a_front_without_units():
    found = search_linear_models(spring_record(900, noise=0.02), Steps())
    assert [each.units for each in found] == [()] * len(found)
    sizes = [each.size for each in found]
    assert sizes == sorted(sizes)
    assert found[-1].order >= 2
    assert search_linear_models(spring_record(3), Steps()) == []


@pytest.mark.nightly
def test_models_are_a_front_of_size_and_error(springs):
    sizes = [each.size for each in springs]
    assert sizes == sorted(sizes)
    assert springs[0].units == ()
    errors = [rmse(each, spring_record(1500, noise=0.02, seed=9)) for each in springs[:3]]
    assert errors == sorted(errors, reverse=True)


@pytest.mark.nightly
def test_a_saturation_of_the_input_has_units_that_read_the_input_alone():
    found = search(saturated_record(900, 1))
    best = min(found, key=lambda each: rmse(each, saturated_record(1500, 7)))
    assert rmse(best, saturated_record(1500, 7)) == pytest.approx(0.01, rel=0.15)
    assert not any(name.startswith("w") for name in best.names)


@pytest.mark.ci
@pytest.mark.parametrize(("structure", "absent"), [("wiener", "e"), ("hammerstein", "w"), ("feedback", "f")])
def test_a_structure_has_its_zeros(structure, absent):
    found = search_latent_models(saturated_record(240, 1), 0, Steps(), structure)
    assert any(each.units for each in found)
    for each in found:
        assert not any(name.startswith(absent) for name in each.names)
        assert np.isfinite(rmse(each, saturated_record(300, 7)))


@pytest.mark.ci
def test_the_same_seed_gives_the_same_models():
    record = spring_record(240, noise=0.02)
    assert search(record) == search(record)


@pytest.mark.ci
def test_a_stop_keeps_the_models_so_far():
    calls = iter(range(10_000))
    found = search(spring_record(240, noise=0.02), stop=lambda: next(calls) > 8)
    assert found
    assert all(np.isfinite(each.parameters).all() for each in found)
    with pytest.raises(StoppedError):
        search(spring_record(240, noise=0.02), stop=lambda: True)


@pytest.mark.nightly
def test_units_of_the_record_do_not_matter():
    record = spring_record(240, noise=0.02)
    scaled = replace(record, u=1e3 * record.u + 5.0, y=1e-6 * record.y - 2.0)
    models = [search(each)[0] for each in (record, scaled)]
    runs = [free_run(each, data, 60).y[60:] for each, data in zip(models, (record, scaled), strict=True)]
    assert runs[1] == pytest.approx(1e-6 * runs[0] - 2.0, abs=1e-10)


def test_a_record_that_is_too_short_has_no_models():
    assert search(spring_record(12)) == []
