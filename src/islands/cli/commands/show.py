"""``islands show``: a model as text."""

from pathlib import Path
from typing import Annotated

import typer

import islands
from islands.cli import options
from islands.cli.console import output
from islands.cli.settings_options import with_settings
from islands.errors import SettingsError, lookup
from islands.export import EXPORTS, FILE_EXPORTS, MODEL_FILE, export_or_write
from islands.export.linear_system import find_notation, write_linear_system
from islands.models.coupled_narx import CoupledModel
from islands.models.equations import named_signals
from islands.models.operating_point import parse_levels
from islands.models.state_space import FORMS
from islands.persistence.saved_documents import RESULT, open_document, read_saved_model
from islands.records.coupled import couple, join_columns
from islands.records.reading import read_dataset
from islands.records.reading.options import ReadingOptions
from islands.records.reading.row_range import parse_rows
from islands.report.figures.names import LINEAR_FIGURES, MODEL_FIGURES
from islands.report.pages.origin import REPORT_FILE
from islands.report.text.layout import front_table, term_table, wrap

#: Formats of a result folder: its report, and the table of its models.
REPORT, FRONT = "report", "front"


@with_settings
def show(
    *,
    model: options.ModelFile,
    kind: Annotated[
        str | None,
        typer.Option(
            "--format",
            help=f"{', '.join([*EXPORTS, *FILE_EXPORTS, *FORMS, REPORT, FRONT])}. By default one term in "
            "each line, with its standard error and the columns of the record.",
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            help="File to write; required for fmu and fmu2, and report.html in the folder for a report. A "
            "linear system is written for MATLAB to a file .m, as JSON to .json.",
        ),
    ] = None,
    figure: Annotated[
        str | None,
        typer.Option(
            "--figure",
            help=f"Draw {', '.join(MODEL_FIGURES)} of the model on --record into --out, as SVG; "
            f"{', '.join(LINEAR_FIGURES)} of its linear system need no record.",
        ),
    ] = None,
    record: Annotated[Path | None, typer.Option("--record", help="Record of --figure.")] = None,
    at: Annotated[
        list[str] | None,
        typer.Option(
            "--at",
            help="INPUT=VALUE: operating point of a linear system; by default that of the model, or the "
            "middle of the range of its data. Name the output, too, if the model rests at several.",
        ),
    ] = None,
    continuous: Annotated[
        str | None,
        typer.Option(
            "--continuous",
            help="Linear system in continuous time: zoh, the one with these samples at inputs that are held "
            "between them, or tustin.",
        ),
    ] = None,
    dt: options.SamplingTime = None,
    rows: options.Rows = None,
    reading: ReadingOptions,
) -> None:
    """Show or write a model as an equation, a program, a block for a simulator, or JSON.

    Equations: plain text, LaTeX, MathML. Programs: Python, C, MATLAB. Blocks: FMU of
    FMI 3.0 and 2.0, Simulink S-function, MATLAB System, Modelica. An extended
    simulation is a program in C or MATLAB; one with a closed form is exported like a
    model, a model of several outputs as one program or block.

    Linear systems for the design of controllers: state-space, transfer-function.

    The report of a result folder is one HTML file, which prints on A4, with its figures.
    Its front is a table of all models: form, size, error and equation.
    """
    if kind in FORMS or figure in LINEAR_FIGURES:
        if continuous and kind is None:
            raise SettingsError(f"--continuous is for the formats {', '.join(FORMS)}")
        if record is not None:
            raise SettingsError("--record is for figures of the model on data: a linear system needs none")
        levels = parse_levels(options.columns(at or []), "--at")
        _show_linear(model, kind, figure, out, levels, continuous)
        return
    if at or continuous:
        raise SettingsError(
            f"--{'at' if at else 'continuous'} is for the formats {', '.join(FORMS)}"
            + (" and for figures of linear systems" if at else "")
        )
    if figure is not None:
        _draw(model, figure, record, out, dt, parse_rows(rows), reading)
        return
    if record is not None:
        raise SettingsError("--record is for --figure: name one")
    if kind == FRONT:
        _show_front(model)
        return
    if kind == REPORT:
        _write_report(Path(model), out)
        return
    # `load` imports the search and its kernels, which takes longer than everything else. A model file has the
    # uncertainty of a result.
    is_plain = Path(model).exists() and kind != MODEL_FILE
    found = read_saved_model(open_document(model)) if is_plain else None
    if found is None:
        loaded = islands.load(model)
        if kind == MODEL_FILE or not isinstance(loaded, islands.FittedModel):
            _print(loaded.export(kind or "plain", out))
            return
        found = loaded.model
    if kind is None and out is None and not isinstance(found, CoupledModel):
        stated = named_signals(found)
        _print("\n".join([*term_table(found), *(wrap(f"where {stated}") if stated else [])]))
        return
    _print(export_or_write(found, kind or "plain", out))


