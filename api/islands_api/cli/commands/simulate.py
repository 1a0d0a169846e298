"""``islands simulate``: prediction of a record by a model."""

from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from numpy.typing import NDArray

from islands.data.dataset import Dataset
from islands.data.preprocessing import preprocess
from islands.data.preprocessing_steps import DETREND
from islands.data.signal_map import match_rate
from islands.errors import SettingsError
from islands.facade.library_fit import SHOOTING
from islands.facade.results.model_simulation import simulate as run
from islands.io.ensembles import read_bands
from islands.io.records import read_dataset, write_simulation
from islands.io.records.reading_options import DEFAULT_READING, ReadingOptions
from islands.io.records.row_range import parse_rows
from islands.io.result_models import (
    ErrorMeasurement,
    find_model_file,
    read_error_measurement,
)
from islands.io.simulator_spec.code_spec import FmuSpec
from islands.io.simulator_spec.factory import simulate_spec
from islands.io.simulator_spec.ode_spec import OdeSpec
from islands.io.simulator_spec.specification import ColumnSpec, LocalExtendedSpec, innermost
from islands.model.equations import named_signals
from islands.validation.metrics import metrics
from islands.validation.prediction_bands import PredictionBand
from islands_api.cli import options
from islands_api.cli.console import compile_kernels, output
from islands_api.cli.record_options import with_reading_options
from islands_api.cli.runs.coupled_run import read_coupled, read_warm_up, simulate_coupled


@with_reading_options
def simulate(
    model: options.ModelFile,
    record: options.Record,
    mode: Annotated[str, typer.Option("--mode", help="one-step, shooting or free-run.")] = "free-run",
    out: Annotated[
        Path | None,
        typer.Option("--out", help="CSV file for time and y_sim, with --bands also for y_low and y_high."),
    ] = None,
    inputs: Annotated[
        list[str] | None,
        typer.Option("--input", help="Input column; by default that of the model."),
    ] = None,
    output_columns: Annotated[
        list[str] | None, typer.Option("--output", help="Output column; by default that of the model.")
    ] = None,
    dt: options.SamplingTime = None,
    rows: options.Rows = None,
    reading: ReadingOptions = DEFAULT_READING,
    detrend: Annotated[
        str,
        typer.Option(
            "--detrend",
            help=f"{', '.join(DETREND)}: subtract means or a line; for models that state no preprocessing.",
        ),
    ] = "none",
    shooting: Annotated[
        int | None,
        typer.Option(
            "--shooting",
            help=f"Steps of the model in a shooting interval; by default those of the result, or {SHOOTING}.",
        ),
    ] = None,
    warm_up: Annotated[
        int | None,
        typer.Option(
            "--warm-up",
            help="Samples before the first prediction; by default those of the result, or the largest lag.",
        ),
    ] = None,
    bands: Annotated[
        float | None,
        typer.Option(
            "--bands",
            help="Probability, as 0.9, of the prediction band of a free run; for models of a result folder.",
        ),
    ] = None,
) -> None:
    """Simulate a model on a record. A free run needs only the first samples of the output.

    For a model of a result folder, the errors on the validation data are those of the result.
    """
    outputs = options.columns(output_columns or [])
    coupled = read_coupled(model)
    if coupled is not None:
        if mode != "free-run" or bands is not None:
            raise SettingsError("a model of several outputs has free runs only: leave out --mode and --bands")
        _check_detrend(detrend, False, "a model of several outputs")
        first = read_warm_up(model) if warm_up is None else warm_up
        columns = (options.columns(inputs or []), outputs)
        simulate_coupled(coupled, record, *columns, dt, parse_rows(rows), reading, first, out)
        return
    if len(outputs) > 1:
        raise SettingsError(f"the model has one output, got {', '.join(outputs)}: give one --output")
    output_column = outputs[0] if outputs else None
    extended = options.written_simulation(model) or options.extended(model)
    if bands is not None and (mode != "free-run" or extended is not None):
        raise SettingsError("--bands are for free runs of models of a result folder")
    if extended is not None:
        _check_detrend(detrend, False, "a simulation")
        _simulate_extended(extended, record, mode, out, inputs, output_column, dt, rows, reading)
        return
    chosen = options.model(model)
    recorded = read_dataset(
        record,
        options.columns(inputs or list(chosen.column_names)),
        output_column or chosen.output_name,
        dt,
        parse_rows(rows),
        missing_output=True,
        options=reading,
    )
    for step in recorded.reading:
        output.print(step, markup=False)
    _check_detrend(detrend, chosen.preprocessing is None, "a model that states its preprocessing")
    data = match_rate(chosen, preprocess(recorded, detrend=detrend))
    if statement := named_signals(chosen):
        output.print(f"as in the model, {statement}", markup=False)
    compile_kernels()
    reported = read_error_measurement(find_model_file(model)) or ErrorMeasurement(None, SHOOTING)
    interval = reported.shooting if shooting is None else shooting
    first = next(each for each in (warm_up, reported.warm_up, chosen.maximum_lag) if each is not None)
    band = None
    if bands is not None:
        band = read_bands(find_model_file(model), chosen).predict(chosen, data, bands, first)
    simulation = run(chosen, data, mode, interval, warm_up=first)
    _print_metrics(
        data, simulation.y, f"{mode} after a warm-up of {first} samples: {simulation.outcome}", out, band
    )


