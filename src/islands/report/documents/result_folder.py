"""Result folder: ``result.json``, one file per model, and a text summary."""

import hashlib
import json
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from functools import partial
from math import ceil, isfinite
from operator import attrgetter
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from islands.errors import RecordError
from islands.estimation.estimator_table import Criterion
from islands.evolution.search_result import (
    AnySearchResult,
    CoupledSearchResult,
    SearchResult,
    state_steps,
    without_optional_steps,
)
from islands.models.coupled_latent import CoupledLatentModel
from islands.models.coupled_narx import AnyModel, coupled_signals
from islands.models.equations import name_gains, named_signals, named_statement
from islands.models.form import is_linear, name_form, reads_inputs
from islands.models.joint_quantities import list_joint_quantities
from islands.models.latent import LatentModel
from islands.models.narx import Model
from islands.models.parametric import ParametricModel
from islands.models.protocol import DynamicModel
from islands.models.signal_statement import describe_signals
from islands.parallel import map_over_record
from islands.persistence.checkpoints import replace_file
from islands.persistence.ensembles import bands_document, ensemble_document, model_file
from islands.persistence.models import model_json, terms_document
from islands.progress import Steps
from islands.records.coupled import AnyRecord
from islands.records.dataset import Dataset
from islands.records.flat_extremes import find_limits
from islands.records.inspection.noise import measure_output_noise
from islands.records.signal_map import match_rate
from islands.records.split import measure_input_ranges
from islands.report.text.summary import certificates_document, method_text, summary
from islands.simulation.predictors import free_run
from islands.validation.assessment import PARTS, Assessment
from islands.validation.coupled_assessment import CoupledAssessment
from islands.validation.ensemble import Ensemble
from islands.validation.metrics import Metrics, metrics
from islands.validation.physics import PhysicsChecks
from islands.validation.predictable_residual import ResidualStructure, missing_structure
from islands.validation.residual_tests import ResidualTests

SCHEMA = "islands.result/1"


def result_json(found: AnySearchResult) -> str:
    """Return the text of ``result.json``."""
    return _write_json(result_document(found))


def _write_json(document: Mapping[str, Any]) -> str:
    return json.dumps(document, indent=2, allow_nan=False) + "\n"


def result_document(found: AnySearchResult) -> dict[str, Any]:
    """Return a result as JSON values; NaN and infinity become null."""
    search, record = found.search, found.record.records[0]
    document = {
        "schema": SCHEMA,
        "record": record_document(found.record),
        "preprocessing": {
            "average": found.average,
            "dt": found.split.estimation.dt,
            "feedthrough": list(found.direct_inputs),
            "shooting_interval": found.shooting_interval,
            "steps": None if record.preprocessing is None else record.preprocessing.as_document(),
        },
        "seed": found.seed,
        "settings": dict(found.settings),
        "search": {
            "evaluations": search.evaluations,
            "evaluations_per_second": search.evaluations_per_second,
            "wall_s": search.wall_s,
            "outcomes": dict(search.outcomes),
            "full_set": dict(search.full_set),
            "generations": search.generations,
            "ended_by": search.ended_by,
            "left_out": list(search.left_out),
            "duplicates": search.duplicates,
            "feasible_share": search.feasible_share,
            "certificates": certificates_document(found) if isinstance(found, SearchResult) else [],
            "caches": {
                name: {"bytes": size, "limit": limit} for name, (size, limit) in search.caches.items()
            },
        },
        **(_describe_outputs(found) if isinstance(found, CoupledSearchResult) else _describe_models(found)),
    }
    complete: dict[str, Any] = finite(document)
    return complete


