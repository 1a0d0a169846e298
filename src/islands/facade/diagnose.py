"""`diagnose` names what a simulation gets wrong on a record; `plan_experiment` says what one could show."""

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, TypeAlias, cast

from islands.diagnosis.planning.experiment_plan import DecisiveLimits, ExperimentPlan
from islands.diagnosis.planning.experiment_plan import plan_experiment as plan_with_simulator
from islands.diagnosis.procedure import diagnose as diagnose_simulator
from islands.diagnosis.settings import DiagnosisSettings
from islands.effects.catalogue import EFFECTS
from islands.effects.interface.context import Signal
from islands.effects.interface.effect import Effect
from islands.errors import SettingsError
from islands.facade.results.complete_diagnosis import DiagnosisResult
from islands.models.narx import Model
from islands.models.parametric import ParametricModel
from islands.parallel import ParallelMap, one_blas_thread
from islands.progress import ProgressCallback, ignore_progress
from islands.records.dataset import Dataset
from islands.records.reading.column_names import list_inputs
from islands.records.reading.data_frames import as_dataset
from islands.records.reading.options import DEFAULT_READING, take_reading
from islands.records.split import hold_out
from islands.settings_schema import document_settings
from islands.simulators.external import PythonFunctionSimulator
from islands.simulators.interface import Simulator
from islands.simulators.specification.base import SpecModel
from islands.simulators.specification.factory import make_model_simulator, make_simulator
from islands.simulators.specification.table import (
    ColumnSpec,
    LocalSpec,
    SimulationSpec,
    innermost,
    parse_spec,
)

if TYPE_CHECKING:
    from islands.records.reading.data_frames import ReadingLike, RecordLike

#: Simulation as a user names it; quoted in signatures, because its specifications take a thousand letters.
SimulationLike: TypeAlias = str | Model | ParametricModel | SimulationSpec | LocalSpec | Simulator


@document_settings(DiagnosisSettings, "settings")
def diagnose(
    record: "RecordLike",
    simulation: "SimulationLike",
    *,
    inputs: str | Sequence[str] = (),
    output: str | None = None,
    dt: float | None = None,
    validation: "RecordLike | None" = None,
    columns: Mapping[str, Signal] | None = None,
    effects: Sequence[Effect] = EFFECTS,
    seed: int = 0,
    reading: "ReadingLike" = DEFAULT_READING,
    progress: ProgressCallback = ignore_progress,
    parallel_map: ParallelMap = map,
    **settings: Any,
) -> DiagnosisResult:
    """Find which effects explain the difference between a simulation and a record, and how much they explain.

    Parameters
    ----------
    record : Dataset or data frame
        The first input drives the simulation; further inputs are channels that may affect the output.
        Make a record of arrays with `as_record`.
    simulation : str, Model, spec or Simulator
        Text as on the command line (``second-order``, ``linear:2``, ``model:FILE.json``,
        ``python:FILE.py:FUNCTION``, ...), a model, a specification, or a simulator.
    inputs, output
        Names of the columns of a data frame.
    dt : float, optional
        Sampling time of a data frame without a time, in seconds.
    validation : Dataset or data frame, optional
        Further recordings, which are held out as a whole instead of the last quarter of the record: of these,
        the initial states alone are fitted.
    columns : mapping, optional
        Outputs of external simulations by name, each of shape (samples,), for ``column:NAME``; those of the
        validation data follow those of the record. By default, ``NAME`` is a column of the data frame.
    effects : sequence of Effect
        Effects to search for. Add your own with ``(*islands.EFFECTS, mine)``; user-defined maps act after
        those of the catalogue.
    seed : int
        Seed of the random generator. The same record, simulation and seed give the same diagnosis, bit for
        bit.
    reading : mapping
        Options of reading a frame, as of `as_record`: ``{"gaps": "split"}``.
    progress : callable
        Called with a message, and with the completed fraction if it is known.
    parallel_map : ParallelMap
        Function like `map` that calibrates the effects, possibly in parallel. It does not affect the result.
    **settings

    Returns
    -------
    DiagnosisResult
        Verdict, effects and gain; ``summary`` has them as sentences, ``save`` writes a folder, and
        ``simulate`` runs the extended simulation on another record.

    Raises
    ------
    RecordError
        The record cannot be used, or the simulation diverges on it.
    SettingsError, ModelError
        There is no such simulation, a setting is unknown or out of range, a tolerance belongs to no
        parameter, two effects have the same name, or an effect is invalid.
    """
    given = DiagnosisSettings(**settings)
    recorded = () if isinstance(record, Dataset) else _find_recorded(simulation, columns or {})
    options = take_reading(reading).changes()
    names = [*list_inputs(inputs), *recorded] if recorded else inputs

    def read(data: "RecordLike") -> Dataset:
        return as_dataset(
            data, dt=dt, inputs=names, output=output, resting_inputs=True, signals=recorded, **options
        )

    record = read(record)
    if validation is not None:
        record = hold_out(record, read(validation))
    if recorded:
        kept = record.inputs - len(recorded)
        columns = {**(columns or {}), **dict(zip(recorded, record.u[:, kept:].T, strict=True))}
        record = record.first_inputs(kept)
    simulator = _as_simulator(simulation, record, columns)
    found = one_blas_thread(diagnose_simulator)(
        *(record, simulator, given.tolerance, seed, progress, parallel_map, effects),
        noise_level=given.noise_level,
    )
    return DiagnosisResult.from_diagnosis(found)


