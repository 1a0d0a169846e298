"""Search for state spaces on islands: determinism, elite, migration and storage."""

import pytest

from islands.estimation.fitted_state_space import FittedStateSpace
from islands.evolution.archipelago import empty_archipelago
from islands.evolution.engine import SerialEngine
from islands.evolution.hall_of_fame import HallOfFame, with_entries
from islands.evolution.latent_problem import make_latent_problem, select_latent_elite
from islands.evolution.presets import resolve_settings
from islands.persistence.checkpoints import archipelago_from_document, checkpoint_text
from islands.progress import Steps, never_stop
from support.latent_systems import spring_record

SETTINGS = resolve_settings("latent", {"population": 6, "generations": 4, "migrate_every": 2})


@pytest.fixture(scope="module")
def problem():
    return make_latent_problem(spring_record(240, noise=0.02), SETTINGS, Steps())


@pytest.fixture(scope="module")
def archipelagos(problem):
    epochs = SerialEngine().run(problem, empty_archipelago(2, 5), never_stop)
    return [each.archipelago for each in epochs]


def make_system(fitness, size, units=()):
    free = tuple(place < size for place in range(6))
    return FittedStateSpace(1, 1, units, (0.5,) * 6, free, ((0.0,),), fitness, fitness)


@pytest.mark.ci
def test_the_number_of_threads_does_not_matter(problem, archipelagos):
    evolution = problem.open(threads=1)
    island, info = evolution.first_generation(0, 5)
    assert island == archipelagos[0].islands[0]
    assert problem.open(threads=4).first_generation(0, 5) == (island, info)
    assert evolution.step(island) == problem.open(threads=3).step(island)


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


def test_the_hall_keeps_one_system_of_every_size():
    hall = with_entries(
        HallOfFame(), [make_system(2.0, 5), make_system(1.0, 5, ("tanh",)), make_system(3.0, 4)]
    )
    assert [(each.size, each.fitness) for each in hall.entries] == [(4, 3.0), (5, 1.0)]


def test_the_elite_has_the_front_and_the_least_criterion_first():
    small, large, useless = make_system(2.0, 3), make_system(1.0, 6), make_system(1.001, 6, ("tanh",))
    assert select_latent_elite([small, large, useless], 2, 1000) == (large, small)
    # With few rows, three parameters do not pay for half of the squared error.
    assert select_latent_elite([small, large, useless], 3, 6)[0] == small