def _describe_models(found: SearchResult) -> dict[str, Any]:
    """Return the models of one output, and what they are compared with."""
    # The checks of a model are made when they are first read.
    list(map_over_record(attrgetter("final_physics", "residual_tests"), found.models, found.record.samples))
    steps, recommendation = Steps(), found.recommendation
    data = steps.attempt("facts about the data", partial(_data_document, found)) or {}
    return {
        "not_computed": _list_not_computed(state_steps(found, steps)),
        "data": data,
        "loop": found.has_loop,
        "recommended": asdict(recommendation),
        "models": [
            _model_document(rank, entry, rank == recommendation.rank, found.ensemble)
            for rank, entry in enumerate(found.models, start=1)
        ],
        "ensemble": ensemble_document(found.ensemble),
        "linear": None if found.linear is None else _comparison_document(found.linear),
    }


def _describe_outputs(found: CoupledSearchResult) -> dict[str, Any]:
    """Return the model of several outputs, and the common free run of each of them."""
    steps, entry = Steps(), found.recommended
    steps.refusal = found.refusal
    outputs = [_output_document(place, entry, steps) for place in range(len(entry.model.models))]
    parts = {part: getattr(entry.split, part).records[0] for part in PARTS}
    return {
        "not_computed": list_failures({**found.search.not_computed, **steps.not_computed}),
        "data": {"inputs": {part: measure_input_ranges(record) for part, record in parts.items()}},
        "recommended": asdict(found.recommendation),
        "outputs": outputs,
        "models": [_coupled_model_document(rank, each) for rank, each in enumerate(found.models, start=1)],
        "ensemble": ensemble_document(found.ensemble),
    }


def _output_document(place: int, entry: CoupledAssessment, steps: Steps) -> dict[str, Any]:
    """Return the common free run of one output; its residual and its gross errors are optional steps."""
    estimation, validation, whole = (
        data.records[place] for data in (entry.split.estimation, entry.split.validation, entry.split.record)
    )
    name, bands = validation.output_name, None if entry.bands is None else entry.bands.outputs[place]
    own = entry.bands is not None and entry.bands.ensemble is None
    residual = steps.attempt(f"residual tests of {name}", partial(entry.measure_residual, place))
    left_out = steps.attempt(
        f"gross errors of {name}",
        lambda: measure_left_out(
            whole, lambda: free_run(entry.model, entry.split.record, entry.warm_up).y[:, place]
        ),
    )
    return {
        "name": name,
        "unit": validation.output_unit,
        "folder": list_folders(entry.model.output_names)[place],
        "rank": entry.ranks[place] if entry.ranks else None,
        "reads_inputs": reads_inputs(entry.model.models[place]),
        "bands": bands_document(bands),
        **({"ensemble": ensemble_document(bands.ensemble)} if own and bands else {}),
        "data": {
            "noise": measure_output_noise(estimation),
            "output_range": validation.output_range,
            "left_out": left_out,
        },
        "residual": residual_structure_document(residual or missing_structure()),
        "metrics": {
            part: {mode: asdict(each) for mode, each in by_mode.items()}
            for part, by_mode in entry.metrics[name].items()
        },
    }


def _describe_size(model: DynamicModel) -> dict[str, Any]:
    """Return form and number of free parameters of a model, and the structure of a state space."""
    structure = {"structure": model.structure} if isinstance(model, LatentModel) else {}
    form = {"form": name_form(model), "reads_inputs": reads_inputs(model)}
    return {**form, "size": model.free_size, **structure}


def _coupled_model_document(rank: int, entry: CoupledAssessment) -> dict[str, Any]:
    model, written = entry.model, entry.model.equation()
    ensemble = None if entry.bands is None else entry.bands.ensemble
    signals = coupled_signals(model)
    return {
        "kind": model.kind,
        "rank": rank,
        "recommended": rank == 1,
        "size": ceil(entry.size),
        "structure": entry.structure,
        "equation": written.named,
        "latex": written.latex,
        "signals": signals,
        "named_signals": signals,
        "terms": terms_in_result(model, ensemble),
        **_describe_modes(entry),
        "refined": entry.refined,
        "metrics": {
            part: {
                mode: _average([parts[part][mode] for parts in entry.metrics.values()])
                for mode in ("one_step_ahead", "free_run")
            }
            for part in PARTS
        },
        "warm_up": entry.warm_up,
    }


