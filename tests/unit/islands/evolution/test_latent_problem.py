"""Search for state spaces on islands: determinism, elite, migration and storage."""

import pytest

from islands.evolution.archipelago import empty_archipelago
from islands.evolution.engine import SerialEngine
from islands.evolution.latent_problem import make_latent_problem
from islands.evolution.presets import resolve_settings
from islands.persistence.checkpoints import archipelago_from_document, checkpoint_text
from islands.progress import Steps, never_stop
from support.latent_systems import spring_record

SETTINGS = resolve_settings("latent", {"population": 6, "generations": 4, "migrate_every": 2})


@pytest.fixture(scope="module")
def problem():
    return make_latent_problem(spring_record(120, noise=0.02), SETTINGS, Steps())


@pytest.fixture(scope="module")
def archipelagos(problem):
    epochs = SerialEngine().run(problem, empty_archipelago(2, 5), never_stop)
    return [each.archipelago for each in epochs]


@pytest.mark.ci
def test_the_number_of_threads_does_not_matter(problem, archipelagos):
    evolution = problem.open(threads=1)
    island, info = evolution.first_generation(0, 5)
    assert island == archipelagos[0].islands[0]
    assert problem.open(threads=4).first_generation(0, 5) == (island, info)
    assert evolution.step(island) == problem.open(threads=3).step(island)


@pytest.mark.ci
def test_a_search_that_continues_has_the_same_islands(problem, archipelagos):
    continued = SerialEngine().run(problem, archipelagos[1], never_stop)
    assert [each.archipelago for each in continued] == archipelagos[2:]


def test_the_error_of_the_fittest_never_increases(archipelagos):
    for index in range(2):
        errors = [each.islands[index].hall_of_fame.entries for each in archipelagos]
        least = [min(entry.fitness for entry in entries) for entries in errors]
        assert least == sorted(least, reverse=True)
        assert least[-1] < least[0]


def test_a_checkpoint_has_every_number_of_the_islands(archipelagos):
    text = checkpoint_text(archipelagos[-1], {"seed": 5})
    read, about = archipelago_from_document(text, "a checkpoint")
    assert read == archipelagos[-1]
    assert about == {"seed": 5}


def test_the_model_of_an_individual_is_that_of_the_record(problem, archipelagos):
    best = min(archipelagos[-1].hall_of_fame.entries, key=lambda each: each.fitness)
    model = problem.make_model(best)
    assert model.output_name == "y_mm"
    assert (model.order, model.units) == (best.order, best.units)
