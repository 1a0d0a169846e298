"""``islands identify``: search by MGGP/FROE, refinement, validation."""

from dataclasses import asdict, fields
from pathlib import Path
from typing import Annotated

import typer

from islands.cli import options
from islands.cli.output_folder import check_folder
from islands.cli.runs.identify import RunOptions, RunSettings, load_run, run
from islands.cli.settings_options import GIVEN, Given, split_settings, with_settings
from islands.errors import SettingsError
from islands.evolution.presets import AUTO
from islands.evolution.settings import Settings
from islands.records.preprocessing_steps import PreprocessingSteps
from islands.records.reading import fingerprint
from islands.records.reading.options import ReadingOptions
from islands.report.figures.names import OVERVIEW_TEXT, parse_figures

#: Options of the run rather than of the search: allowed with ``--resume``.
RUN_OPTIONS = ("resume", "figures", GIVEN, *(field.name for field in fields(RunSettings)))


@with_settings
def identify(
    *,
    context: typer.Context,
    records: options.RecordsOrNone = None,
    inputs: options.InputsOrNone = None,
    output_columns: Annotated[
        list[str] | None,
        typer.Option("--output", help="Output column; several, as inputs, for a model that couples them."),
    ] = None,
    out: Annotated[Path | None, typer.Option("--out", help="Folder for the result.")] = None,
    dt: options.SamplingTime = None,
    rows: options.Rows = None,
    reading: ReadingOptions,
    preprocessing: PreprocessingSteps,
    validation: options.Validation = None,
    test: Annotated[
        str | None,
        typer.Option(
            "--test", help="FILE, FRACTION of the end, or START:STOP; used for the final test only."
        ),
    ] = None,
    preset: options.Preset = AUTO,
    changes: Annotated[Given, Settings],
    seed: options.Seed = 0,
    run_settings: RunSettings,
    force: options.Force = False,
    resume: Annotated[Path | None, typer.Option("--resume", help="Folder of a run to continue.")] = None,
    figures: options.Figures = OVERVIEW_TEXT,
) -> None:
    """Identify recordings of a system by evolution. Ctrl-C keeps the best so far; --resume DIR continues."""
    run_options = RunOptions(run_settings, parse_figures(figures))
    if resume is not None:
        _check_resume(context)
        run(run_options, resume, *load_run(resume))
    else:
        outputs = options.columns(output_columns or [])
        if records and outputs and out is not None:
            inputs = options.require_inputs(inputs)
        if not records or not inputs or not outputs or out is None:
            raise SettingsError("give RECORD, --input, --output and --out, or --resume DIR")
        check_folder(out, force)
        paths = [str(path.resolve()) for path in records]
        given = {"validation": validation, "test": test}
        files = {
            kind: str(Path(name).resolve()) for kind, name in given.items() if name and Path(name).is_file()
        }
        job = {
            "records": paths,
            **given,
            **files,
            "sha256": {path: fingerprint(path) for path in (*paths, *files.values())},
            "inputs": options.columns(inputs),
            "outputs": outputs,
            "dt": dt,
            "rows": rows,
            "reading": reading.changes(),
            "preprocessing": asdict(preprocessing),
            "preset": preset,
            "seed": seed,
            "changes": changes,
        }
        run(run_options, out, job)


def _check_resume(context: typer.Context) -> None:
    """Check that only options of the run are given with ``--resume``."""
    given = [*context.params, *split_settings(context.params[GIVEN] or [])]
    for name in given:
        source = context.get_parameter_source(name)
        if name not in RUN_OPTIONS and (source is None or source.name == "COMMANDLINE"):
            raise SettingsError("--resume uses the record and the settings of the run: do not give others")