def _describe_modes(entry: CoupledAssessment) -> dict[str, Any]:
    """Return the modes and gains of a linear system whose parameters are coordinates of its states."""
    model, bands = entry.model, entry.bands
    if not isinstance(model, CoupledLatentModel) or not (model.shares_states or is_linear(model)):
        return {}
    ensemble = None if bands is None else bands.ensemble
    members = [row for each in ensemble.structures for row in each.parameters.tolist()] if ensemble else []
    return {
        "shared_states": model.models[0].order if model.shares_states else 0,
        "linear": is_linear(model),
        "quantities": list_joint_quantities(model, members),
    }


def _average(errors: Sequence[Metrics]) -> dict[str, float]:
    """Return the means over the outputs of the errors that have no unit."""
    return {
        name: float(np.mean([getattr(each, name) for each in errors]))
        for name in ("mape", "r2", "fit_percent")
    }


def list_folders(outputs: Sequence[str]) -> list[str]:
    """Return the folder of the separate result of every output, such as ``outputs/1-level_cm``."""
    return [
        f"outputs/{place}-{re.sub(r'[^A-Za-z0-9_.-]', '_', name)}" for place, name in enumerate(outputs, 1)
    ]


def _list_not_computed(found: SearchResult) -> list[dict[str, str]]:
    """Return the optional steps that failed, and the checks of models that did, each with the reason."""
    steps = dict(found.search.not_computed)
    failures = {
        "physics checks": [entry.final_physics.not_computed for entry in found.models],
        "residual tests": [entry.residual_structure.not_computed for entry in found.models],
    }
    for name, reasons in failures.items():
        for reason in dict.fromkeys(filter(None, reasons)):
            ranks = [str(rank) for rank, each in enumerate(reasons, start=1) if each == reason]
            models = "" if len(ranks) == len(reasons) else f" of model {', '.join(ranks)}"
            steps[name + models] = reason
    return list_failures(steps)


def list_failures(not_computed: Mapping[str, str]) -> list[dict[str, str]]:
    """Return the steps that failed, each with the reason, as JSON values."""
    return [{"step": step, "reason": reason} for step, reason in not_computed.items()]


def record_document(recorded: AnyRecord) -> dict[str, Any]:
    """Return the description of a record of one or several outputs as JSON values."""
    record, *others = recorded.records
    names: dict[str, Any] = {"output": record.output_name}
    units: dict[str, Any] = {"output": record.output_unit}
    if others:
        names = {"outputs": list(recorded.output_names)}
        units = {"outputs": [each.output_unit for each in recorded.records]}
    return {
        "sha256": record.sha256 or content_sha256(record),
        "samples": record.samples,
        "dt": record.dt,
        "start": record.start,
        "names": {"inputs": list(record.input_names), **names},
        "units": {"inputs": list(record.input_units), **units},
        "segments": list(record.segments),
        "recordings": list(record.recordings),
        "reading": list(record.reading),
    }


def _data_document(found: SearchResult) -> dict[str, Any]:
    """Return the facts about the data that the statements about a result read."""
    parts = {"estimation": found.split.estimation, "validation": found.split.validation}
    model = found.recommended.model
    record = match_rate(model, found.record)
    return {
        "missing_outputs": int(np.isnan(found.record.y).sum()),
        "left_out": measure_left_out(record, lambda: free_run(model, record).y),
        "output_range": found.record.output_range,
        "output_limits": list(find_limits(found.record.y, found.record.bounds)),
        "noise": measure_output_noise(found.split.estimation),
        "inputs": {part: measure_input_ranges(record) for part, record in parts.items()},
    }


