"""``islands examples``: records to try the commands on."""

from pathlib import Path
from typing import Annotated

import typer

from islands.cli.console import output
from islands.errors import SettingsError
from islands.records.writer import write_record
from islands.systems.example_records import EXAMPLE_RECORDS


def examples(
    folder: Annotated[
        Path | None, typer.Argument(help="Folder for the files; without one, the records are listed.")
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace files that exist.")] = False,
) -> None:
    """List records to try the commands on, or write them as CSV into a folder."""
    if folder is None:
        for name, example in EXAMPLE_RECORDS.items():
            output.print(f"{name}.csv  {example.description}", markup=False)
        return
    paths = {name: folder / f"{name}.csv" for name in EXAMPLE_RECORDS}
    if not force and (present := [path for path in paths.values() if path.exists()]):
        raise SettingsError(f"{present[0]} exists: give another folder, or --force to replace it")
    folder.mkdir(parents=True, exist_ok=True)
    for name, path in paths.items():
        record = EXAMPLE_RECORDS[name].make()
        write_record(record, path)
        columns = f"--input {record.input_names[0]} --output {record.output_name}"
        output.print(f"{path}: {EXAMPLE_RECORDS[name].description}\n  {columns}", markup=False)
