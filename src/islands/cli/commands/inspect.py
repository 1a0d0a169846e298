"""``islands inspect``: columns, sampling and facts of a file before a model is sought."""

import json
from pathlib import Path
from typing import Annotated

import typer

from islands.cli import options
from islands.cli.console import errors
from islands.cli.settings_options import with_settings
from islands.facade.inspect_record import inspect_record
from islands.records.reading.options import ReadingOptions
from islands.records.reading.row_range import parse_rows
from islands.report.text.inspection import format_inspection


@with_settings
def inspect(
    *,
    record: options.Record,
    inputs: options.InputsOrNone = None,
    output_column: options.OutputOrNone = None,
    dt: options.SamplingTime = None,
    rows: options.Rows = None,
    reading: ReadingOptions,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print a JSON document (schema islands.records.inspection/1).")
    ] = False,
    out: Annotated[
        Path | None,
        typer.Option("--out", help="Folder for inspection.json, inspection.txt and the overview figure."),
    ] = None,
) -> None:
    """Describe a record: columns, sampling, dead time, noise, excitation, and the next command."""
    found = inspect_record(
        *(record, options.columns(inputs or []), output_column, dt, parse_rows(rows)),
        reading,
    )
    document = json.dumps(found.as_document(), indent=2, ensure_ascii=False, allow_nan=False) + "\n"
    text = format_inspection(found)
    if out is not None:
        _write(out, document, text)
        if found.record is not None:
            # Imported here, because it loads matplotlib.
            from islands.report.figures.overview import draw_overview  # noqa: PLC0415
            from islands.report.figures.style import THEMES, save  # noqa: PLC0415

            for theme in THEMES:
                suffix = "" if theme == "light" else f"-{theme}"
                save(draw_overview(found.record, found.facts, theme), out / f"overview{suffix}.svg")
        errors.print(f"{out}: inspection.json, inspection.txt, overview.svg", markup=False)
    typer.echo(document if as_json else text, nl=False)


def _write(folder: Path, document: str, text: str) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "inspection.json").write_text(document, encoding="utf-8")
    (folder / "inspection.txt").write_text(text, encoding="utf-8")
