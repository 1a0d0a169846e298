"""``islands fit``: forward selection from a library with (constrained) least squares."""

from functools import partial
from pathlib import Path
from time import perf_counter
from typing import Annotated, Any

import typer

import islands
from islands.cli import options
from islands.cli.output_folder import check_folder, keep_models, show_result
from islands.cli.preprocessing_options import with_preprocessing_options
from islands.cli.progress_display import compile_kernels, progress
from islands.cli.record_options import with_reading_options
from islands.cli.recordings import Recordings, measured_names, state_extrapolation
from islands.cli.runs.coupled import couple_data, coupled_options, search_outputs
from islands.cli.search_options import ModelClass
from islands.cli.stop_requests import REPEAT, stop_requests
from islands.errors import SettingsError
from islands.estimation.constraints.parser import FORMS
from islands.estimation.estimator_table import ESTIMATORS, REFITS
from islands.estimation.parameter_constraints import CONSTRAINTS
from islands.facade.identification_progress import class_phases, fit_phases
from islands.models.candidate_library import LIBRARIES
from islands.models.latent import ZERO_BLOCKS
from islands.persistence.models import NARX
from islands.progress import PhasedProgress, Steps
from islands.records.averaging import AUTO
from islands.records.coupled import join_columns, split_coupled
from islands.records.preprocessing_steps import NO_STEPS, PreprocessingSteps
from islands.records.reading.options import DEFAULT_READING, ReadingOptions
from islands.report.figures.names import FREE_RUN, parse_figures

#: Default library for several outputs.
SEVERAL_OUTPUTS = "polynomial"


@with_reading_options
@with_preprocessing_options
def fit(
    records: options.Records,
    inputs: options.Inputs,
    output_columns: options.Outputs,
    out: Annotated[Path, typer.Option("--out", help="Folder for the result.")],
    dt: options.SamplingTime = None,
    rows: options.Rows = None,
    reading: ReadingOptions = DEFAULT_READING,
    steps: PreprocessingSteps = NO_STEPS,
    validation: Annotated[
        str | None,
        typer.Option(
            "--validation", help="FILE, FRACTION of the record's end (default 0.25), or START:STOP."
        ),
    ] = None,
    model: ModelClass = NARX,
    structure: Annotated[
        str, typer.Option("--structure", help=f"Structure of latent models: {', '.join(ZERO_BLOCKS)}.")
    ] = AUTO,
    library: Annotated[
        str,
        typer.Option(
            "--library",
            help=f"{AUTO} (trials on the record), {', '.join(LIBRARIES)}. "
            f"For several outputs {AUTO} is {SEVERAL_OUTPUTS}.",
        ),
    ] = AUTO,
    degree: Annotated[
        int | None, typer.Option("--degree", help="By default the value of the library.")
    ] = None,
    lags: Annotated[int | None, typer.Option("--lags", help="By default the value of the library.")] = None,
    dead_time: Annotated[
        list[int] | None,
        typer.Option("--dead-time", help="Dead time in samples; repeat it for each input."),
    ] = None,
    max_terms: Annotated[int, typer.Option("--max-terms", help="Size of the largest model.")] = 10,
    constraints: Annotated[
        str | None,
        typer.Option(
            "--constraints",
            help=f"{', '.join(CONSTRAINTS)}, or statements: {'; '.join(FORMS)}. "
            "By default those of the library.",
        ),
    ] = None,
    estimator: Annotated[
        str, typer.Option("--estimator", help=f"{', '.join(ESTIMATORS)}; by default validation selects.")
    ] = "",
    refit: Annotated[
        str,
        typer.Option(
            "--refit", help=f"Estimate the parameters again on all data in the end: {', '.join(REFITS)}."
        ),
    ] = "none",
    average: Annotated[
        str, typer.Option("--average", help="Samples of a mean that becomes one sample, or auto.")
    ] = AUTO,
    feedthrough: Annotated[
        str,
        typer.Option("--feedthrough", help="Whether models read u(k): auto (test the record), yes or no."),
    ] = AUTO,
    shooting: Annotated[
        int | None, typer.Option("--shooting", help="Samples of a shooting interval, before averaging.")
    ] = None,
    certificate: Annotated[
        int,
        typer.Option(
            "--certificate", min=0, help="Nodes of the search for the best model of each size; 0 for none."
        ),
    ] = 10_000,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of the random generator.")] = 0,
    force: Annotated[bool, typer.Option("--force", help="Replace a result that is in the folder.")] = False,
    figures: options.Figures = FREE_RUN,
) -> None:
    """Fit small models to recordings of a system by subset selection and least squares, and assess them."""
    check_folder(out, force)
    drawn = parse_figures(figures)
    outputs = options.columns(output_columns)
    names, output_column = join_columns(options.columns(inputs), outputs)
    if len(outputs) == 1:
        recordings = Recordings(records, names, output_column, dt, reading, steps)
    else:
        recordings = Recordings(records, measured_names(names, steps), output_column, dt, reading)
    # Read first: an error in a file is shown before the kernels are compiled, which takes a minute.
    with progress("fit") as show:
        show("reading", 0.0)
        data = recordings.read(rows)
        held_out = recordings.read_held_out(validation, rows)
    state_extrapolation(data, held_out, len(outputs))
    compile_kernels()
    # The fits load the kernels, which the help of the command does not need.
    from islands.facade.coupled.identification import fit_coupled_data  # noqa: PLC0415
    from islands.facade.fit import fit_record  # noqa: PLC0415

    with progress("fit") as show, stop_requests() as stop:
        began = perf_counter()
        several = outputs if len(outputs) > 1 else ()
        is_narx = model == NARX
        phases = fit_phases(library, outputs) if is_narx else class_phases(model, data.samples, several)
        given: dict[str, Any] = {
            "model": model,
            "structure": structure,
            "library": library,
            "degree": degree,
            "lags": lags,
            "delays": dead_time,
            "max_terms": max_terms,
            "constraints": constraints,
            "estimator": estimator,
            "refit": refit,
            "average": average,
            "feedthrough": feedthrough,
            "shooting": shooting,
            "certificate": certificate,
            "seed": seed,
            "progress": PhasedProgress(show, phases),
            "stop": stop,
        }
        result: islands.Result | islands.CoupledResult
        if len(outputs) > 1:
            if dead_time:
                raise SettingsError("--dead-time is for one output: leave it out")
            if model == NARX and library == AUTO:
                given["library"] = SEVERAL_OUTPUTS
            record, held = couple_data(data, [held_out], len(outputs), steps, names)
            fit_all = partial(fit_coupled_data, split_coupled(record, held), **coupled_options(given))
            result = search_outputs(fit_all, out, stop, drawn)
        else:
            result = fit_record(data, held_out, on_models=keep_models(out), **given)
        result = result.with_wall_time(perf_counter() - began)
        show("figures", 1.0)
        drawing = Steps(stop=stop)
        result.save(out, drawing, drawn)
    show_result(result, out)
    stop.end(out, (*result.left_out, *drawing.left_out), REPEAT)