def _show_front(folder: str) -> None:
    saved = open_document(folder)
    if saved.schema != "islands.result":
        raise SettingsError(f"{folder} is not the folder of a result: --format {FRONT} lists its models")
    _print("\n".join(front_table(saved.content)))


def _write_report(folder: Path, out: Path | None) -> None:
    # The models take a second to import.
    from islands.facade.results.reader import read_result  # noqa: PLC0415
    from islands.report.pages.identification import report_saved_result  # noqa: PLC0415

    if not folder.exists():
        raise SettingsError(f"there is no folder {folder}: a report is of the folder of a result")
    path = out or (folder if folder.is_dir() else folder.parent) / REPORT_FILE
    if open_document(folder).schema == RESULT:
        read_result(folder if folder.is_dir() else folder.parent).report(path)
    else:
        path.write_bytes(report_saved_result(folder))
    output.print(path, markup=False, highlight=False, soft_wrap=True)


def _print(text: str | None) -> None:
    if text is not None:
        typer.echo(text.rstrip("\n"))


def _show_linear(
    name: str,
    form: str | None,
    figure: str | None,
    out: Path | None,
    values: dict[str, float],
    continuous: str | None,
) -> None:
    """Write the linear system of a model, or draw it."""
    # The classes of results take a second to import, as `load` does.
    from islands.facade.results.model_analysis import split_point  # noqa: PLC0415

    loaded = islands.load(name)
    if not isinstance(loaded, islands.Result | islands.FittedModel):
        raise SettingsError(f"a linear system is that of a model, and {name} is none")
    model = loaded.best.model if isinstance(loaded, islands.Result) else loaded.model
    at = split_point(model, values)
    if form is None:
        if out is None:
            raise SettingsError(f"--figure {figure} is an SVG file: give --out FILE")
        from islands.report.figures.style import save  # noqa: PLC0415 - matplotlib takes half a second

        save(loaded.plot_linear(figure or LINEAR_FIGURES[0], *at), out)
        return
    system = loaded.linearise(*at)
    if continuous:
        system = system.to_continuous(continuous)
    text = write_linear_system(system, form, find_notation(out))
    _print(text if out is None else None)
    if out is not None:
        out.write_text(f"{text}\n", encoding="utf-8")


def _draw(
    name: str,
    figure: str,
    record: Path | None,
    out: Path | None,
    dt: float | None,
    rows: slice | None,
    reading: ReadingOptions,
) -> None:
    """Draw a figure of a model on a record."""
    lookup(dict.fromkeys(MODEL_FIGURES), figure, "figure")
    if record is None or out is None:
        raise SettingsError(
            f"--figure {figure} draws the model on a record: give --record FILE and --out FILE"
        )
    loaded = islands.load(name)
    model = loaded.best if isinstance(loaded, islands.Result) else loaded
    if not isinstance(model, islands.FittedModel):
        raise SettingsError(f"--figure is that of a model, and {name} is none")
    stated = model.model
    columns, first = join_columns(stated.column_names, model.output_names)
    data = read_dataset(record, columns, first, dt, rows, options=reading)
    from islands.report.figures.style import save  # noqa: PLC0415 - matplotlib takes half a second

    save(model.plot(figure, couple(data, len(model.output_names))), out)
