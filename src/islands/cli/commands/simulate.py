"""``islands simulate``: prediction of a record by whatever `islands.load` opens."""

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Annotated

import numpy as np
import typer
from numpy.typing import NDArray

from islands.cli import options
from islands.cli.console import output
from islands.cli.progress_display import compile_kernels
from islands.cli.settings_options import with_settings
from islands.errors import ExtrapolationWarning, ModelError, SettingsError
from islands.facade.load import Loaded, load
from islands.facade.results.fitted_model import FittedModel, list_metrics
from islands.facade.results.identification import Result
from islands.facade.results.model_simulation import (
    SHOOTING,
    list_extrapolations,
    match_columns,
    split_start,
)
from islands.facade.results.saved_simulation import SavedDiagnosis, SavedSimulation
from islands.models.coupled_narx import AnyModel, CoupledModel, coupled_signals
from islands.models.equations import named_signals
from islands.models.operating_point import parse_levels
from islands.models.signal_statement import describe_values
from islands.records.coupled import AnyRecord, unite
from islands.records.dataset import Dataset, same_dt
from islands.records.preprocessing import preprocess
from islands.records.preprocessing_steps import DETREND
from islands.records.reading import read_dataset
from islands.records.reading.column_names import find_column
from islands.records.reading.open_table import read_table
from islands.records.reading.options import ReadingOptions
from islands.records.reading.reader import open_record
from islands.records.reading.row_range import parse_rows
from islands.records.writer import write_simulation
from islands.sentences import write_amount
from islands.settings_schema import Integer, setting, settings_class
from islands.simulation.initial_outputs import ESTIMATED_START, has_estimated_start
from islands.simulation.initial_states import find_first_states
from islands.validation.metrics import metrics
from islands.validation.prediction_bands import PredictionBand

#: Measured samples of a simulated output, at least, of which an error is stated.
_LEAST_KNOWN = 10

#: Ranges of the inputs of a model without its result.
_NO_RANGES: Mapping[str, Sequence[Sequence[float]]] = MappingProxyType({})


@settings_class
class SimulationSettings:
    """Settings of a simulation."""

    detrend: str = setting(
        "none", "Subtract means or a line; for models that state no preprocessing.", choices=DETREND
    )
    shooting: Integer | None = setting(
        None, f"Steps of the model in a shooting interval; by default those of the result, or {SHOOTING}."
    )
    warm_up: Integer | None = setting(
        None, "Samples before the first prediction; by default those of the result, or the largest lag."
    )


@dataclass(frozen=True, slots=True)
class _Request:
    """Options of the command: what is read, how it is simulated, and where the simulation is written."""

    record: Path
    mode: str
    out: Path | None
    inputs: list[str]
    outputs: list[str]
    dt: float | None
    rows: slice | None
    reading: ReadingOptions
    settings: SimulationSettings
    bands: float | None
    start: Mapping[str, float]

    def read(self, inputs: Sequence[str], names: Sequence[str]) -> AnyRecord:
        """Read a record of the outputs of a model, which may be missing; given columns replace them.

        Raises
        ------
        SettingsError
            Another number of outputs is given.
        """
        if self.outputs and len(self.outputs) != len(names):
            raise SettingsError(
                f"the model has the outputs {', '.join(names)}, got {', '.join(self.outputs)}: give as many "
                "--output, or none"
            )
        table = open_record(self.record, self.reading)

        def read_output(name: str) -> Dataset:
            is_known = self.outputs or find_column(name, table.names) in table.names
            found = read_table(
                *(table, self.record.name, inputs, name if is_known else None, self.dt, self.rows),
                missing_output=True,
                options=self.reading,
            )
            return found if is_known else replace(found, output_name=name)

        return unite([read_output(name) for name in self.outputs or names])

    def refuse_detrend(self, model: str) -> None:
        """Refuse ``detrend`` for a model that states its signals."""
        if self.settings.detrend != "none":
            raise SettingsError(f"{model} reads the record as measured: leave out --set detrend")


@with_settings
def simulate(
    *,
    model: options.ModelFile,
    records: Annotated[
        list[Path],
        typer.Argument(
            metavar="RECORD...",
            help="Record of the inputs and the output, or of inputs alone; several, one by one.",
        ),
    ],
    mode: Annotated[str, typer.Option("--mode", help="one-step, shooting or free-run.")] = "free-run",
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            help="CSV file for time and y_sim, with --bands also y_low and y_high; of several records a "
            "folder.",
        ),
    ] = None,
    start: Annotated[
        list[str] | None,
        typer.Option(
            "--start",
            help="NAME=VALUE: output before the first sample, or states x1, x2 .. of a latent model at it; "
            "by default the measured output, and rest at the first inputs without one.",
        ),
    ] = None,
    inputs: options.InputsOrNone = None,
    output_columns: Annotated[
        list[str] | None, typer.Option("--output", help="Output column; by default that of the model.")
    ] = None,
    dt: options.SamplingTime = None,
    rows: options.Rows = None,
    reading: ReadingOptions,
    settings: SimulationSettings,
    bands: Annotated[
        float | None,
        typer.Option(
            "--bands",
            help="Probability, as 0.9, of the prediction band of a free run; for models of a result folder.",
        ),
    ] = None,
) -> None:
    """Simulate a model on records. A free run needs only the inputs.

    It starts from the first samples of the output if the record has them. For a model
    of a result folder, the errors on the validation data are those of the result.
    """
    files = _name_files(records, out)
    loaded = load(model)
    for record, file in zip(records, files, strict=True):
        if len(records) > 1:
            output.print(f"{record}:", markup=False)
        request = _Request(
            *(record, mode, file, options.columns(inputs or []), options.columns(output_columns or []), dt),
            *(parse_rows(rows), reading, settings, bands),
            start=parse_levels(options.columns(start or []), "--start"),
        )
        _simulate_loaded(loaded, request)


