"""Search and estimation as the paper describes them: one island, and the structures that it publishes."""

from collections.abc import Callable

from islands.errors import RecordError
from islands.estimation.estimate import FittedStructure, estimate
from islands.evolution.archipelago import Island, StepInfo
from islands.evolution.evaluation import Evaluator
from islands.evolution.generation import first_generation, step
from islands.evolution.individual import require_genes
from islands.models.equations import plain_text
from islands.models.narx import Model
from islands.records.dataset import Dataset
from islands.simulation.predictors import free_run
from islands.systems.published_models import Published
from islands.validation.metrics import metrics


def run_island(evaluator: Evaluator, seed: int, on_generation: Callable[[Island, StepInfo], None]) -> Island:
    """Run all generations of one island.

    Parameters
    ----------
    evaluator : Evaluator
        Estimation data and settings.
    seed : int
    on_generation : callable
        Receives the island after every generation, the first one included, and what the generation did. An
        exception of it ends the search.
    """
    island, info = first_generation(0, seed, evaluator)
    on_generation(island, info)
    for _ in range(evaluator.settings.generations):
        island, info = step(island, evaluator)
        on_generation(island, info)
    return island


def list_models(island: Island, record: Dataset) -> list[Model]:
    """Return the models of the hall of fame; the names of their signals are those of a record."""
    names = (record.input_names, record.output_name, record.dt)
    entries = map(require_genes, island.hall_of_fame.entries)
    return [Model(entry.regressors, entry.theta, *names) for entry in entries]


def rank_models(models: list[Model], record: Dataset) -> list[Model]:
    """Sort models by the MAPE of their free run on a record, without those that diverge."""
    ranked = []
    for model in models:
        simulated = free_run(model, record)
        if simulated.outcome:
            error = metrics(record.y, simulated.y).mape
            ranked.append((error, model.size, plain_text(model), model))
    return [model for *_, model in sorted(ranked, key=lambda entry: entry[:3])]


def estimate_again(published: Published, record: Dataset) -> Model:
    """Estimate the structure of a published model by constrained least squares, with standard errors.

    Raises
    ------
    RecordError
        The structure cannot be estimated on the record.
    """
    fitted = estimate(published.model.regressors, record, "hysteresis")
    if not isinstance(fitted, FittedStructure):
        raise RecordError(f"the published structure cannot be estimated on this record: {fitted.reason}")
    return fitted.model