def plan_experiment(
    record: Dataset,
    simulation: "SimulationLike",
    *,
    noise_std: float | None = None,
    separate: Sequence[str] = (),
    amplitude: float | None = None,
    rate: float | None = None,
    duration: float | None = None,
    tolerance: Mapping[str, float] | None = None,
    effects: Sequence[Effect] = EFFECTS,
    seed: int = 0,
    progress: ProgressCallback = ignore_progress,
    parallel_map: ParallelMap = map,
) -> ExperimentPlan:
    """Find which causes of a discrepancy an experiment could tell apart, before it is carried out.

    Parameters
    ----------
    record : Dataset
        Record with the input; its output may be missing: ``read_record(path, ["u_V"], None)``, or
        ``Dataset(u, np.full(len(u), np.nan), dt)``.
    simulation : str, Model, spec or Simulator
        As in `diagnose`.
    noise_std : float, optional
        Standard deviation of the white noise of the output, in its unit; by default the noise and its colour
        are estimated from the output of the record.
    separate : sequence of str
        Names of two effects for which cheaper and better experiments are compared; by default the decisive
        experiment is for all causes that the given one does not separate.
    amplitude, rate, duration : float, optional
        Limits of the decisive experiment: half of the range of the input, its largest rate per second, and
        seconds; by default those of the given input.
    tolerance, effects, seed, progress, parallel_map
        As in `diagnose`.

    Raises
    ------
    RecordError
        The record cannot be used, or the simulation diverges on it.
    SettingsError, ModelError
        There is no such simulation or cause, or a setting is not possible.
    """
    limits = DecisiveLimits(amplitude, rate, duration)
    simulator = _as_simulator(simulation, record, None)
    return plan_with_simulator(
        *(record, simulator, noise_std, tolerance, separate, limits, seed, parallel_map, progress, effects)
    )


def _find_recorded(simulation: object, columns: Mapping[str, Signal]) -> tuple[str, ...]:
    """Return the column of a frame that is the simulation; empty if it is given or is another simulation."""
    if not isinstance(simulation, str | SpecModel):
        return ()
    spec = parse_spec(simulation) if isinstance(simulation, str) else simulation
    inner = innermost(cast("LocalSpec", spec))
    return (inner.column,) if isinstance(inner, ColumnSpec) and inner.column not in columns else ()


def _as_simulator(
    simulation: "SimulationLike",
    record: Dataset,
    columns: Mapping[str, Signal] | None,
) -> Simulator:
    if isinstance(simulation, Simulator):
        return simulation
    if isinstance(simulation, Model | ParametricModel):
        return make_model_simulator(simulation, "the model", record)
    if isinstance(simulation, str | SpecModel):
        return make_simulator(simulation, record, columns)
    raise SettingsError(
        f"a simulation of the type {type(simulation).__name__} cannot be diagnosed: derive its class from "
        "islands.Simulator, or give a Python function to islands.function_simulator"
    )


def function_simulator(function: Callable[..., Signal], **nominal: float) -> Simulator:
    """Make a simulator of a Python function, for `diagnose`.

    Parameters
    ----------
    function : callable
        ``function(u, dt, **parameters) -> y``: input and output of shape (samples,), sampling time in
        seconds. Each parameter must have a number as its default.
    **nominal
        Nominal values of parameters, instead of their defaults.

    Raises
    ------
    SettingsError
        The function does not have this signature, or has no such parameter.
    """
    return PythonFunctionSimulator(function, getattr(function, "__name__", "function"), nominal)
