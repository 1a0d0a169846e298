"""``islands bench``: evaluation speed of this machine, compared with plain numpy and compiled C."""

import json
import os
from collections.abc import Sequence
from multiprocessing import get_context
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from islands.cli.console import output
from islands.cli.output_folder import check_folder
from islands.cli.progress_display import compile_kernels, progress
from islands.errors import IslandsError
from islands.process_pool import block_sigint
from islands.processes import THREADS
from islands.progress import ProgressCallback
from lab.speed.report import BenchmarkReport, check_goals, to_document
from lab.speed.run import measure
from lab.speed.scaling import save_scalings


def bench(
    quick: Annotated[
        bool, typer.Option("--quick", help="At most a minute: fewer individuals, no whole run of case 1.")
    ] = False,
    json_file: Annotated[Path | None, typer.Option("--json", help="JSON file to write.")] = None,
    out: Annotated[Path, typer.Option("--out", help="Folder for the figures.")] = Path("bench-out"),
) -> None:
    """Measure evaluations, kernels and whole searches on this machine, which should be otherwise idle."""
    check_folder(out, force=True)
    if json_file is not None:
        check_folder(json_file.parent, force=True)
    compile_kernels()
    with progress("bench") as show:
        report = _run_measurement(quick, show)
        show("figures", 1.0)
        figures = save_scalings(report.scalings, out)
    if json_file is not None:
        json_file.parent.mkdir(parents=True, exist_ok=True)
        json_file.write_text(json.dumps(to_document(report), indent=2) + "\n", encoding="utf-8")
    _print_report(report)
    for path in (*figures, *([json_file] if json_file else [])):
        output.print(str(path), markup=False)


def _run_measurement(quick: bool, show: ProgressCallback) -> BenchmarkReport:
    """Measure in a separate process with one thread per linear algebra library.

    A library reads the number of threads when it is loaded. Its threads busy-wait, which would count as CPU
    time of plain numpy.
    """
    os.environ.update(dict.fromkeys(THREADS, "1"))
    context = get_context("spawn")
    receiving, sending = context.Pipe(duplex=False)
    process = context.Process(target=_measure, args=(quick, sending))
    with block_sigint():  # this process receives Ctrl-C and ends the other one
        process.start()
    sending.close()
    try:
        return _receive_report(receiving, show)
    finally:
        process.terminate()  # no effect on a process that has ended
        process.join()


def _receive_report(receiving: Connection, show: ProgressCallback) -> BenchmarkReport:
    """Show the progress messages of the measuring process until it sends its report or error."""
    while True:
        try:
            message = receiving.recv()
        except EOFError as error:
            raise ChildProcessError(
                "the measuring process ended early: see its output above, or check whether the system "
                "stopped it because memory ran out"
            ) from error
        match message:
            case str(text), float(fraction):
                show(text, fraction)
            case BenchmarkReport():
                return message
            case _:
                raise message


def _measure(quick: bool, sending: Connection) -> None:
    try:
        sending.send(
            measure(quick, lambda text, fraction=None, /: sending.send((text, float(fraction or 0.0))))
        )
    except IslandsError as error:
        sending.send(error)


def _print_report(report: BenchmarkReport) -> None:
    _print_times(report)
    _print_searches(report)
    _print_goals(report)
    machine = report.machine
    output.print(
        f"workload {report.workload[:12]}, {machine.processor}, {machine.cores} cores, "
        f"C: {machine.compiler or 'no compiler called cc'}, yardstick {machine.yardstick_s:.2f} s",
        markup=False,
    )


def _print_times(report: BenchmarkReport) -> None:
    table = Table("ms of CPU per individual", *report.kinds, title=f"{report.samples} samples, medians")
    kinds = report.kinds
    rows: dict[str, Sequence[float | None]] = {
        "plain numpy": [each.numpy_ms for each in kinds.values()],
        "nothing cached": [each.uncached_ms for each in kinds.values()],
        "inner products cached": [each.cached_ms for each in kinds.values()],
        "amortised over a search": [report.amortised_ms(kind) if kind == "gp" else None for kind in kinds],
        "simulation, plain numpy": [each.numpy_simulation_ms for each in kinds.values()],
        "simulation": [each.simulation_ms for each in kinds.values()],
        "simulation, C for each individual": [each.c_simulation_ms for each in kinds.values()],
        "Gram matrix": [each.gram_ms for each in kinds.values()],
        "Gram matrix, share of peak": [report.gram_fraction_of_peak(kind) for kind in kinds],
    }
    for name, values in rows.items():
        table.add_row(name, *("-" if value is None else f"{value:.3f}" for value in values))
    output.print(table)


def _print_searches(report: BenchmarkReport) -> None:
    runs = report.runs.values()
    table = Table("search of one island", *report.runs)
    table.add_row("individuals per second and core", *(f"{run.per_cpu_second:.0f}" for run in runs))
    known = (100.0 * run.duplicates / run.evaluations for run in runs)
    table.add_row("of them known structures, %", *(f"{share:.1f}" for share in known))
    for name in next(iter(runs)).caches:
        table.add_row(name.replace("_", " "), *(str(run.caches[name]) for run in runs))
    output.print(table)


def _print_goals(report: BenchmarkReport) -> None:
    table = Table("goal", "wanted", "measured", "met")
    for goal in check_goals(report):
        met = {True: "[green]yes[/]", False: "[red]no[/]", None: "-"}[goal.met]
        table.add_row(goal.text, goal.wanted, goal.measured, met)
    output.print(table)
