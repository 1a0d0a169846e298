"""`fit_coupled` and `identify_coupled`: one equation per output, chosen and refined for a common free run.

Latent models of several outputs read the inputs only, so that each is searched on its own.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from math import inf
from typing import TYPE_CHECKING, Any

from islands.errors import SettingsError, lookup
from islands.estimation.refinement import refine
from islands.evolution.engine import Engine
from islands.evolution.presets import AUTO as AUTO_PRESET
from islands.evolution.presets import (
    COUPLED_PRESET,
    check_coupled_settings,
    resolve_coupled_settings,
    with_tuples,
)
from islands.evolution.search_result import ResultCallback, ignore_result, without_optional_steps
from islands.evolution.search_state import SearchState, keep_hall, stop_reason
from islands.evolution.settings import LATENT, NARX, Settings
from islands.facade.coupled.bands import make_bands
from islands.facade.coupled.latent import join_latent_results
from islands.facade.coupled.result import CoupledResult
from islands.facade.coupled.selection import choose_equations, measure_error
from islands.facade.engine_choice import Ray
from islands.facade.evolution_run import SearchCallback
from islands.facade.fit import fit_record
from islands.facade.identify import identify_record
from islands.facade.results.identification import Result
from islands.facade.trials.library import TrialLibrary, make_trial_library, take_library
from islands.facade.trials.rate_selection import select_rate
from islands.models.coupled_narx import CoupledModel
from islands.models.narx import require_narx
from islands.progress import (
    AnswerFoundError,
    ProgressCallback,
    Steps,
    Stop,
    StoppedError,
    ignore_progress,
    never_stop,
)
from islands.records.averaging import AUTO, average_samples
from islands.records.coupled import CoupledRecord, CoupledSplit, check_outputs, couple, split_coupled
from islands.records.dataset import Dataset
from islands.records.reading.data_frames import as_record
from islands.records.reading.options import DEFAULT_READING, take_reading
from islands.records.split import Split, warn_of_extrapolation
from islands.simulation.outcome import EvaluationOutcome

if TYPE_CHECKING:
    from islands.records.reading.data_frames import FrameLike, ReadingLike

#: Largest number of accepted steps of the common refinement over each interval.
_STEPS = 20

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


def fit_coupled(
    record: "CoupledRecord | FrameLike",
    *,
    inputs: str | Sequence[str] = (),
    outputs: Sequence[str] = (),
    dt: float | None = None,
    validation: "CoupledRecord | FrameLike | float" = 0.25,
    refine_together: bool = True,
    seed: int = 0,
    progress: ProgressCallback = ignore_progress,
    stop: Stop = never_stop,
    reading: "ReadingLike" = DEFAULT_READING,
    **options: Any,
) -> CoupledResult:
    """Fit one equation per output by subset selection, for a simulation of all outputs together.

    Every output is fitted by `fit` with the measured values of the other outputs as further inputs, which it
    reads from sample k-1 on. Of the models of each size, `choose_equations` takes those with the least error
    of the common free run on the validation data. Then all parameters are refined on the common free run of
    the estimation data; the refined parameters are kept if the error on the validation data is smaller.

    With ``model="latent"``, every output has a latent model of the inputs alone; see `join_latent_results`.

    Parameters
    ----------
    record : CoupledRecord or data frame
        Data without missing inputs; a frame needs ``inputs`` and ``outputs``.
    inputs, outputs
        Names of the columns of a frame. ``u+1`` is an input that the outputs respond to within the sample.
    dt : float, optional
        Sampling time in seconds. A frame with a time does not need it.
    validation : CoupledRecord, data frame or float
        Data that choose the equations: a separate record, or the fraction at the end of ``record``.
    refine_together : bool
        Whether all parameters are refined together. Those of latent models never are: the outputs do not
        depend on each other.
    seed : int
        Seed of the results.
    progress : callable, optional
        Called with a message and the completed fraction.
    stop : callable, optional
        Called between all steps. Once it returns true and every output has models, the fit ends with the best
        ones so far; ``left_out`` of the result names the steps that are missing. The outputs share the time
        of a `TimeLimit`.
    reading : mapping
        Options of reading a frame, as of `as_record`: ``{"gaps": "split"}``.
    **options
        Options of `fit`; ``model`` is ``narx`` or ``latent``. The default library is ``polynomial``;
        ``constraints`` are an entry of ``CONSTRAINTS`` and hold for every equation. ``feedthrough`` is
        ``no``; that of latent models is found by their search.

    Returns
    -------
    CoupledResult

    Raises
    ------
    StoppedError
        ``stop`` returned true before every output had models.
    SettingsError
        A setting is unknown, out of range or not for several outputs, or an output has no model.
    RecordError
        The record is too short or incomplete, an output is given twice or is also an input, or the
        validation data has other columns or another sampling time.

    Warns
    -----
    ExtrapolationWarning
        An input of the validation data leaves the range of the estimation data.
    """
    data = _read_data(record, inputs, outputs, dt, validation, reading)
    warn_of_extrapolation(data.first)
    return fit_coupled_data(
        data, refine_together=refine_together, seed=seed, progress=progress, stop=stop, **options
    )


def fit_coupled_data(
    data: CoupledSplit,
    *,
    refine_together: bool = True,
    seed: int = 0,
    progress: ProgressCallback = ignore_progress,
    stop: Stop = never_stop,
    **options: Any,
) -> CoupledResult:
    """Fit one equation per output as `fit_coupled` does, for a caller that states an extrapolation itself.

    Parameters
    ----------
    data : CoupledSplit
    refine_together, seed, progress, stop, **options
        As for `fit_coupled`.

    Raises
    ------
    SettingsError, StoppedError, RecordError
        As `fit_coupled`.
    """
    find, steps = partial(fit_record, seed=seed), Steps(progress, stop)
    kind = options.get("model", NARX)
    lookup(dict.fromkeys((NARX, LATENT)), kind, "class of models")
    if kind == LATENT:
        check_coupled_settings(options.get("constraints"), "no", options.get("refit", "none"))
        return _couple_latent(data, dict(options), steps, find)
    chosen: dict[str, Any] = {"library": "polynomial", "feedthrough": "no", **options}
    check_coupled_settings(chosen.get("constraints"), chosen["feedthrough"], chosen.get("refit", "none"))
    degree, lags, constraints = (chosen.get(name) for name in ("degree", "lags", "constraints"))
    trial = take_library(chosen["library"], degree, lags, constraints)
    return _couple(data, chosen, trial, trial.lags + 3, refine_together, seed, steps, find)


def identify_coupled(
    record: "CoupledRecord | FrameLike",
    *,
    inputs: str | Sequence[str] = (),
    outputs: Sequence[str] = (),
    dt: float | None = None,
    validation: "CoupledRecord | FrameLike | float" = 0.25,
    refine_together: bool = True,
    preset: str = "narx",
    seed: int = 0,
    progress: ProgressCallback = ignore_progress,
    on_epoch: SearchCallback | None = None,
    stop: Stop = never_stop,
    start: SearchState | None = None,
    engine: Engine | Ray | str | None = None,
    reading: "ReadingLike" = DEFAULT_READING,
    **changes: Any,
) -> CoupledResult:
    """Identify one equation per output by evolution, for a simulation of all outputs together.

    As `fit_coupled`, with `identify` for every output.

    Parameters
    ----------
    record, inputs, outputs, dt, validation, refine_together
        As for `fit_coupled`.
    preset : str
        An entry of ``PRESETS``; ``auto`` is ``narx``.
    seed : int
        Seed of the random generator; the same seed gives the same result, bit for bit.
    progress : callable, optional
        Called with a message and the completed fraction of each stage.
    on_epoch : callable, optional
        Called with the `SearchState` and the `Settings` after every epoch of the search of each output. The
        state contains those of the outputs before it.
    stop : callable, optional
        As for `fit_coupled`.
    start : SearchState, optional
        State to continue from; the result equals that of an uninterrupted run.
    engine : str, Ray or Engine, optional
        What runs the islands, as for `identify`.
    reading : mapping
        As for `fit_coupled`.
    **changes
        Settings that differ from the preset; ``constraints`` and ``feedthrough`` as for `fit_coupled`.

    Returns
    -------
    CoupledResult

    Raises
    ------
    SettingsError, RecordError, StoppedError
        As `fit_coupled`.

    Warns
    -----
    ExtrapolationWarning
        As `fit_coupled`.
    """
    data = _read_data(record, inputs, outputs, dt, validation, reading)
    warn_of_extrapolation(data.first)
    return identify_coupled_data(
        data,
        refine_together=refine_together,
        preset=preset,
        seed=seed,
        progress=progress,
        on_epoch=on_epoch,
        stop=stop,
        start=start,
        engine=engine,
        **changes,
    )


def identify_coupled_data(
    data: CoupledSplit,
    *,
    refine_together: bool = True,
    preset: str = "narx",
    seed: int = 0,
    progress: ProgressCallback = ignore_progress,
    on_epoch: SearchCallback | None = None,
    stop: Stop = never_stop,
    start: SearchState | None = None,
    engine: Engine | Ray | str | None = None,
    on_models: ResultCallback = ignore_result,
    **changes: Any,
) -> CoupledResult:
    """Identify one equation per output, for a caller that states an extrapolation itself.

    Parameters
    ----------
    data : CoupledSplit
    refine_together, preset, seed, progress, on_epoch, stop, start, engine, **changes
        As for `identify_coupled`.
    on_models : callable
        Called with the ranked models of each output, before the optional steps. After an `AnswerFoundError`,
        the result has none of them.

    Raises
    ------
    SettingsError, RecordError, StoppedError
        As `fit_coupled`.
    """
    chosen: dict[str, Any] = {"feedthrough": "no", **with_tuples(changes)}
    settings = resolve_coupled_settings(preset, chosen)
    preset = COUPLED_PRESET if preset == AUTO_PRESET else preset
    search = partial(identify_record, preset=preset, seed=seed, engine=engine, on_models=on_models)
    find, steps = _Searches(search, start, on_epoch), Steps(progress, stop)
    if settings.model_class == LATENT:
        return _couple_latent(data, chosen, steps, find)
    chosen.setdefault("average", settings.average)
    trial = make_trial_library(settings)
    return _couple(data, chosen, trial, settings.maximum_lag + 3, refine_together, seed, steps, find)


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


def _read_data(
    record: "CoupledRecord | FrameLike",
    inputs: str | Sequence[str],
    outputs: Sequence[str],
    dt: float | None,
    validation: "CoupledRecord | FrameLike | float",
    reading: "ReadingLike",
) -> CoupledSplit:
    """Return estimation data and validation data, at the sampling time of the record."""
    named = take_reading(reading).changes()

    def as_coupled(data: Any) -> CoupledRecord:
        if isinstance(data, CoupledRecord):
            return data
        if isinstance(data, Dataset):
            raise SettingsError("a Dataset has one output: give a CoupledRecord, one Dataset per output")
        columns = [inputs] if isinstance(inputs, str) else list(inputs)
        check_outputs(columns, outputs)
        read = as_record(data, None, dt, inputs=[*columns, *outputs[1:]], output=outputs[0], **named)
        return couple(read, len(outputs))

    held_out = validation if isinstance(validation, int | float) else as_coupled(validation)
    return split_coupled(as_coupled(record), held_out)


def _search_outputs(
    names: Sequence[str],
    splits: Sequence[Split],
    options: dict[str, Any],
    steps: Steps,
    find: Callable[..., Result],
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
        search = found.search_result.search
        steps.add(search.left_out, search.not_computed, name)
        results.append(found)
    return results


def _couple_latent(
    data: CoupledSplit, options: dict[str, Any], steps: Steps, find: Callable[..., Result]
) -> CoupledResult:
    """Search a latent model of every output, and join them."""
    splits = [Split(*pair) for pair in zip(data.estimation.records, data.validation.records, strict=True)]
    results = _search_outputs(data.estimation.output_names, splits, options, steps, find)
    return join_latent_results(data, results, steps)


def _couple(
    data: CoupledSplit,
    options: dict[str, Any],
    trial: TrialLibrary,
    least: int,
    refine_together: bool,
    seed: int,
    steps: Steps,
    find: Callable[..., Result],
) -> CoupledResult:
    """Search every output, choose the equations and refine them."""
    names = data.estimation.output_names
    splits = [
        Split(data.estimation.separate(place), data.validation.separate(place)) for place in range(len(names))
    ]
    steps("sampling rate", 0.0)
    # The equations have one sampling time: the shortest that one of them needs.
    average = options.get("average", AUTO)
    options["average"] = min(select_rate(split, average, trial, least, steps)[1] for split in splits)
    results = _search_outputs(names, splits, options, steps, find)
    steps.report("choice of the equations", 0.0)
    data = data.map(partial(average_samples, count=options["average"]))
    warm_up = max(entry.warm_up for result in results for entry in result.models)
    ranked = [[require_narx(entry.model) for entry in result.models] for result in results]
    best = [result.recommendation.rank for result in results]
    choice = choose_equations(ranked, best, data.validation, warm_up, partial(steps.skip, _CHOICE))
    model = CoupledModel(tuple(models[rank - 1] for models, rank in zip(ranked, choice.ranks, strict=True)))
    refined = None
    constraints = str(results[0].search_result.settings["constraints"])
    if refine_together and choice.error < inf:
        steps.report(_REFINEMENT, 0.0)
        skip = partial(steps.skip, _REFINEMENT)
        shooting = results[0].search_result.shooting_interval
        refine_all = partial(_refine, model, data, shooting, warm_up, constraints, choice.error, skip)
        refined = steps.attempt(_REFINEMENT, refine_all)
    bands = make_bands(refined or model, ranked, choice.ranks, data, constraints, warm_up, seed, steps)
    return CoupledResult(
        refined or model,
        warm_up,
        bands,
        tuple(results),
        choice.ranks,
        refined is not None,
        data,
        steps.left_out,
        steps.not_computed,
        refusal=steps.refusal,
    )


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
