"""``islands systems``: list of the simulated systems, and records of them."""

from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from islands.cli.console import output
from islands.records.writer import write_record
from islands.systems.catalogue import SYSTEMS, make_record

systems = typer.Typer(
    help="Simulated systems: list them, make records of them.", no_args_is_help=True, add_completion=False
)


@systems.command("list")
def list_systems() -> None:
    """List the systems with their variants and the parts that can be made."""
    table = Table("system", "description", "variants", "parts")
    for name, entry in SYSTEMS.items():
        table.add_row(name, entry.description, ", ".join(entry.variants), ", ".join(entry.parts))
    output.print(table)


@systems.command()
def make(
    system: Annotated[str, typer.Argument(help="A name from the list.")],
    out: Annotated[Path, typer.Option("--out", help="CSV file to write.")],
    variant: Annotated[str | None, typer.Option("--variant", help="The first by default.")] = None,
    part: Annotated[
        str, typer.Option("--part", help="Part of the record; `islands systems list` lists them.")
    ] = "estimation",
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of the random generator.")] = 0,
) -> None:
    """Make a record and write it as CSV without rounding."""
    chosen = variant or (SYSTEMS[system].variants[0] if system in SYSTEMS else "")
    record = make_record(system, chosen, part, seed)
    write_record(record, out)
    names = f"{', '.join(record.input_names)} to {record.output_name}"
    output.print(f"{out}: {record.samples} samples, {names}", markup=False)