def measure_left_out(record: Dataset, simulate: Callable[[], NDArray[np.float64]]) -> dict[str, Any] | None:
    """Return the error of a simulation over a whole record without and with its gross errors, as JSON values.

    None if no gross error is left out, or if the simulation has no start or diverges.

    Parameters
    ----------
    record : Dataset
        Record with the signals of the simulation.
    simulate : callable
        Returns the simulated output, shape (samples,).
    """
    if record.measured is None:
        return None
    try:
        run = simulate()
    except RecordError:  # an output is missing in a warm-up
        return None
    with np.errstate(over="ignore"):
        without, together = (metrics(y, run).rmse for y in (record.y, record.measured))
    samples = int((np.isnan(record.y) & np.isfinite(record.measured - run)).sum())
    found = {"samples": samples, "rmse": without, "rmse_with": together}
    return found if np.isfinite([without, together]).all() else None


def content_sha256(record: Dataset) -> str:
    """Return the SHA-256 of the samples, sampling time and segments, for records not read from a file."""
    digest = hashlib.sha256(np.ascontiguousarray(record.u).tobytes())
    digest.update(record.y.tobytes())
    digest.update(repr((record.dt, record.segments)).encode())
    return digest.hexdigest()


def _model_document(
    rank: int, assessment: Assessment, recommended: bool, ensemble: Ensemble | None
) -> dict[str, Any]:
    model, written = assessment.final_model, assessment.final_model.equation()
    return {
        **({} if isinstance(model, Model) else {"kind": model.kind}),
        "rank": rank,
        "recommended": recommended,
        **_describe_size(model),
        "equation": written.named,
        "latex": written.latex,
        "signals": describe_signals(model),
        "named_signals": named_signals(model),
        "terms": terms_in_result(model, ensemble),
        **({"quantities": model.list_quantities()} if isinstance(model, LatentModel) else {}),
        **({"laws": [asdict(each) for each in assessment.checks.laws]} if recommended else {}),
        "bands": bands_document(assessment.bands),
        "recordings": {
            part: {name: asdict(value) for name, value in by_name.items()}
            for part, by_name in assessment.recordings.items()
        },
        "warm_up": assessment.warm_up,
        "estimated_start": assessment.has_estimated_start,
        "refit": _refit_document(assessment),
        "information": asdict(assessment.information),
        "constraints": [
            {**asdict(entry), "named": _name_statement(entry.text, model)}
            for entry in assessment.final_constraints
        ],
        **_assessment_document(assessment),
    }


def _name_statement(text: str, model: DynamicModel) -> str:
    return named_statement(text, model) if isinstance(model, Model) else name_gains(text, model)


def _refit_document(assessment: Assessment) -> dict[str, Any] | None:
    """Return the estimate on all data as JSON values, with the model that the errors belong to."""
    refit = assessment.refit
    if refit is None:
        return None
    return {
        "samples": refit.samples,
        "discarded": refit.discarded or None,
        "validated_model": None if refit.discarded else json.loads(model_json(assessment.model)),
    }


def _comparison_document(assessment: Assessment) -> dict[str, Any]:
    """Return the linear model with which the models are compared as JSON values."""
    written = assessment.model.equation()
    return {
        **_describe_size(assessment.model),
        "equation": written.named,
        "model": json.loads(model_json(assessment.model)),
        **_assessment_document(assessment),
    }


def _assessment_document(assessment: Assessment) -> dict[str, Any]:
    return {
        "criterion": criterion_document(assessment.criterion),
        "metrics": {
            part: {mode: asdict(value) for mode, value in assessment.metrics[part].items()} for part in PARTS
        },
        "outcomes": {
            part: {mode: str(value) for mode, value in assessment.outcomes[part].items()} for part in PARTS
        },
        "physics": physics_document(assessment.final_physics),
        "residual_tests": residual_tests_document(assessment.residual_tests)
        | residual_structure_document(assessment.residual_structure),
    }


def criterion_document(criterion: Criterion | None) -> dict[str, Any] | None:
    """Return the error that the parameters of a model minimise as JSON values; null if they are given."""
    return None if criterion is None else {**asdict(criterion), "error": criterion.error}


