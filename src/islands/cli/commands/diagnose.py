"""``islands diagnose``: errors of a simulation on a record, their causes, and the gain of a correction."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated, Any

import typer

from islands.cli import options, simulation_options
from islands.cli.console import output
from islands.cli.laboratory import import_laboratory
from islands.cli.output_folder import check_folder
from islands.cli.progress_display import Display, compile_kernels, progress
from islands.cli.recordings import Recordings
from islands.cli.runs.diagnosis_fits import explain_continuation, keep_fits, say_to_continue, write_fits
from islands.cli.runs.plan import (
    PLAN,
    PlanOptions,
    read_input,
    show_plan,
    write_plan,
)
from islands.cli.settings_options import with_settings
from islands.cli.stop_requests import REPEAT, StopRequests, stop_requests
from islands.diagnosis.calibration.fit_journal import FitJournal
from islands.diagnosis.detectability import SelfTest
from islands.diagnosis.findings import ResidualFormula
from islands.diagnosis.inference.verdict import Verdict
from islands.diagnosis.interim_findings import InterimFindings
from islands.diagnosis.planning.experiment_plan import plan_experiment
from islands.diagnosis.procedure import LEAST_FRACTION
from islands.diagnosis.procedure import diagnose as run_diagnosis
from islands.diagnosis.result import Diagnosis
from islands.diagnosis.settings import DiagnosisSettings
from islands.errors import SettingsError
from islands.facade.explain_residual import (
    BEFORE_FORMULA,
    BEFORE_REPORT,
    FORMULA,
    FormulaProgress,
    explain_residual,
)
from islands.facade.results.complete_diagnosis import DIAGNOSIS_FILE, DiagnosisResult
from islands.process_pool import process_pool
from islands.progress import Steps, report_part
from islands.records.dataset import Dataset
from islands.records.reading.options import ReadingOptions
from islands.records.split import hold_out
from islands.report.pages.origin import REPORT_FILE
from islands.report.text.layout import wrap
from islands.simulators.specification.code import FmuSpec
from islands.simulators.specification.factory import make_simulator
from islands.simulators.specification.table import ColumnSpec, innermost, parse_spec

if TYPE_CHECKING:
    from islands.evolution.search_state import SearchState
    from islands.evolution.settings import Settings

#: Name of a step without which a diagnosis is complete.
SELF_TEST = "self-test"

#: Module that computes it.
SELF_TEST_MODULE = "lab.diagnosis.self_test"


@with_settings
def diagnose(
    *,
    inputs: options.Inputs,
    out: options.Out,
    simulated: simulation_options.Simulated,
    records: Annotated[
        list[Path] | None,
        typer.Argument(metavar="RECORD...", help="Recordings of one system, as for fit; one for --plan."),
    ] = None,
    output_column: options.OutputOrNone = None,
    channels: simulation_options.Channels = None,
    settings: DiagnosisSettings,
    dt: options.SamplingTime = None,
    rows: options.Rows = None,
    validation: options.HeldOut = None,
    reading: ReadingOptions,
    seed: options.Seed = 0,
    tested: Annotated[
        bool,
        typer.Option(
            "--self-test",
            help="Estimate which effects this record can reveal; in a checkout, and takes minutes.",
        ),
    ] = False,
    planning: PlanOptions,
    workers: Annotated[
        int | None,
        typer.Option("--workers", min=1, help="Largest number of processes; by default one for each core."),
    ] = None,
    force: options.Force = False,
) -> None:
    """Find the errors of a simulation on recordings, name their causes, measure the gain of correction."""
    if planning.plan:
        _check_unused_by_plan(validation, settings.noise_level)
        check_folder(out, force, PLAN)
        columns_of_input = [simulation_options.single_input(options.columns(inputs)), *(channels or [])]
        data = read_input(records or [], columns_of_input, output_column, dt, rows, reading, planning)
        compile_kernels()
        _plan(data, simulated, settings.tolerance, planning, out, seed, workers)
        return
    if not records or output_column is None:
        raise SettingsError("a diagnosis needs a record and --output: give both, or --plan before any data")
    check_folder(out, force, DIAGNOSIS_FILE)
    self_test = import_laboratory(SELF_TEST_MODULE, "--self-test").self_test if tested else None
    # Read first: an error in a file is shown before the kernels are compiled, which takes a minute.
    with progress("diagnose") as show:
        show("reading", 0.0)
        spec = parse_spec(simulated)
        inner = innermost(spec)
        column = inner.column if isinstance(inner, ColumnSpec) else None
        data, columns = _read_record(
            *(records, validation, options.columns(inputs), channels or [], column),
            *(output_column, dt, rows, reading),
        )
        if isinstance(inner, FmuSpec):
            inner.make_model()
    compile_kernels()
    with progress("diagnose", BEFORE_FORMULA * LEAST_FRACTION) as show:
        simulator = make_simulator(spec, data, columns)
        tolerances = settings.tolerance
        began = perf_counter()
        report = report_part(show, 0.0, BEFORE_FORMULA)
        run = partial(
            run_diagnosis, data, simulator, tolerances, seed, report, noise_level=settings.noise_level
        )
        diagnosis, fits, before = _diagnose_until_stopped(run, out, seed, workers)
        with stop_requests(before) as stop:
            steps = Steps(show, stop)
            show(FORMULA, BEFORE_FORMULA)
            formula = _find_formula(diagnosis, seed, steps, show)
            wall = perf_counter() - began
            limits = None
            if self_test is not None and diagnosis.verdict != Verdict.GROSS_ERROR:
                limits = _run_self_test(
                    partial(self_test, diagnosis, simulator, tolerances, seed), workers, steps
                )
            show(REPORT_FILE, BEFORE_REPORT)
            found = DiagnosisResult.from_diagnosis(diagnosis, formula, limits, wall)
            # Further processes of the same fork server, which has loaded matplotlib. A signal has ended it.
            day = datetime.now(UTC).date()
            with process_pool(workers if before is None else 1, start_after=0.0) as parallel:
                found.save(out, ", ".join(path.name for path in records), steps, parallel, day)
            if steps.left_out:
                write_fits(out, fits)
        found = replace(found, not_computed={**found.not_computed, **steps.not_computed})
    for paragraph in found.summary.splitlines():
        output.print("\n".join(wrap(paragraph, "    ")), markup=False)
    output.print(f"{out}/: {', '.join(path.name for path in sorted(out.iterdir()))}", markup=False)
    stop.end(out, (*diagnosis.left_out, *steps.left_out), explain_continuation(out))


def _check_unused_by_plan(validation: Path | None, noise_level: float | None) -> None:
    """Refuse options of a diagnosis that a plan does not have."""
    if validation:
        raise SettingsError("--validation is for a diagnosis: leave it out of a plan")
    if noise_level is not None:
        raise SettingsError("--noise-level is for a diagnosis: a plan has --set noise_std")


def _plan(
    data: Dataset,
    simulated: str,
    tolerances: Mapping[str, float],
    planning: PlanOptions,
    out: Path,
    seed: int,
    workers: int | None,
) -> None:
    """Compare the causes that an experiment can tell apart, write the plan and print it."""
    simulator = make_simulator(parse_spec(simulated), data)
    with progress("plan") as show, stop_requests() as stop:
        steps = Steps(show, stop)
        with process_pool(workers, check=partial(steps.check, "comparison of the causes")) as parallel:
            plan = plan_experiment(
                *(data, simulator, planning.noise_std, tolerances, planning.pair),
                *(planning.limits, seed, parallel, steps),
            )
        show("figure", 1.0)
        write_plan(plan, out)
    show_plan(plan, out)
    stop.end(out, plan.left_out, REPEAT)


def _diagnose_until_stopped(
    run: Callable[..., Diagnosis], out: Path, seed: int, workers: int | None
) -> tuple[Diagnosis, FitJournal, StopRequests | None]:
    """Run a diagnosis; if a signal ends it, return the findings so far, and the request to stop.

    Raises
    ------
    KeyboardInterrupt
        The signal arrived before the first result.
    """
    interim = InterimFindings()
    try:
        with keep_fits(out) as fits, process_pool(workers) as parallel:
            return run(fits.record(parallel), interim=interim), fits, None
    except KeyboardInterrupt as interrupt:
        with stop_requests(StopRequests(interrupt)) as stop:
            found = interim.make_diagnosis(seed)
        if found is None:
            say_to_continue(out)
            raise
        return found, fits, stop


def _find_formula(diagnosis: Diagnosis, seed: int, steps: Steps, show: Display) -> ResidualFormula | None:
    """Search for a formula of the residual, as an optional step."""
    if diagnosis.left_out:
        steps.skip(FORMULA)
        return None
    progress = FormulaProgress()

    def count_epochs(state: "SearchState", settings: "Settings") -> None:
        fraction, left = progress.measure(state, settings, perf_counter())
        show(FORMULA, fraction, seconds_left=left)

    stop = partial(steps.skip, FORMULA)
    return steps.attempt(
        FORMULA, partial(explain_residual, diagnosis, seed, on_epoch=count_epochs, stop=stop)
    )


def _run_self_test(test: Callable[..., SelfTest], workers: int | None, steps: Steps) -> SelfTest | None:
    """Run the self-test, as an optional step, with a separate progress bar."""

    def update(message: str, fraction: float | None = None, /) -> None:
        steps.report(f"{SELF_TEST}, {message}", fraction)

    def run() -> SelfTest:
        steps.report(SELF_TEST, 0.0)
        with process_pool(workers, check=partial(steps.check, SELF_TEST)) as parallel:
            return test(parallel, progress=update)

    return steps.attempt(SELF_TEST, run)


def _read_record(
    records: list[Path],
    validation: Path | None,
    inputs: list[str],
    channels: list[str],
    column: str | None,
    output_column: str,
    dt: float | None,
    rows: str | None,
    reading: ReadingOptions,
) -> tuple[Dataset, Mapping[str, Any]]:
    """Read the recordings, and separately the column of a simulation that was recorded in them."""
    extra = [] if column is None else [column]
    names = [simulation_options.single_input(inputs), *channels, *extra]
    recordings = Recordings(records, names, [output_column], dt, reading, resting_inputs=True, signals=extra)
    (whole,) = recordings.read(rows).records
    if validation is not None:
        whole = hold_out(whole, replace(recordings, paths=[validation]).read().records[0])
    kept = 1 + len(channels)
    return whole.first_inputs(kept), {} if column is None else {column: whole.u[:, kept]}