def _name_files(records: Sequence[Path], out: Path | None) -> list[Path | None]:
    """Return the file of the simulation of every record; those of several are in the folder, which is made.

    Raises
    ------
    SettingsError
        Two records would have one file.
    """
    if out is None or len(records) == 1:
        return [out] * len(records)
    by_file: dict[Path, Path] = {}
    for record in records:
        file = out / f"{record.stem}.csv"
        if file in by_file:
            raise SettingsError(
                f"{by_file[file]} and {record} would both be simulated to {file}: rename one, or simulate "
                "them one by one with other --out"
            )
        by_file[file] = record
    out.mkdir(parents=True, exist_ok=True)
    return list(by_file)


def _simulate_loaded(loaded: Loaded, request: _Request) -> None:
    match loaded:
        case Result() as result:
            _simulate_model(result.best, request, result.document.get("data", {}).get("inputs", {}))
        case FittedModel() as single:
            _simulate_model(single, request)
        case SavedDiagnosis() as diagnosis:
            _simulate_system(diagnosis.require_extension(), request)
        case SavedSimulation() as simulation:
            _simulate_system(simulation, request)


def _simulate_model(
    found: FittedModel, request: _Request, ranges: Mapping[str, Sequence[Sequence[float]]] = _NO_RANGES
) -> None:
    """Simulate a model; ``ranges`` are those of its inputs by the part of its data."""
    model, mode = found.model, request.mode
    if request.bands is not None and mode != "free-run":
        raise SettingsError("--bands are for free runs of models of a result folder")
    recorded = request.read(request.inputs or model.column_names, found.output_names)
    for step in dict.fromkeys(step for each in recorded.records for step in each.reading):
        output.print(step, markup=False)
    if model.preprocessing is not None:
        request.refuse_detrend("a model that states its preprocessing")
    prepared = recorded.map(partial(preprocess, detrend=request.settings.detrend))
    data = match_columns(model, prepared)
    if found.signals:
        statement = coupled_signals(model) if isinstance(model, CoupledModel) else named_signals(model)
        is_prepared = data.samples == prepared.samples
        output.print(_describe_preparation(model, data, is_prepared, statement), markup=False)
    if "estimation" in ranges:
        for statement in list_extrapolations(model, data, ranges["estimation"]):
            output.print(f"extrapolation: {statement}", markup=False)
    compile_kernels()
    errors = _list_validation_errors(found, mode)
    y, states = split_start(model, request.start)
    if y or states or not np.isfinite(data.y).any():
        if request.bands is not None:
            raise SettingsError("--bands need the measured output of the first samples: add it to the record")
        try:
            simulation = found.simulate(data, mode, y=y, states=states)
        except ModelError as error:
            names = " ".join(f"--start {name}=VALUE" for name in found.output_names)
            raise ModelError(f"{error}{'' if y or states else f', as {names}'}") from error
        line = f"{mode} {_describe_start(request)}: {simulation.outcome}"
        _print_metrics(data, simulation.y, line, request.out, None, bool(simulation.outcome), errors)
        return
    first = found.warm_up if request.settings.warm_up is None else request.settings.warm_up
    band = None if request.bands is None else found.bands(data, request.bands, first)
    simulation = found.simulate(data, mode, first, request.settings.shooting)
    if mode == "free-run":
        if has_estimated_start(model, data, first):
            output.print(ESTIMATED_START, markup=False)
        _print_first_states(model, data, first)
    line = f"{mode} after a warm-up of {first} samples: {simulation.outcome}"
    _print_metrics(data, simulation.y, line, request.out, band, bool(simulation.outcome), errors)


def _list_validation_errors(found: FittedModel, mode: str) -> list[float]:
    """Return the RMSE of every output on the validation data of the model; none outside of a result."""
    name = {"one-step": "one_step_ahead", "shooting": "multiple_shooting"}.get(mode, "free_run")
    known = list_metrics(found.metrics).values() if found.metrics else ()
    return [float(errors["validation"][name].rmse) for errors in known]


