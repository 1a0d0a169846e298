"""Searches of one island as the paper describes them, and the statistics that the comparison needs."""

from collections.abc import Mapping
from typing import Any

from islands.evolution.archipelago import Island, StepInfo
from islands.evolution.evaluation import Evaluator
from islands.evolution.paper_search import list_models, rank_models, run_island
from islands.evolution.presets import resolve_settings, with_tuples
from islands.expressions.parsing import parse
from islands.models.equations import plain_text
from islands.models.narx import Model, make_model
from islands.records.dataset import Dataset
from islands.simulation.predictors import free_run
from islands.validation.metrics import metrics
from islands.validation.physics import check_physics, cluster_sums, is_convergent
from lab.reproduction.tasks import Document

#: Points of a trace over the generations.
_TRACED = 20

#: Metrics that the paper prints.
METRICS = ("mape", "r2")


def measure_errors(model: Model, records: Mapping[str, Dataset]) -> Document:
    """Return MAPE and R2 of the free run on each record, each None if it diverged.

    A free run starts after the largest lag of the model.
    """
    errors: Document = {}
    for name, record in records.items():
        simulated = free_run(model, record)
        found = metrics(record.y, simulated.y)
        errors[name] = {
            metric: float(getattr(found, metric)) if simulated.outcome else None for metric in METRICS
        }
    return errors


def model_document(model: Model) -> Document:
    """Return a model as a document: its equation, and the terms that `read_document` reads."""
    return {
        "equation": plain_text(model),
        "size": model.size,
        "terms": [[item.text, value] for item, value in zip(model.regressors, model.parameters, strict=True)],
    }


def read_document(document: Mapping[str, Any], record: Dataset) -> Model:
    """Return the model of a document; the names of its signals are those of the record."""
    terms = ((parse(text), value) for text, value in document["terms"])
    return make_model(terms, record.input_names, record.output_name, record.dt)


def search_island(
    record: Dataset,
    validation: Mapping[str, Dataset],
    preset: str,
    changes: Mapping[str, Any],
    seed: int,
    root_rule: bool = True,
    simulate_holds: bool = True,
) -> Document:
    """Run the search of the paper, and select the individual of its hall of fame with the least error.

    Parameters
    ----------
    record : Dataset
        Estimation data.
    validation : mapping of Dataset
        Records on which the selected model is measured. The last one selects it, by the MAPE of its free run.
    preset : str
        An entry of `PRESETS`.
    changes : mapping
        Settings that differ from the preset.
    seed : int
    root_rule : bool
        See `Evaluator`.
    simulate_holds : bool
        Whether Property 1 of the final hall is also checked by simulated holds, which takes longer than the
        search of a few generations.

    Returns
    -------
    dict
        ``trace`` over the generations, the final ``hall``, and the ``selected`` model (None if every model
        diverged).
    """
    settings = resolve_settings(preset, with_tuples(changes))
    evaluator = Evaluator(record, settings, root_rule=root_rule)
    stride = max(1, settings.generations // _TRACED)
    trace: list[Document] = []
    evaluations = 0

    def follow(island: Island, info: StepInfo) -> None:
        nonlocal evaluations
        evaluations += info.evaluations
        if island.generation % stride == 0 or island.generation == settings.generations:
            trace.append(_trace(island, record))

    island = run_island(evaluator, seed, follow)
    models = list_models(island, record)
    ranked = rank_models(models, list(validation.values())[-1])
    return {
        "seed": seed,
        "generations": settings.generations,
        "population": settings.population,
        "evaluations": evaluations,
        "trace": trace,
        "hall": {
            "models": len(models),
            "diverged": len(models) - len(ranked),
            "converging": sum(map(has_equilibria, models)),
            "property_1": sum(check_physics(model, record).property_1 for model in models)
            if simulate_holds
            else None,
        },
        "selected": {
            **model_document(ranked[0]),
            "errors": measure_errors(ranked[0], {"estimation": record, **validation}),
            "property_1": check_physics(ranked[0], record).property_1,
        }
        if ranked
        else None,
    }


def has_equilibria(model: Model) -> bool:
    """Return whether the cluster sums of a model meet Property 1 and its linear output terms converge."""
    return is_convergent(model) and all(entry.met for entry in cluster_sums(model))


def _trace(island: Island, record: Dataset) -> Document:
    entries = island.hall_of_fame.entries
    return {
        "generation": island.generation,
        "models": len(entries),
        "converging": sum(map(has_equilibria, list_models(island, record))),
        "rmse": min((entry.fitness for entry in entries), default=0.0) ** 0.5,
    }
