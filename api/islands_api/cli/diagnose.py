"""``islands diagnose``: what a simulation gets wrong about a record, why, and what mending it is worth."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from time import perf_counter
from typing import Annotated, Any

import typer

from islands.data.dataset import Dataset
from islands.discrepancy.diagnosis import Diagnosis
from islands.discrepancy.diagnosis import diagnose as diagnosed
from islands.errors import SettingsError
from islands.io.diagnoses import diagnosis_json, extended_json
from islands.io.records import read_record
from islands.io.simulations import SIMULATIONS, column_of, simulation
from islands_api.cli import options
from islands_api.cli.console import compile_kernels, output, progress
from islands_api.cli.fit import check_folder
from islands_service.diagnosis_report import in_words, report
from islands_service.rows import rows_of

#: Files of a result.
RESULT, EXTENDED, REPORT = "discrepancy.json", "extended.json", "report.html"


def diagnose(
    record: options.Record,
    inputs: options.Inputs,
    output_column: options.Output,
    out: Annotated[Path, typer.Option("--out", help="Folder for the result.")],
    simulated: Annotated[
        str,
        typer.Option("--simulation", help=f"{', '.join(SIMULATIONS)}; after a colon what it needs."),
    ],
    channels: Annotated[
        list[str] | None,
        typer.Option("--channel", help="Column that may couple in, a temperature perhaps."),
    ] = None,
    tolerance: Annotated[
        list[str] | None,
        typer.Option("--tolerance", help="PARAM=REL: how well a parameter is known, 0.02 for 2 %."),
    ] = None,
    dt: options.SamplingTime = None,
    rows: options.Rows = None,
    seed: Annotated[int, typer.Option("--seed", min=0)] = 0,
    force: Annotated[bool, typer.Option("--force", help="Replace a result that is in the folder.")] = False,
) -> None:
    """Show what a simulation gets wrong about a record, name the cause, and measure the gain."""
    check_folder(out, force, RESULT)
    compile_kernels()
    with progress("diagnose") as tell:
        tell("reading", 0.0)
        data, columns = _read(
            record, options.columns(inputs), channels or [], simulated, output_column, dt, rows
        )
        core = simulation(simulated, data, columns)
        began = perf_counter()
        found = diagnosed(data, core, _tolerances(tolerance or []), seed, lambda line: tell(line, 0.5))
        wall = perf_counter() - began
        tell("figures", 0.9)
        write(found, out, record.name, wall)
    output.print(in_words(found), markup=False)
    output.print(f"{out}/: {', '.join(path.name for path in sorted(out.iterdir()))}", markup=False)


def write(found: Diagnosis, folder: Path, name: str, wall_s: float) -> None:
    """Write a diagnosis: the document last, so that where it is everything is."""
    folder.mkdir(parents=True, exist_ok=True)
    for path in (folder / EXTENDED, folder / RESULT):
        path.unlink(missing_ok=True)
    (folder / REPORT).write_bytes(report(name, found))
    if found.gain is not None:
        (folder / EXTENDED).write_text(extended_json(found))
    (folder / RESULT).write_text(diagnosis_json(found, wall_s))


def _read(
    record: Path,
    inputs: list[str],
    channels: list[str],
    spec: str,
    output_column: str,
    dt: float | None,
    rows: str | None,
) -> tuple[Dataset, Mapping[str, Any]]:
    """Read the record, and beside it the column that is the simulation, if one is."""
    if len(inputs) != 1:
        raise SettingsError(
            f"a simulation is driven by one input, got {', '.join(inputs)}: give the others as --channel"
        )
    column = column_of(spec)
    beside = [] if column is None else [column]
    whole = read_record(record, [*inputs, *channels, *beside], output_column, dt, rows_of(rows))
    kept = 1 + len(channels)
    data = replace(
        whole, u=whole.u[:, :kept], input_names=whole.input_names[:kept], input_units=whole.input_units[:kept]
    )
    return data, {} if column is None else {column: whole.u[:, kept]}


def _tolerances(texts: list[str]) -> dict[str, float]:
    found = {}
    for text in texts:
        name, _, value = text.partition("=")
        try:
            found[name] = float(value)
        except ValueError:
            raise SettingsError(f"--tolerance {text}: write PARAM=REL, for example dp=0.01") from None
    return found