def _describe_start(request: _Request) -> str:
    if not request.start:
        return "from rest at the first inputs"
    return f"from {', '.join(f'{name} = {value:g}' for name, value in request.start.items())}"


def _describe_preparation(model: AnyModel, data: AnyRecord, is_prepared: bool, statement: str) -> str:
    """Return which signals of the record the model reads."""
    values = describe_values(model)
    if values and is_prepared and model.dt is not None and same_dt(model.dt, data.dt):
        return (
            f"the record has the sampling time of the model, {model.dt:g} s, and its samples are read as "
            f"they are; in the data of the model, {values}"
        )
    return f"as in the model, {statement}"


def _print_first_states(model: AnyModel, data: AnyRecord, warm_up: int) -> None:
    """State the states from which an exported program repeats the simulation."""
    if found := find_first_states(model, data, warm_up):
        sample, states = found
        listed = ", ".join(f"{name} = {state!r}" for name, state in states.items())
        output.print(
            f"states at sample {sample}, estimated from the first {warm_up} samples: {listed}", markup=False
        )


def _simulate_system(found: SavedSimulation, request: _Request) -> None:
    """Simulate equations, an FMU or the result of a diagnosis; initial states are fitted to the record."""
    if request.bands is not None:
        raise SettingsError("--bands are for free runs of models of a result folder")
    request.refuse_detrend("a simulation")
    if request.mode != "free-run":
        raise SettingsError(f"a simulation supports free runs only: --mode {request.mode} is for models")
    driving, recorded = request.inputs or found.column_names, found.recorded_columns
    if len(request.outputs) > 1:
        raise SettingsError(
            f"a simulation has one output, got {', '.join(request.outputs)}: give one --output"
        )
    (name,) = request.outputs or [found.output_name]
    whole = read_dataset(
        request.record,
        [*driving, *recorded],
        name,
        request.dt,
        request.rows,
        options=request.reading,
        signals=recorded,
    )
    data = whole.first_inputs(len(driving))
    compile_kernels()
    with warnings.catch_warnings(record=True, category=ExtrapolationWarning) as caught:
        warnings.simplefilter("always", ExtrapolationWarning)
        y = found.simulate(data, dict.fromkeys(recorded, whole.u[:, -1])).y
    for each in caught:
        output.print(f"extrapolation: {each.message}", markup=False)
    _print_metrics(data, y, f"{request.mode}: with {', '.join(found.parts)}", request.out)


def _print_metrics(
    data: AnyRecord,
    simulated: NDArray[np.float64],
    line: str,
    out: Path | None,
    band: PredictionBand | None = None,
    is_complete: bool = True,
    validation: Sequence[float] = (),
) -> None:
    """Write a simulation and print the errors of every output; one that diverged has none.

    They are compared with the RMSE on the validation data of the model, if it is known.
    """
    if out is not None:
        write_simulation(data, simulated, out, None if band is None else (band.lower, band.upper))
        output.print(f"{out}: {data.samples} rows", markup=False)
    output.print(line, markup=False)
    runs = simulated.reshape(data.samples, -1).T
    for place, (each, y) in enumerate(zip(data.records, runs, strict=True)):
        title = f"{each.output_name}: " if len(data.records) > 1 else ""
        if is_complete:
            _print_errors(each, y, title, validation[place] if validation else None)
            if band is not None:
                _print_band(each, band.outputs[place], title)


def _print_errors(data: Dataset, y: NDArray[np.float64], title: str, validation: float | None) -> None:
    known = int(np.count_nonzero(np.isfinite(data.y) & np.isfinite(y)))
    if not known:
        text = f"{data.output_name}: {y[0]:.6g} at the first sample, {y[-1]:.6g} at the last"
    elif known < _LEAST_KNOWN:
        text = f"{data.output_name} is measured in {known} of the simulated samples: too few for an error"
    else:
        errors = metrics(data.y, y)
        text = (
            f"{title}MAPE {errors.mape:.4f} %  R2 {errors.r2:.5f}  RMSE {errors.rmse:.6g} "
            f"{data.output_unit}  fit {errors.fit_percent:.3f} %"
        )
        if validation:
            ratio, stated = errors.rmse / validation, write_amount(validation, data.output_unit)
            text += f"\n{title}{ratio:.3g} times the RMSE on the validation data of the model, {stated}"
    output.print(text, markup=False)


def _print_band(data: Dataset, band: PredictionBand, title: str) -> None:
    predicted = ~np.isnan(band.y)
    half = 0.5 * float(np.median((band.upper - band.lower)[predicted]))
    text = f"{title}{100 * band.level:g} % band: median half-width {half:.6g} {data.output_unit}".rstrip()
    known = predicted & ~np.isnan(data.y)
    if np.count_nonzero(known) >= _LEAST_KNOWN:
        inside = (band.lower <= data.y) & (data.y <= band.upper)
        text += f",\n  contains {100 * inside[known].mean():.1f} % of the measured samples"
    output.print(text, markup=False)
