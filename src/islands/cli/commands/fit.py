"""``islands fit``: forward selection from a library with (constrained) least squares."""

from functools import partial
from time import perf_counter
from typing import Annotated

from islands.cli import options
from islands.cli.output_folder import check_folder, keep_models, run_search, show_result
from islands.cli.progress_display import compile_kernels, progress
from islands.cli.recordings import Recordings, state_extrapolation
from islands.cli.settings_options import Given, with_settings
from islands.cli.stop_requests import REPEAT, stop_requests
from islands.evolution.settings import NARX
from islands.facade.fit_settings import FitSettings
from islands.facade.identification_progress import class_phases, fit_phases
from islands.progress import PhasedProgress, Steps
from islands.records.preprocessing_steps import PreprocessingSteps
from islands.records.reading.options import ReadingOptions
from islands.report.figures.names import OVERVIEW_TEXT, parse_figures


@with_settings
def fit(
    *,
    records: options.Records,
    inputs: options.Inputs,
    output_columns: options.Outputs,
    out: options.Out,
    dt: options.SamplingTime = None,
    rows: options.Rows = None,
    reading: ReadingOptions,
    steps: PreprocessingSteps,
    validation: options.Validation = None,
    changes: Annotated[Given, FitSettings],
    seed: options.Seed = 0,
    force: options.Force = False,
    figures: options.Figures = OVERVIEW_TEXT,
) -> None:
    """Fit small models to recordings of a system by subset selection and least squares, and assess them."""
    check_folder(out, force)
    drawn, settings = parse_figures(figures), FitSettings(**changes)
    outputs = options.columns(output_columns)
    recordings = Recordings(records, options.columns(inputs), outputs, dt, reading, steps)
    # Read first: an error in a file is shown before the kernels are compiled, which takes a minute.
    with progress("fit") as show:
        show("reading", 0.0)
        data = recordings.read(rows)
        held_out = recordings.read_held_out(validation, rows)
    state_extrapolation(data, held_out)
    compile_kernels()
    # The fits load the kernels, which the help of the command does not need.
    from islands.facade.fit import fit_record  # noqa: PLC0415

    with progress("fit") as show, stop_requests() as stop:
        began = perf_counter()
        phases = (
            fit_phases(settings.library, outputs)
            if settings.model == NARX
            else class_phases(settings.model, data.samples, outputs)
        )
        keep = keep_models(out, data.output_names, show)
        search = partial(
            fit_record,
            data,
            held_out,
            on_front=keep,
            on_models=keep,
            seed=seed,
            progress=PhasedProgress(show, phases),
            stop=stop,
            **changes,
        )
        result = run_search(search, out, stop, drawn)
        result = result.with_wall_time(perf_counter() - began)
        show("figures", 1.0)
        drawing = Steps(stop=stop)
        result.save(out, drawing, drawn)
    show_result(result, out)
    stop.end(out, (*result.left_out, *drawing.left_out), REPEAT)
