"""``islands identify``: evolution by MGGP/FROE, refinement, validation."""

from pathlib import Path
from typing import Annotated

import typer

from islands.errors import SettingsError, chosen
from islands.estimation.constraints import CONSTRAINTS
from islands.evolution.characters import CHARACTERS
from islands.evolution.migration import EMIGRANTS, REPLACED
from islands.evolution.presets import PRESETS
from islands.evolution.topology import TOPOLOGIES
from islands.io.records import fingerprint
from islands.model.primitives import PRIMITIVES
from islands_api.cli import options
from islands_api.cli.fit import check_folder
from islands_api.cli.run import Manner, run, stored
from islands_service.engines import ENGINES

#: Options that are settings, and have their names.
SETTINGS = (
    *("population", "generations", "max_terms", "max_height", "shooting", "primitives", "constraints"),
    *("islands", "topology", "migrate_every", "migrants", "emigrants", "replaced", "characters"),
    *("max_evaluations", "target_error"),
)

#: Options that say how to run, not what: they may differ from one resumption to the next.
RUNNING = ("resume", "engine", "ray_address", "wall_time", "verbose")


def identify(
    context: typer.Context,
    record: Annotated[Path | None, typer.Argument(help="The record: CSV or NPZ. Not with --resume.")] = None,
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
    preset: Annotated[str, typer.Option("--preset", help=", ".join(PRESETS))] = "hysteresis",
    population: Annotated[int | None, typer.Option("--population")] = None,
    generations: Annotated[int | None, typer.Option("--generations")] = None,
    max_terms: Annotated[int | None, typer.Option("--max-terms")] = None,
    max_height: Annotated[int | None, typer.Option("--max-height")] = None,
    shooting: Annotated[int | None, typer.Option("--shooting", help="Samples of an interval.")] = None,
    primitives: Annotated[
        list[str] | None, typer.Option("--primitive", help=f"Repeat it: {', '.join(PRIMITIVES)}.")
    ] = None,
    constraints: Annotated[str | None, typer.Option("--constraints", help=" or ".join(CONSTRAINTS))] = None,
    islands: Annotated[
        int | None, typer.Option("--islands", help="Islands that evolve side by side.")
    ] = None,
    topology: Annotated[
        str | None, typer.Option("--topology", help=f"{', '.join(TOPOLOGIES)}, or edges: 0>1,1>2.")
    ] = None,
    migrate_every: Annotated[
        str | None,
        typer.Option("--migrate-every", help="Generations; 5,100:20 is 20 from generation 100 on."),
    ] = None,
    migrants: Annotated[
        str | None, typer.Option("--migrants", help="For each neighbour; may change likewise.")
    ] = None,
    emigrants: Annotated[
        str | None, typer.Option("--emigrants", help=f"Who leaves: {', '.join(EMIGRANTS)}.")
    ] = None,
    replaced: Annotated[
        str | None, typer.Option("--replaced", help=f"Whose place they take: {', '.join(REPLACED)}.")
    ] = None,
    characters: Annotated[
        list[str] | None,
        typer.Option("--character", help=f"Repeat it, islands take turns: {', '.join(CHARACTERS)}."),
    ] = None,
    max_evaluations: Annotated[
        int | None, typer.Option("--max-evaluations", help="End with the epoch that reaches it.")
    ] = None,
    target_error: Annotated[
        float | None, typer.Option("--target-error", help="RMSE; end with the epoch that reaches it.")
    ] = None,
    seed: Annotated[int, typer.Option("--seed", min=0)] = 0,
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
    given = locals()
    if engine is not None:
        chosen(ENGINES, engine, "engine")
    if wall_time is not None and not wall_time > 0.0:
        raise SettingsError(f"--wall-time is a number of seconds above 0, got {wall_time}")
    if ray_address is not None and engine == "serial":
        raise SettingsError("--ray-address goes with --engine ray: the serial engine runs in this process")
    manner = Manner(engine, ray_address, wall_time, verbose)
    if resume is not None:
        _refuse_others(context)
        run(manner, resume, *stored(resume))
    else:
        if record is None or not inputs or output_column is None or out is None:
            raise SettingsError("give RECORD, --input, --output and --out, or --resume DIR")
        check_folder(out, force)
        changes = {name: given[name] for name in SETTINGS if given[name] is not None}
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
            "preset": preset,
            "seed": seed,
            "changes": changes,
        }
        run(manner, out, job)


def _refuse_others(context: typer.Context) -> None:
    for name in context.params:
        source = context.get_parameter_source(name)
        if name not in RUNNING and source is not None and source.name == "COMMANDLINE":
            raise SettingsError("--resume goes on with the run's own record and settings: give nothing else")