def terms_in_result(model: AnyModel, ensemble: Ensemble | None) -> list[dict[str, Any]]:
    """Return the terms of a model as JSON values, with their text for readers and their inclusion.

    Parameters with names have no inclusion: a name has another meaning in another structure.
    """
    texts = zip(terms_document(model), model.equation().terms, model.parameter_names, strict=True)
    counted = None if isinstance(model, ParametricModel) else ensemble
    return [
        {**term, "term": text, "inclusion": None if counted is None else counted.inclusion(name)}
        for term, text, name in texts
    ]


def physics_document(physics: PhysicsChecks) -> dict[str, Any]:
    """Return the results of the physics checks as JSON values."""
    return {
        "property_1": physics.property_1,
        "clusters": [asdict(entry) for entry in physics.clusters],
        "hold_drift_percent": physics.hold_drift_percent,
        "holds": [asdict(entry) for entry in physics.holds],
        "excursions": [asdict(entry) for entry in physics.excursions],
        "not_computed": physics.not_computed or None,
        "extremes": [{**asdict(entry), "plausible": entry.plausible} for entry in physics.extremes],
    }


def residual_tests_document(tests: ResidualTests) -> dict[str, Any]:
    """Return the results of the residual tests as JSON values."""
    return {
        "passed": tests.passed,
        "whiteness_p": tests.whiteness_p,
        "ljung_box": tests.ljung_box,
        "tests": [
            {
                "name": test.name,
                "input": test.input,
                "passed": test.passed,
                "inside_percent": test.inside_percent,
                "limit": test.limit,
                "largest": float(
                    np.abs(test.values[test.lags != 0] if test.name == "xi_xi" else test.values).max()
                ),
                "note": test.note,
            }
            for test in tests.tests
        ],
    }


def residual_structure_document(structure: ResidualStructure) -> dict[str, Any]:
    """Return the predictable shares of the residuals and the verdict as JSON values."""
    return {
        "verdict": structure.verdict,
        "predictable_share": {
            "one_step_ahead": structure.one_step_share,
            "free_run": structure.free_run_share,
        },
        "predictable_percent": structure.percent,
        "not_computed": structure.not_computed or None,
    }


def write_result(found: AnySearchResult, folder: Path) -> dict[str, Any]:
    """Write ``models/NN.json``, ``summary.txt``, ``method.txt`` of one output and, last, ``result.json``.

    Remove the model files of an earlier result in the same folder. A text that fails is an optional step.

    Returns
    -------
    dict
        Content of ``result.json``.
    """
    models = folder / "models"
    models.mkdir(parents=True, exist_ok=True)
    entries: Sequence[Assessment | CoupledAssessment] = found.models
    for rank, entry in enumerate(entries, start=1):
        content = model_file(entry.final_model, entry.bands)
        (models / f"{rank:02d}.json").write_text(content, encoding="utf-8")
    for path in models.glob("[0-9][0-9]*.json"):
        if int(path.stem) > len(found.models):
            path.unlink()
    steps = Steps()
    document, best = result_document(found), found.recommended.final_model
    texts = {"summary.txt": partial(summary, document, best)}
    if isinstance(found, SearchResult):
        texts["method.txt"] = partial(method_text, found)
    for name, write in texts.items():
        text = steps.attempt(name, write)
        if text is None:
            text = f"{best.equation().line}\n\nNot computed: {name}: {steps.not_computed[name]}.\n"
        (folder / name).write_text(text, encoding="utf-8")
    document["not_computed"] += list_failures(steps.not_computed)
    replace_file([_write_json(document).encode()], folder / "result.json")
    return document


def write_interim_result(found: SearchResult, folder: Path) -> dict[str, Any]:
    """Write a result before its optional steps, so that the end of the process loses none of its models."""
    return write_result(without_optional_steps(found, "the command ended before this step"), folder)


def finite(value: Any) -> Any:
    """Return JSON values with null in place of NaN and infinity."""
    if isinstance(value, np.generic):
        return finite(value.item())
    if isinstance(value, Mapping):
        return {key: finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [finite(item) for item in value]
    return None if isinstance(value, float) and not isfinite(value) else value
