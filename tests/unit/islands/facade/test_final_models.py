"""Final models: the structures that are kept are those with the least error on the validation data."""

import numpy as np

from islands.evolution.evaluation import Evaluator
from islands.evolution.individual import Individual, unique_structures
from islands.evolution.settings import Settings
from islands.expressions.parsing import parse
from islands.facade.final_models import screen
from islands.models.narx import make_model
from islands.records.dataset import Dataset
from islands.simulation.predictors import free_run

SETTINGS = Settings(shifts=(1, 2), max_height=3, max_terms=3, initial_terms=(1, 3), shooting=20)


def record(seed):
    rng = np.random.default_rng(seed)
    u = rng.uniform(-1.0, 1.0, 400)
    y = np.zeros(400)
    for k in range(2, 400):
        y[k] = 0.7 * y[k - 1] + 0.4 * u[k - 1] + 0.1 * u[k - 2] + 0.02 * rng.normal()
    return Dataset(u, y, 0.1)


def test_screening_keeps_the_structures_with_the_least_validation_error():
    terms = ("y(k-1)", "u(k-1)", "u(k-2)", "y(k-2)", "u(k-1)*y(k-1)", "u(k-1)**2")
    structures = [(parse(one), parse(other)) for one in terms for other in terms if one < other]
    estimation, validation = record(1), record(2)
    found, _ = Evaluator(estimation, SETTINGS).evaluate([(Individual(genes), False) for genes in structures])
    known = [each for each in unique_structures(found) if each.outcome]
    warm_up = SETTINGS.maximum_lag

    def error(each):
        model = make_model(
            [(term.expression, value) for term, value in zip(each.regressors, each.theta, strict=True)]
        )
        return free_run(model, validation, warm_up).mean_squared_error

    expected = [each.key for each in sorted(known, key=error) if np.isfinite(error(each))]
    for individuals in (known, known[::-1]):
        for count in (1, 4):
            kept = screen(individuals, validation, warm_up, count)
            assert [each.key for each in kept] == expected[:count]
