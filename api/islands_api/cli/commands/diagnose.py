"""``islands diagnose``: what a simulation gets wrong about a record, why, and what mending it is worth."""

from collections.abc import Mapping
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from time import perf_counter
from typing import Annotated, Any

import typer

from islands.data.dataset import Dataset
from islands.discrepancy.detectability import SelfTest, self_test
from islands.discrepancy.diagnosis import Diagnosis, ResidualFormula
from islands.discrepancy.diagnosis import diagnose as diagnosed
from islands.discrepancy.interfaces.parallel import ParallelMap
from islands.discrepancy.interfaces.simulator import Simulator
from islands.facade.explain_residual import explain_residual
from islands.io.diagnosis_json import as_json, diagnosis_document
from islands.io.records import read_record
from islands.io.records.row_range import parse_rows
from islands.io.simulator_spec.document import extended_json
from islands.io.simulator_spec.factory import make_simulator
from islands.io.simulator_spec.specification import ColumnSpec, innermost, parse_spec
from islands_api.cli import options
from islands_api.cli.console import Display, compile_kernels, output, progress
from islands_api.cli.output_folder import check_folder
from islands_service.reports.diagnosis_report import diagnosis_report, summarise, summarise_self_test

#: Files of a result.
RESULT, EXTENDED, REPORT = "discrepancy.json", "extended.json", "report.html"


def diagnose(
    record: options.Record,
    inputs: options.Inputs,
    output_column: options.Output,
    out: Annotated[Path, typer.Option("--out", help="Folder for the result.")],
    simulated: options.Simulated,
    channels: options.Channels = None,
    tolerance: options.Tolerances = None,
    dt: options.SamplingTime = None,
    rows: options.Rows = None,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of the random generator.")] = 0,
    tested: Annotated[
        bool,
        typer.Option("--self-test", help="Find out what this record could show: takes minutes."),
    ] = False,
    workers: Annotated[
        int | None,
        typer.Option("--workers", min=1, help="Cores; by default 1, for the self-test all."),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace a result that is in the folder.")] = False,
) -> None:
    """Show what a simulation gets wrong about a record, name the cause, and measure the gain."""
    check_folder(out, force, RESULT)
    compile_kernels()
    with progress("diagnose") as tell:
        tell("reading", 0.0)
        asked = parse_spec(simulated)
        inner = innermost(asked)
        column = inner.column if isinstance(inner, ColumnSpec) else None
        data, columns = _read(
            record, options.columns(inputs), channels or [], column, output_column, dt, rows
        )
        simulator = make_simulator(asked, data, columns)
        known = options.tolerances(tolerance or [])
        with _cores(workers, tested) as spread:
            began = perf_counter()
            found = diagnosed(data, simulator, known, seed, tell, spread)
            tell("a formula for what has no name", 0.8)
            proposal = explain_residual(found, seed)
            wall = perf_counter() - began
            shown = _self_tested(found, simulator, known, seed, spread, tell) if tested else None
        tell("figures", 0.9)
        write(found, out, record.name, wall, shown, proposal)
    output.print(summarise(found, proposal), markup=False)
    if shown is not None:
        output.print(summarise_self_test(shown), markup=False)
    output.print(f"{out}/: {', '.join(path.name for path in sorted(out.iterdir()))}", markup=False)


def write(
    found: Diagnosis,
    folder: Path,
    name: str,
    wall_s: float,
    tested: SelfTest | None = None,
    proposal: ResidualFormula | None = None,
) -> None:
    """Write a diagnosis: the document last, so that where it is everything is."""
    folder.mkdir(parents=True, exist_ok=True)
    for path in (folder / EXTENDED, folder / RESULT):
        path.unlink(missing_ok=True)
    (folder / REPORT).write_bytes(diagnosis_report(name, found, tested, proposal))
    if found.gain is not None:
        (folder / EXTENDED).write_text(extended_json(found.best, found.record))
    document = diagnosis_document(found, wall_s, tested, proposal)
    (folder / RESULT).write_text(as_json(document))


def _self_tested(
    found: Diagnosis,
    simulator: Simulator,
    tolerance: Mapping[str, float],
    seed: int,
    spread: ParallelMap,
    tell: Display,
) -> SelfTest:
    """Carry out the self-test, and show how long it will take."""
    tell("self-test", 0.0)
    began = perf_counter()

    def show(message: str, fraction: float | None = None, /) -> None:
        left = (perf_counter() - began) * (1 / fraction - 1) if fraction else 0.0
        tell(f"self-test, {message}, {_duration(left)} left", fraction)

    return self_test(found, simulator, tolerance, seed, spread, progress=show)


def _cores(workers: int | None, tested: bool) -> AbstractContextManager[ParallelMap]:
    if workers == 1 or (workers is None and not tested):
        return nullcontext(map)
    # An analysis of some seconds need not wait for Ray.
    from islands_service.runtime.parallel_map import ray_pool  # noqa: PLC0415

    return ray_pool(workers)


def _duration(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 100 else f"{seconds / 60:.0f} min"


def _read(
    record: Path,
    inputs: list[str],
    channels: list[str],
    column: str | None,
    output_column: str,
    dt: float | None,
    rows: str | None,
) -> tuple[Dataset, Mapping[str, Any]]:
    """Read the record, and beside it the column that is the simulation, if one is."""
    beside = [] if column is None else [column]
    whole = read_record(
        record, [options.single_input(inputs), *channels, *beside], output_column, dt, parse_rows(rows)
    )
    kept = 1 + len(channels)
    return whole.first_inputs(kept), {} if column is None else {column: whole.u[:, kept]}
