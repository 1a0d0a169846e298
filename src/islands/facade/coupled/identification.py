"""Searches of several outputs: one equation per output, chosen and refined for a common free run.

Latent models of several outputs read the inputs only, so that each is searched on its own. Models that all
outputs have in common are compared with them; see `joint_models`.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from math import inf
from typing import Any, TypeAlias

from islands.errors import SettingsError
from islands.estimation.refinement import refine
from islands.evolution.presets import AUTO as AUTO_PRESET
from islands.evolution.presets import (
    COUPLED_PRESET,
    check_coupled_settings,
    resolve_coupled_settings,
    with_tuples,
    without_automatic,
)
from islands.evolution.search_result import require_one_output, without_optional_steps
from islands.evolution.search_state import SearchState, keep_hall, stop_reason
from islands.evolution.settings import LATENT, NARX, Settings
from islands.facade.coupled.bands import make_bands
from islands.facade.coupled.joined_results import couple_latent_results
from islands.facade.coupled.joint_models import (
    JointCandidate,
    choose_candidate,
    exceeds_equations,
    exceeds_latent_models,
    join_candidate,
    list_joint_candidates,
)
from islands.facade.coupled.selection import choose_equations, measure_error
from islands.facade.evolution_run import SearchCallback
from islands.facade.fit_settings import FitSettings
from islands.facade.results.identification import Result
from islands.facade.trials.library import TrialLibrary, make_trial_library, take_library
from islands.facade.trials.rate_selection import select_rate
from islands.models.coupled_narx import CoupledModel
from islands.models.narx import require_narx
from islands.progress import AnswerFoundError, ProgressCallback, Steps, StoppedError
from islands.records.averaging import AUTO, average_samples
from islands.records.coupled import CoupledSplit
from islands.records.dataset import Dataset
from islands.records.split import Split
from islands.simulation.outcome import EvaluationOutcome
from islands.validation.coupled_assessment import CoupledAssessment
from islands.validation.evidence import measure_size

#: Largest number of accepted steps of the common refinement over each interval.
_STEPS = 20

#: Search of one output: its record, its validation data, and options by name.
FindOutput: TypeAlias = Callable[..., Result]

#: Names of the steps after the searches of the outputs.
_CHOICE, _REFINEMENT = "choice of the equations", "refinement of all equations"


class StoppedCouplingError(StoppedError):
    """A search was stopped before every output had models.

    Attributes
    ----------
    outputs : tuple of str
        Names of all outputs.
    found : tuple of Result
        Results of the first outputs; there may be none.
    """

    def __init__(self, step: str, outputs: Sequence[str], found: Sequence[Result]) -> None:
        super().__init__(step)
        self.outputs, self.found = tuple(outputs), tuple(found)


def fit_outputs(
    data: CoupledSplit,
    find: FindOutput,
    refine_together: bool,
    seed: int,
    steps: Steps,
    options: Mapping[str, Any],
) -> Result:
    """Fit one equation per output by subset selection, for a simulation of all outputs together.

    Every output is fitted with the measured values of the other outputs as further inputs, which it reads
    from sample k-1 on. Of the models of each size, `choose_equations` takes those with the least error of the
    common free run on the validation data. Then all parameters are refined on the common free run of the
    estimation data; the refined parameters are kept if the error on the validation data is smaller.

    With ``model="latent"``, every output has a latent model of the inputs alone; see `couple_latent_results`.
    Unless a library is named, models that all outputs have in common compete; see `joint_models`.

    Parameters
    ----------
    data : CoupledSplit
    find : callable
        Fit of one output: `fit_record` with the arguments that all outputs share.
    refine_together : bool
        Whether all parameters are refined together. Those of latent models never are: the outputs do not
        depend on each other.
    seed : int
    steps : Steps
        Once a stop is requested and every output has models, the fit ends with the best ones so far.
    options : mapping
        Settings of `fit` that are given; ``auto`` is the default of several outputs.

    Raises
    ------
    SettingsError
        A setting is unknown, out of range or not for several outputs, or an output has no model.
    StoppedError
        A stop was requested before every output had models.
    RecordError
        The record is too short or incomplete.
    """
    chosen = without_automatic(options)
    check_coupled_settings(
        chosen.get("constraints"), chosen.get("feedthrough", "no"), chosen.get("refit", "none")
    )
    if chosen.get("delays"):
        raise SettingsError("delays are for one output: leave them out")
    search = _Search(data, {"method": "fit"}, seed, steps, find)
    if chosen.get("model", NARX) == LATENT:
        return search.couple_latent(chosen)
    is_open = "library" not in chosen
    chosen = {"library": "polynomial", "feedthrough": "no", **chosen}
    degree, lags, constraints = (chosen.get(name) for name in ("degree", "lags", "constraints"))
    trial = take_library(chosen["library"], degree, lags, constraints)
    most_terms = int(chosen.get("max_terms", FitSettings().max_terms))
    return search.couple_equations(chosen, trial, trial.lags, most_terms, refine_together, is_open)


def identify_outputs(
    data: CoupledSplit,
    find: FindOutput,
    refine_together: bool,
    seed: int,
    steps: Steps,
    changes: Mapping[str, Any],
    *,
    preset: str,
    start: SearchState | None,
    on_epoch: SearchCallback | None,
) -> Result:
    """Identify one equation per output by evolution, as `fit_outputs` does.

    Parameters
    ----------
    data, refine_together, seed, steps
        As for `fit_outputs`.
    find : callable
        Search of one output: `identify_record` with the arguments that all outputs share.
    changes : mapping
        Settings that differ from the preset.
    preset : str
        An entry of ``PRESETS``; ``auto`` is `COUPLED_PRESET`.
    start : SearchState or None
        State to continue from.
    on_epoch : callable or None
        Called with the `SearchState` and the `Settings` after every epoch of the search of each output. The
        state contains those of the outputs before it.

    Raises
    ------
    SettingsError, StoppedError, RecordError
        As `fit_outputs`.
    """
    chosen = {"feedthrough": "no", **without_automatic(with_tuples(changes))}
    settings = resolve_coupled_settings(preset, chosen)
    name = COUPLED_PRESET if preset == AUTO_PRESET else preset
    searches = _Searches(partial(find, preset=name), start, on_epoch)
    search = _Search(data, {"method": "identify", "preset": preset}, seed, steps, searches)
    if settings.model_class == LATENT:
        return search.couple_latent(chosen)
    chosen.setdefault("average", settings.average)
    trial = make_trial_library(settings)
    is_open, lags = preset == AUTO_PRESET, settings.maximum_lag
    return search.couple_equations(chosen, trial, lags, settings.max_terms, refine_together, is_open)


class _Searches:
    """Searches of the outputs, one after the other.

    Parameters
    ----------
    search : callable
        `identify_record` with the arguments that all searches share.
    start : SearchState or None
        State to continue from.
    on_epoch : callable or None
        Receives the states of the running search with those of the searches before it.
    """

    def __init__(
        self, search: Callable[..., Result], start: SearchState | None, on_epoch: SearchCallback | None
    ) -> None:
        self._search, self._on_epoch = search, on_epoch
        self._starts = () if start is None else (*start.earlier, replace(start, earlier=()))
        self._ended: tuple[SearchState, ...] = ()
        self._state: SearchState | None = None

    def __call__(self, record: Dataset, validation: Dataset, **options: Any) -> Result:
        """Search the next output."""
        place = len(self._ended)
        self._state = self._starts[place] if place < len(self._starts) else None
        try:
            return self._search(record, validation, start=self._state, on_epoch=self._report, **options)
        finally:
            if self._state is not None:
                self._ended = (*self._ended, self._state)

    def _report(self, state: SearchState, settings: Settings) -> None:
        # A search that a limit of time has ended can continue, with its populations.
        self._state = keep_hall(state) if stop_reason(state, settings) else state
        if self._on_epoch is not None:
            self._on_epoch(replace(state, earlier=self._ended), settings)


def _search_outputs(
    names: Sequence[str],
    splits: Sequence[Split],
    options: dict[str, Any],
    steps: Steps,
    find: FindOutput,
) -> list[Result]:
    """Search every output; a stop before the models of an output is a `StoppedCouplingError`.

    The searches share the time of a `TimeLimit`, so that each of them finds models.
    """
    results: list[Result] = []
    for name, split in zip(names, splits, strict=True):
        show, stop = partial(_report, steps.report, name), steps.share_stop(len(names) - len(results))
        try:
            found = find(split.estimation, split.validation, progress=show, stop=stop, **options)
        except AnswerFoundError as ended:
            steps.refusal = str(ended)
            found = Result.from_search(without_optional_steps(ended.found, steps.refusal))
        except StoppedError as stopped:
            raise StoppedCouplingError(f"{name}: {stopped.step}", names, results) from stopped
        search = require_one_output(found.search_result).search
        steps.add(search.left_out, search.not_computed, name)
        results.append(found)
    return results


@dataclass(frozen=True, slots=True, eq=False)
class _Search:
    """Candidates of several outputs, and the result of the best one.

    Attributes
    ----------
    data : CoupledSplit
    described : mapping
        Settings of a result without separate searches.
    seed : int
    steps : Steps
    find : callable
        Search of one output.
    """

    data: CoupledSplit
    described: Mapping[str, Any]
    seed: int
    steps: Steps
    find: FindOutput

    def couple_latent(self, options: dict[str, Any]) -> Result:
        """Search latent models, of all outputs together and, unless they cannot win, of each."""
        data, steps = self.data, self.steps
        joint = list_joint_candidates(data, 1, options, self.seed, steps)
        if exceeds_latent_models(joint):
            return self._choose(joint)
        splits = [Split(*pair) for pair in zip(data.estimation.records, data.validation.records, strict=True)]
        results = _search_outputs(data.estimation.output_names, splits, options, steps, self.find)
        return self._choose([*joint, couple_latent_results(data, results)])

    def couple_equations(
        self,
        options: dict[str, Any],
        trial: TrialLibrary,
        lags: int,
        most_terms: int,
        refine_together: bool,
        is_open: bool,
    ) -> Result:
        """Search one equation for each output, unless they cannot win, choose and refine them.

        Parameters
        ----------
        options : dict
            Settings of the searches.
        trial : TrialLibrary
            Library of models that compare sampling rates.
        lags : int
            Largest lag of an equation.
        most_terms : int
            Largest number of terms of an equation.
        refine_together : bool
        is_open : bool
            Whether a model without equations may be the result.
        """
        data, steps, outputs = self.data, self.steps, len(self.data.estimation.records)

        def list_joint(given: CoupledSplit, count: int) -> list[JointCandidate]:
            return list_joint_candidates(given, count, options, self.seed, steps) if is_open else []

        joint = list_joint(data, 1)
        if exceeds_equations(joint, data, most_terms * outputs, trial, steps):
            return self._choose(joint)
        splits = [Split(data.estimation.separate(at), data.validation.separate(at)) for at in range(outputs)]
        steps("sampling rate", 0.0)
        # The equations have one sampling time: the shortest that one of them needs.
        average, least = options.get("average", AUTO), lags + 3
        count = min(select_rate(split, average, trial, least, steps)[1] for split in splits)
        if count > 1:
            data = data.map(partial(average_samples, count=count))
            joint = list_joint(data, count)
        options = {**options, "average": count}
        # State spaces do not read the other outputs sample by sample.
        find = partial(self.find, equations_only=True)
        results = _search_outputs(data.estimation.output_names, splits, options, steps, find)
        equations, terms = _couple_results(data, results, refine_together, self.seed, steps)
        return self._choose([*joint, equations], terms)

    def _choose(self, candidates: Sequence[JointCandidate], terms: int = 1) -> Result:
        best, reason = choose_candidate(candidates, terms)
        separate = next((each.outputs for each in candidates if each.outputs), ())
        return join_candidate(self.data, best, reason, separate, self.described, self.seed, self.steps)


def _couple_results(
    data: CoupledSplit, results: Sequence[Result], refine_together: bool, seed: int, steps: Steps
) -> tuple[JointCandidate, int]:
    """Choose one equation of each output and refine them; return also the number of all terms."""
    steps.report("choice of the equations", 0.0)
    warm_up = max(entry.warm_up for result in results for entry in result.models)
    searches = [require_one_output(result.search_result) for result in results]
    ranked = [[require_narx(entry.final_model) for entry in search.models] for search in searches]
    best = [result.recommendation.rank for result in results]
    choice = choose_equations(ranked, best, data.validation, warm_up, partial(steps.skip, _CHOICE))
    model = CoupledModel(tuple(models[rank - 1] for models, rank in zip(ranked, choice.ranks, strict=True)))
    refined = None
    constraints = str(searches[0].settings["constraints"])
    if refine_together and choice.error < inf:
        steps.report(_REFINEMENT, 0.0)
        skip = partial(steps.skip, _REFINEMENT)
        shooting = searches[0].shooting_interval
        refine_all = partial(_refine, model, data, shooting, warm_up, constraints, choice.error, skip)
        refined = steps.attempt(_REFINEMENT, refine_all)
    final = refined or model
    terms = {
        (place, name)
        for place, models in enumerate(ranked)
        for each in models
        for name in each.parameter_names
    }
    return JointCandidate(
        CoupledAssessment(
            *(final, data, warm_up, refined is not None, choice.ranks),
            "one equation for each output" + (", refined together" if refined else ""),
            sum(map(measure_size, final.models)),
        ),
        partial(make_bands, final, ranked, choice.ranks, data, constraints, warm_up, seed, steps),
        tuple(results),
    ), len(terms)


def _refine(
    model: CoupledModel,
    data: CoupledSplit,
    shooting: int,
    warm_up: int,
    constraints: str,
    error: float,
    skip: Callable[[], bool],
) -> CoupledModel | None:
    """Refine all parameters together; return the model if its error on the validation data is smaller.

    Each equation was estimated with the measured values of the other outputs, whose noise biases the
    parameters, and a common simulation feeds errors from one equation to the other.
    """
    best, started = None, model
    for interval in (shooting, None):
        if skip():
            break
        found = refine(started, data.estimation, interval, constraints, warm_up, _STEPS, stop=skip)
        if isinstance(found, EvaluationOutcome) or not found.steps:
            continue
        started = found.model
        reached = measure_error(started, data.validation, warm_up)
        if reached < error:
            best, error = started, reached
    return best


def _report(progress: ProgressCallback, name: str, message: str, fraction: float | None = None) -> None:
    progress(f"{name}: {message}", fraction)
