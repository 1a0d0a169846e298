"""``islands identify``: search by MGGP/FROE, refinement, validation."""

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from islands.cli import options
from islands.cli.engines import ENGINES
from islands.cli.output_folder import check_folder
from islands.cli.preprocessing_options import with_preprocessing_options
from islands.cli.record_options import with_reading_options
from islands.cli.runs.identify import RunOptions, load_run, run
from islands.cli.search_options import DEFAULTS, SearchOptions, with_search_options
from islands.errors import SettingsError, lookup
from islands.records.coupled import join_columns
from islands.records.preprocessing_steps import NO_STEPS, PreprocessingSteps
from islands.records.reading import fingerprint
from islands.records.reading.options import DEFAULT_READING, ReadingOptions
from islands.report.figures.names import FREE_RUN, parse_figures

#: Options of the run rather than of the search: allowed with ``--resume``.
RUN_OPTIONS = ("resume", "engine", "ray_address", "wall_time", "verbose", "figures")


@with_reading_options
@with_preprocessing_options
@with_search_options
def identify(
    context: typer.Context,
    records: options.RecordsOrNone = None,
    inputs: Annotated[list[str] | None, typer.Option("--input", help="Input column; repeatable.")] = None,
    output_columns: Annotated[
        list[str] | None,
        typer.Option("--output", help="Output column; several, as inputs, for a model that couples them."),
    ] = None,
    out: Annotated[Path | None, typer.Option("--out", help="Folder for the result.")] = None,
    dt: options.SamplingTime = None,
    rows: options.Rows = None,
    reading: ReadingOptions = DEFAULT_READING,
    steps: PreprocessingSteps = NO_STEPS,
    validation: Annotated[
        str | None,
        typer.Option("--validation", help="FILE, FRACTION of the end (default 0.25), or START:STOP."),
    ] = None,
    test: Annotated[
        str | None,
        typer.Option(
            "--test", help="FILE, FRACTION of the end, or START:STOP; used for the final test only."
        ),
    ] = None,
    search: SearchOptions = DEFAULTS,
    engine: Annotated[
        str | None,
        typer.Option(
            "--engine", help=f"{' or '.join(ENGINES)}; by default ray for several islands, if installed."
        ),
    ] = None,
    ray_address: Annotated[
        str | None, typer.Option("--ray-address", help="HOST:PORT of a cluster; this machine by default.")
    ] = None,
    wall_time: Annotated[
        float | None,
        typer.Option(
            "--wall-time", help="Stop after this number of seconds. Not reproducible: machines differ."
        ),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace a result that is in the folder.")] = False,
    resume: Annotated[Path | None, typer.Option("--resume", help="Folder of a run to continue.")] = None,
    verbose: Annotated[
        bool, typer.Option("--verbose", help="Also print the memory used by the caches.")
    ] = False,
    figures: options.Figures = FREE_RUN,
) -> None:
    """Identify recordings of a system by evolution. Ctrl-C keeps the best so far; --resume DIR continues."""
    if engine is not None:
        lookup(dict.fromkeys(ENGINES), engine, "engine")
    if wall_time is not None and not wall_time > 0.0:
        raise SettingsError(f"--wall-time is a number of seconds above 0, got {wall_time}")
    if ray_address is not None and engine == "serial":
        raise SettingsError("--ray-address requires --engine ray: the serial engine runs in this process")
    run_options = RunOptions(engine, ray_address, wall_time, verbose, parse_figures(figures))
    if resume is not None:
        _check_resume(context)
        run(run_options, resume, *load_run(resume))
    else:
        outputs = options.columns(output_columns or [])
        if not records or not inputs or not outputs or out is None:
            raise SettingsError("give RECORD, --input, --output and --out, or --resume DIR")
        check_folder(out, force)
        names, output_column = join_columns(options.columns(inputs), outputs)
        several = len(outputs) > 1
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
            "inputs": names,
            "output": output_column,
            **({"outputs": len(outputs)} if several else {}),
            "dt": dt,
            "rows": rows,
            "reading": reading.changes(),
            "preprocessing": asdict(steps),
            "preset": search.preset,
            "seed": search.seed,
            "changes": dict(search.changes),
        }
        run(run_options, out, job)


def _check_resume(context: typer.Context) -> None:
    """Check that only options of the run are given with ``--resume``."""
    for name in context.params:
        source = context.get_parameter_source(name)
        if name not in RUN_OPTIONS and source is not None and source.name == "COMMANDLINE":
            raise SettingsError("--resume uses the record and the settings of the run: do not give others")
