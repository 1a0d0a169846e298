"""``islands identify``: evolution by MGGP/FROE, refinement, validation."""

from pathlib import Path
from typing import Annotated

import typer

from islands.errors import SettingsError, lookup
from islands.io.records import fingerprint
from islands_api.cli import options
from islands_api.cli.identify_run import RunOptions, run, stored
from islands_api.cli.output_folder import check_folder
from islands_api.cli.search_options import DEFAULTS, SearchOptions, with_search_options
from islands_service.engines import ENGINES

#: Options that say how to run, not what: they may differ from one resumption to the next.
RUNNING = ("resume", "engine", "ray_address", "wall_time", "verbose")


@with_search_options
def identify(
    context: typer.Context,
    record: Annotated[
        Path | None, typer.Argument(help="The record: CSV, NPZ, MAT or Parquet. Not with --resume.")
    ] = None,
    inputs: Annotated[list[str] | None, typer.Option("--input", help="Input column; repeatable.")] = None,
    output_column: Annotated[str | None, typer.Option("--output", help="Output column.")] = None,
    out: Annotated[Path | None, typer.Option("--out", help="Folder for the result.")] = None,
    dt: options.SamplingTime = None,
    rows: options.Rows = None,
    validation: Annotated[
        str | None,
        typer.Option("--validation", help="FILE, FRACTION of the end (default 0.25), or START:STOP."),
    ] = None,
    test: Annotated[
        str | None,
        typer.Option("--test", help="FILE, FRACTION of the end, or START:STOP: nothing touches it."),
    ] = None,
    search: SearchOptions = DEFAULTS,
    engine: Annotated[
        str | None,
        typer.Option("--engine", help=f"{' or '.join(ENGINES)}; ray by default where there are islands."),
    ] = None,
    ray_address: Annotated[
        str | None, typer.Option("--ray-address", help="HOST:PORT of a cluster; this machine by default.")
    ] = None,
    wall_time: Annotated[
        float | None,
        typer.Option("--wall-time", help="Stop after so many seconds. Not reproducible: machines differ."),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace a result that is in the folder.")] = False,
    resume: Annotated[Path | None, typer.Option("--resume", help="Folder of a run to go on with.")] = None,
    verbose: Annotated[bool, typer.Option("--verbose", help="Tell what the caches take, too.")] = False,
) -> None:
    """Identify a record by evolution. Ctrl-C keeps the best so far; --resume DIR goes on."""
    if engine is not None:
        lookup(ENGINES, engine, "engine")
    if wall_time is not None and not wall_time > 0.0:
        raise SettingsError(f"--wall-time is a number of seconds above 0, got {wall_time}")
    if ray_address is not None and engine == "serial":
        raise SettingsError("--ray-address goes with --engine ray: the serial engine runs in this process")
    manner = RunOptions(engine, ray_address, wall_time, verbose)
    if resume is not None:
        _refuse_others(context)
        run(manner, resume, *stored(resume))
    else:
        if record is None or not inputs or output_column is None or out is None:
            raise SettingsError("give RECORD, --input, --output and --out, or --resume DIR")
        check_folder(out, force)
        sources = {"record": str(record), "validation": validation, "test": test}
        files = {
            kind: str(Path(name).resolve())
            for kind, name in sources.items()
            if name and (kind == "record" or Path(name).is_file())
        }
        job = {
            **sources,
            **files,
            "sha256": {path: fingerprint(path) for path in files.values()},
            "inputs": options.columns(inputs),
            "output": output_column,
            "dt": dt,
            "rows": rows,
            "preset": search.preset,
            "seed": search.seed,
            "changes": dict(search.changes),
        }
        run(manner, out, job)


def _refuse_others(context: typer.Context) -> None:
    for name in context.params:
        source = context.get_parameter_source(name)
        if name not in RUNNING and source is not None and source.name == "COMMANDLINE":
            raise SettingsError("--resume goes on with the run's own record and settings: give nothing else")
