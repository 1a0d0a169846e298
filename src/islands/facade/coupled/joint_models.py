"""Models of several outputs that one search finds for all of them, and the choice among all candidates.

The candidates are compared on the common free run, as linear and nonlinear models of one output are:

* a linear model whose outputs share the poles (`identify_linear`), for few states;
* a state space whose states all outputs share, linear and with an effect of the amplitude;
* one equation, or one latent model, for each output.

The separate searches are not made if they cannot win: if the state space has more parameters than their
equations may have terms, and a trial of the equations on measured outputs has decisively less evidence.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from math import isfinite
from typing import Any

import numpy as np
from numpy.typing import NDArray

from islands.errors import RecordError
from islands.estimation.estimator_table import refinement_criterion
from islands.estimation.linear.identify import LARGEST_ORDER
from islands.estimation.linear.latent import identify_joint_model
from islands.estimation.shared_states import SharedModel, search_shared_models
from islands.evolution.search_result import (
    BANDS,
    LINEAR_MODEL,
    CoupledSearchResult,
    SearchStatistics,
    require_one_output,
    sum_statistics,
)
from islands.evolution.settings import LATENT
from islands.facade.results.identification import Result
from islands.facade.results.model_simulation import SHOOTING
from islands.facade.trials.held_out_error import hold_out, measure_library
from islands.facade.trials.library import TrialLibrary
from islands.models.coupled_latent import CoupledLatentModel
from islands.models.coupled_narx import CoupledModel
from islands.models.latent import LatentModel
from islands.progress import Steps
from islands.records.coupled import CoupledSplit
from islands.records.input_lead import advance_all_inputs
from islands.records.split import Split
from islands.report.documents.result_folder import record_document
from islands.rounding import RESOLUTION
from islands.validation.coupled_assessment import CoupledAssessment
from islands.validation.ensemble import Ensemble, EnsembleStructure, ValidatedModel, make_ensemble
from islands.validation.evidence import DECISIVE, measure_lack, measure_size
from islands.validation.prediction_bands import OutputBands, calibrate_output_bands
from islands.validation.recommendation import recommend_joint

#: The linear model is estimated by the error of the free run.
_CRITERION = refinement_criterion(None)


@dataclass(frozen=True, slots=True, eq=False)
class JointCandidate:
    """A model of all outputs with what the choice and the result need.

    Attributes
    ----------
    assessed : CoupledAssessment
        Without bands.
    find_bands : callable
        Returns the bands; None if there are none.
    outputs : tuple of Result
        Separate result of every output; empty if one search has found the model of all of them.
    """

    assessed: CoupledAssessment
    find_bands: Callable[[], OutputBands | None]
    outputs: tuple[Result, ...] = ()

    @property
    def order(self) -> int:
        """Number of states that all outputs share; 0 without such states."""
        model = self.assessed.model
        return model.models[0].order if isinstance(model, CoupledLatentModel) else 0


def list_joint_candidates(
    data: CoupledSplit, average: int, options: Mapping[str, Any], seed: int, steps: Steps
) -> list[JointCandidate]:
    """Search the models that all outputs have in common.

    Parameters
    ----------
    data : CoupledSplit
        With the sampling time of the models.
    average : int
        Number of samples of the record whose mean is one sample of the models.
    options : mapping
        Settings of the search; models of all outputs meet no constraints.
    seed : int
    steps : Steps
        All of them are optional.
    """
    if options.get("constraints", "none") != "none" or steps.stop():
        return []
    found = _search(data, seed, steps)
    return [each if average == 1 else _average(each, average) for each in found]


def _average(candidate: JointCandidate, count: int) -> JointCandidate:
    """Return a candidate that is a model of means."""
    model = candidate.assessed.model
    model = replace(model, models=tuple(replace(each, average=count) for each in model.models))
    return replace(candidate, assessed=replace(candidate.assessed, model=model))


def _search(data: CoupledSplit, seed: int, steps: Steps) -> list[JointCandidate]:
    shared = search_shared_models(data.estimation, seed, steps)
    found = [_take_shared(each, data, steps) for each in shared]
    if not shared or shared[0].model.models[0].order <= LARGEST_ORDER:
        steps.report(LINEAR_MODEL, None)
        found = [*(steps.attempt(LINEAR_MODEL, partial(_identify_linear, data, seed, steps)) or ()), *found]
    return found


def _take_shared(found: SharedModel, data: CoupledSplit, steps: Steps) -> JointCandidate:
    """Return a candidate of a state space; a bootstrap would take much longer than its estimation."""
    model = found.model
    if model.models[0].reads_at_once:
        data = data.map(advance_all_inputs)
    ensemble = Ensemble((EnsembleStructure(model, 1.0, found.draws),))
    order, is_linear = model.models[0].order, not model.models[0].units
    structure = f"a {'linear ' * is_linear}state space of {order} shared states"
    return _assess(
        structure + ("" if is_linear else " whose response follows the amplitude"),
        found.size + 0.5 * len(model.models),
        model,
        data,
        lambda: calibrate_output_bands(model, ensemble, data, model.maximum_lag),
        steps,
    )


def _identify_linear(data: CoupledSplit, seed: int, steps: Steps) -> list[JointCandidate]:
    """Return the linear model whose outputs share the poles; none if the record is too short for it."""
    try:
        model = identify_joint_model(data.estimation, steps)
    except RecordError:
        return []
    poles = model.models[0].order
    size = sum(map(measure_size, model.models)) - poles * (len(model.models) - 1)

    def find_bands() -> OutputBands | None:
        pairs = zip(model.models, data.estimation.records, data.validation.records, strict=True)
        draws = [_draw(each, Split(*parts), seed, steps) for each, *parts in pairs]
        count = min(map(len, draws))
        if not count:
            return None
        ensemble = Ensemble((EnsembleStructure(model, 1.0, np.hstack([each[:count] for each in draws])),))
        return calibrate_output_bands(model, ensemble, data, model.maximum_lag)

    structure = f"a linear model of {poles} poles that the outputs share"
    return [_assess(structure, size, model, data, find_bands, steps)]


def _draw(model: LatentModel, split: Split, seed: int, steps: Steps) -> NDArray[np.float64]:
    """Return parameters of the model of an output from a block bootstrap of its free run, row by row."""
    candidates = [ValidatedModel(model, _CRITERION, 1.0)]
    skip = partial(steps.skip, BANDS)
    ensemble = make_ensemble(candidates, split, "none", model.maximum_lag, seed, skip, model)
    return ensemble.structures[0].parameters if ensemble else np.empty((0, model.size))


def _assess(
    structure: str,
    size: float,
    model: CoupledModel,
    data: CoupledSplit,
    find_bands: Callable[[], OutputBands | None],
    steps: Steps,
) -> JointCandidate:
    assessed = CoupledAssessment(
        *(model, data, model.maximum_lag), refined=False, ranks=(), structure=structure, size=size
    )
    return JointCandidate(assessed, lambda: steps.attempt(BANDS, find_bands))


def exceeds_latent_models(found: Sequence[JointCandidate]) -> bool:
    """Return whether the best model has more states than the search of a latent model of one output."""
    return bool(found) and choose_candidate(found, 1)[0].order > LARGEST_ORDER


def exceeds_equations(
    found: Sequence[JointCandidate], data: CoupledSplit, terms: int, trial: TrialLibrary, steps: Steps
) -> bool:
    """Return whether one equation for each output cannot win against the best model of all of them.

    It has more parameters than the equations may have terms, and equations with the errors of a trial on
    measured values of the other outputs would have decisively less evidence, even with one term each:
    nonlinear terms do not replace states.

    Parameters
    ----------
    found : sequence of JointCandidate
    data : CoupledSplit
    terms : int
        Largest number of terms of all equations.
    trial : TrialLibrary
        Library of the equations.
    steps : Steps
    """
    best = choose_candidate(found, 1)[0] if found else None
    if best is None or best.assessed.size <= terms:
        return False
    errors = []
    for place, each in enumerate(data.estimation.records):
        steps.report(f"trial of an equation of {each.output_name}", None)
        error = min(measure_library(hold_out(data.estimation.separate(place)), trial, steps))
        errors.append(max(error / (each.output_range or 1.0), RESOLUTION))
    entry = best.assessed
    known, tried = measure_lack(
        (entry.model, entry.model),
        (entry.size, len(errors)),
        (entry.mean_square, np.exp(np.mean(np.log(np.square(errors))))),
        entry.errors.size,
        1,
    )
    return bool(tried > known + DECISIVE)


def choose_candidate(candidates: Sequence[JointCandidate], terms: int) -> tuple[JointCandidate, str]:
    """Return the best candidate, and the comparison in words; empty if there is only one.

    Parameters
    ----------
    candidates : sequence of JointCandidate
    terms : int
        Number of terms among which equations choose.
    """
    chosen = recommend_joint([each.assessed for each in candidates], terms)
    (best,) = (each for each in candidates if each.assessed is chosen)
    if len(candidates) < 2:
        return best, ""
    others = "; ".join(
        f"{each.assessed.structure}, {each.assessed.size:g} parameters, {_state_error(each)}"
        for each in candidates
        if each is not best
    )
    return best, (
        "most evidence (information criterion of the common free run on all data); error on the validation "
        f"data (root mean square over the outputs) {_state_error(best)}; compared with {others}"
    )


def _state_error(candidate: JointCandidate) -> str:
    error = candidate.assessed.validation_error
    return f"{100.0 * error:.3g} % of the range" if isfinite(error) else "infinite, as the free run diverges"


def join_candidate(
    data: CoupledSplit,
    chosen: JointCandidate,
    reason: str,
    separate: Sequence[Result],
    described: Mapping[str, Any],
    seed: int,
    steps: Steps,
) -> Result:
    """Return the result of a candidate, with its bands.

    Parameters
    ----------
    data : CoupledSplit
        As passed by the caller.
    chosen : JointCandidate
    reason : str
        Why it is chosen; may be empty.
    separate : sequence of Result
        Results of separate searches of the outputs; may be empty.
    described : mapping
        Settings of the result without separate searches.
    seed : int
    steps : Steps
        Steps that the result lacks, also those of the searches.
    """
    assessed = replace(chosen.assessed, bands=chosen.find_bands())
    found = tuple(require_one_output(result.search_result) for result in separate)
    if found:
        settings = found[0].settings
        statistics = sum_statistics([each.search for each in found], steps)
    else:
        interval = min(SHOOTING, max(1, data.estimation.samples // 10))
        held_out = record_document(data.validation.records[0])
        settings = {
            **described,
            "model": LATENT,
            "constraints": "none",
            "average": assessed.model.average,
            "shooting": interval,
            "validation": held_out,
        }
        statistics = SearchStatistics(
            1, {"ok": 1}, {}, left_out=steps.left_out, not_computed=steps.not_computed
        )
    return Result.from_search(
        CoupledSearchResult(
            *(data.record, assessed.split, seed, settings, statistics, (assessed,), found, steps.refusal),
            tuple(filter(None, [reason])),
        )
    )