def _check_detrend(detrend: str, allowed: bool, model: str) -> None:
    if detrend != "none" and not allowed:
        raise SettingsError(f"{model} reads the record as measured: leave out --detrend")


def _simulate_extended(
    spec: LocalExtendedSpec | OdeSpec | FmuSpec,
    record: Path,
    mode: str,
    out: Path | None,
    inputs: list[str] | None,
    output_column: str | None,
    dt: float | None,
    rows: str | None,
    reading: ReadingOptions,
) -> None:
    """Simulate equations, an FMU or the result of a diagnosis; initial states are fitted to the record."""
    if mode != "free-run":
        raise SettingsError(f"a simulation supports free runs only: --mode {mode} is for models")
    if isinstance(spec, OdeSpec | FmuSpec):
        expected, expected_output, effects = (spec.input, *spec.channels), spec.output, [spec.name]
    else:
        expected, expected_output = spec.inputs, spec.output
        effects = [effect.name for effect in spec.effects]
        effects += [] if spec.output_equation is None else ["missing terms"]
    inner = innermost(spec)
    recorded = (inner.column,) if isinstance(inner, ColumnSpec) else ()
    driving = options.columns(inputs or list(expected))
    names = [*driving, *recorded]
    whole = read_dataset(
        record, names, output_column or expected_output, dt, parse_rows(rows), options=reading
    )
    data = whole.first_inputs(len(driving))
    compile_kernels()
    y = simulate_spec(spec, data, dict.fromkeys(recorded, whole.u[:, -1]))
    _print_metrics(data, y, f"{mode}: with {', '.join(effects)}", out)


def _print_metrics(
    data: Dataset,
    y: NDArray[np.float64],
    line: str,
    out: Path | None,
    band: PredictionBand | None = None,
) -> None:
    if out is not None:
        write_simulation(data, y, out, None if band is None else (band.lower, band.upper))
        output.print(f"{out}: {data.samples} rows", markup=False)
    errors = metrics(data.y, y)
    output.print(line, markup=False)
    output.print(
        f"MAPE {errors.mape:.4f} %  R2 {errors.r2:.5f}  RMSE {errors.rmse:.6g} {data.output_unit}  "
        f"fit {errors.fit_percent:.3f} %",
        markup=False,
    )
    if band is not None:
        _print_band(data, band)


def _print_band(data: Dataset, band: PredictionBand) -> None:
    predicted = ~np.isnan(band.y)
    half = 0.5 * float(np.median((band.upper - band.lower)[predicted]))
    text = f"{100 * band.level:g} % band: median half-width {half:.6g} {data.output_unit}".rstrip()
    known = predicted & ~np.isnan(data.y)
    if known.any():
        inside = (band.lower <= data.y) & (data.y <= band.upper)
        text += f",\n  contains {100 * inside[known].mean():.1f} % of the measured samples"
    output.print(text, markup=False)
