"""``islands examples``: records to try the commands on, and records of simulated systems."""

from pathlib import Path
from typing import Annotated

import typer

from islands.cli.console import output
from islands.cli.settings_options import Given, with_settings
from islands.errors import SettingsError
from islands.records.dataset import Dataset
from islands.records.writer import write_record
from islands.settings_schema import Integer, setting, settings_class
from islands.systems.catalogue import SYSTEMS, make_record
from islands.systems.example_records import EXAMPLE_RECORDS


@settings_class
class SystemSettings:
    """Settings of the record of a simulated system."""

    variant: str = setting("", "Variant of the system; by default its first.")
    part: str = setting("estimation", "Part of the record.")
    seed: Integer = setting(0, "Seed of the random generator.", ge=0)


@with_settings
def examples(
    *,
    path: Annotated[
        Path | None,
        typer.Argument(
            help="Folder for the files, or file for the record of --system; without it, all are listed."
        ),
    ] = None,
    system: Annotated[
        str | None, typer.Option("--system", help="Simulated system whose record is written, unrounded.")
    ] = None,
    changes: Annotated[Given, SystemSettings],
    force: Annotated[bool, typer.Option("--force", help="Replace files that exist.")] = False,
) -> None:
    """List records to try the commands on and simulated systems, or write their records as CSV."""
    if system is None and changes:
        raise SettingsError(f"{next(iter(changes))} is a setting of simulated systems: add --system NAME")
    if path is None:
        _list()
        return
    if system is not None:
        settings = SystemSettings(**changes)
        variant = settings.variant or (SYSTEMS[system].variants[0] if system in SYSTEMS else "")
        files = {path: (make_record(system, variant, settings.part, settings.seed), "")}
    else:
        files = {
            path / f"{name}.csv": (entry.make(), entry.description) for name, entry in EXAMPLE_RECORDS.items()
        }
    if not force and (present := [each for each in files if each.exists()]):
        raise SettingsError(f"{present[0]} exists: give another path, or --force to replace it")
    if system is None:
        path.mkdir(parents=True, exist_ok=True)
    for each, (record, description) in files.items():
        write_record(record, each)
        output.print(
            f"{each}: {description or f'{record.samples} samples'}\n  {_name_columns(record)}", markup=False
        )


def _list() -> None:
    for name, entry in EXAMPLE_RECORDS.items():
        output.print(f"{name}.csv  {entry.description}", markup=False)
    output.print("\nSimulated systems, their variants and their parts:", markup=False)
    for name, system in SYSTEMS.items():
        output.print(
            f"{name}  {system.description}\n  {', '.join(system.variants)}; {', '.join(system.parts)}",
            markup=False,
        )


def _name_columns(record: Dataset) -> str:
    return f"--input {','.join(record.input_names)} --output {record.output_name}"
