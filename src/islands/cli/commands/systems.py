"""``islands systems``: list of the simulated systems, and records of them."""

from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from islands.cli import options
from islands.cli.console import output
from islands.errors import SettingsError
from islands.records.writer import write_record
from islands.systems.catalogue import SYSTEMS, make_record


def systems(
    system: Annotated[
        str | None, typer.Argument(help="A system; without one, all are listed with variants and parts.")
    ] = None,
    out: Annotated[Path | None, typer.Option("--out", help="CSV file to write.")] = None,
    variant: Annotated[str | None, typer.Option("--variant", help="The first by default.")] = None,
    part: Annotated[str, typer.Option("--part", help="Part of the record.")] = "estimation",
    seed: options.Seed = 0,
) -> None:
    """List simulated systems, or write a record of one as CSV without rounding."""
    if system is None:
        table = Table("system", "description", "variants", "parts")
        for name, entry in SYSTEMS.items():
            table.add_row(name, entry.description, ", ".join(entry.variants), ", ".join(entry.parts))
        output.print(table)
        return
    if out is None:
        raise SettingsError(f"a record of {system} is written to a file: give --out FILE")
    chosen = variant or (SYSTEMS[system].variants[0] if system in SYSTEMS else "")
    record = make_record(system, chosen, part, seed)
    write_record(record, out)
    names = f"{', '.join(record.input_names)} to {record.output_name}"
    output.print(f"{out}: {record.samples} samples, {names}", markup=False)
