"""``islands jobs``: submit jobs to a service and follow them. It speaks REST and nothing else."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.table import Column, Table

from islands.errors import SettingsError
from islands_api.cli import options
from islands_api.cli import search_options as search
from islands_api.cli.console import errors, output, progress
from islands_api.client import Client
from islands_api.client.errors import JobFailed
from islands_api.schemas import JobView, ModelView
from islands_service.jobs import TERMINAL, JobState

jobs = typer.Typer(
    help="Jobs of a service: submit, list, show, watch, cancel, resume, result.",
    no_args_is_help=True,
    add_completion=False,
)

Url = Annotated[str, typer.Option("--url", envvar="ISLANDS_URL", help="The service's address.")]
ApiKey = Annotated[
    str | None, typer.Option("--key", envvar="ISLANDS_KEY", help="Not needed on the service's own machine.")
]
Json = Annotated[bool, typer.Option("--json", help="Print JSON.")]
Id = Annotated[str, typer.Argument(help="The job's id.")]

LOCAL = "http://127.0.0.1:8000"


@jobs.command()
def submit(
    record: Annotated[Path, typer.Argument(help="The record: CSV, NPZ, MAT or Parquet.")],
    inputs: options.Inputs,
    output_column: options.Output,
    dt: options.SamplingTime = None,
    rows: options.Rows = None,
    validation: Annotated[
        str | None,
        typer.Option("--validation", help="FILE, FRACTION of the end (default 0.25), or START:STOP."),
    ] = None,
    preset: search.Preset = "hysteresis",
    population: search.Population = None,
    generations: search.Generations = None,
    max_terms: search.MaxTerms = None,
    max_height: search.MaxHeight = None,
    shooting: search.Shooting = None,
    primitives: search.Primitives = None,
    constraints: search.Constraints = None,
    islands: search.Islands = None,
    topology: search.Topology = None,
    migrate_every: search.MigrateEvery = None,
    migrants: search.Migrants = None,
    emigrants: search.Emigrants = None,
    replaced: search.Replaced = None,
    characters: search.Characters = None,
    max_evaluations: search.MaxEvaluations = None,
    target_error: search.TargetError = None,
    seed: search.Seed = 0,
    name: Annotated[str, typer.Option("--name", help="For people.")] = "",
    priority: Annotated[int, typer.Option("--priority", help="Higher ones go first.")] = 0,
    idempotency_key: Annotated[
        str | None, typer.Option("--idempotency-key", help="The same one again is the same job.")
    ] = None,
    url: Url = LOCAL,
    key: ApiKey = None,
    watch: Annotated[bool, typer.Option("--watch", help="Wait for it, and print what it found.")] = False,
    as_json: Json = False,
) -> None:
    """Upload a record and submit a job that identifies it."""
    given = locals()
    names = options.columns(inputs)
    with Client(url, key) as client:
        dataset = client.upload(record, names, output_column if rows is None else None, dt)
        job = client.submit(
            dataset,
            names,
            output_column,
            preset=preset,
            seed=seed,
            dt=dt,
            rows=rows,
            validation=_validation(client, validation, dataset.id, names, output_column, dt),
            name=name or record.name,
            priority=priority,
            idempotency_key=idempotency_key,
            **{each: given[each] for each in search.SETTINGS if given[each] is not None},
        )
        if watch:
            _follow(client, job, as_json)
        else:
            _show(job, as_json)


@jobs.command("list")
def list_jobs(
    state: Annotated[str | None, typer.Option("--state", help=", ".join(JobState))] = None,
    limit: Annotated[int, typer.Option("--limit", min=1, help="The most jobs to list.")] = 50,
    url: Url = LOCAL,
    key: ApiKey = None,
    as_json: Json = False,
) -> None:
    """List the jobs, newest first."""
    found: list[JobView] = []
    with Client(url, key) as client:
        page = client.jobs(state, limit=min(limit, 200))
        found += page.items
        while page.next is not None and len(found) < limit:
            page = client.jobs(state, page.next, min(limit - len(found), 200))
            found += page.items
    if as_json:
        _print_json({"items": [job.model_dump(mode="json") for job in found[:limit]]})
        return
    table = Table(Column("job", no_wrap=True), "name", "state", "generation", "best error", "created")
    for job in found[:limit]:
        told = job.progress or {}
        table.add_row(
            job.id,
            job.name,
            job.state,
            f"{told.get('generation', '-')}/{told.get('generations', '-')}",
            _number(told.get("best_error")),
            f"{job.created:%Y-%m-%d %H:%M:%S}",
        )
    output.print(table)


@jobs.command()
def show(job: Id, url: Url = LOCAL, key: ApiKey = None, as_json: Json = False) -> None:
    """Show a job as it stands."""
    with Client(url, key) as client:
        _show(client.job(job), as_json)


@jobs.command()
def watch(job: Id, url: Url = LOCAL, key: ApiKey = None, as_json: Json = False) -> None:
    """Follow a job until it has ended, and print what it found. Ctrl-C stops the watching, not the job."""
    with Client(url, key) as client:
        _follow(client, client.job(job), as_json)


@jobs.command()
def cancel(job: Id, url: Url = LOCAL, key: ApiKey = None, as_json: Json = False) -> None:
    """Cancel a job; it can be resumed."""
    with Client(url, key) as client:
        _show(client.cancel(job), as_json)


@jobs.command()
def resume(job: Id, url: Url = LOCAL, key: ApiKey = None, as_json: Json = False) -> None:
    """Have a job that failed or was cancelled go on from its last checkpoint."""
    with Client(url, key) as client:
        _show(client.resume(job), as_json)


@jobs.command()
def result(
    job: Id,
    out: Annotated[
        Path | None, typer.Option("--out", help="Folder for result.json, the models and the figures.")
    ] = None,
    url: Url = LOCAL,
    key: ApiKey = None,
    as_json: Json = False,
) -> None:
    """Show the models of a job that has succeeded, and download them."""
    with Client(url, key) as client:
        document = client.result(job)
        models = client.models(job)
        if out is not None:
            _download(client, job, document, models, out)
    if as_json:
        _print_json(document)
    else:
        _print_models(models)
        if out is not None:
            output.print(f"{out}/: result.json, models/, figures/", markup=False)


def _validation(
    client: Client, text: str | None, dataset: str, names: list[str], output_column: str, dt: float | None
) -> float | dict[str, Any] | None:
    """Read ``--validation``: a file, which is uploaded, rows of the record, or a fraction of its end."""
    if text is None:
        return None
    if Path(text).exists():
        return {"dataset": client.upload(text, names, output_column, dt).id}
    if ":" in text:
        return {"dataset": dataset, "rows": text}
    try:
        return float(text)
    except ValueError:
        raise SettingsError(
            f"--validation {text}: give a file that exists, a fraction such as 0.25, or rows START:STOP"
        ) from None


def _follow(client: Client, job: JobView, as_json: bool) -> None:
    """Show a job's progress until it has ended, then what it found.

    Raises
    ------
    JobFailed
    """
    errors.print(f"job {job.id}", markup=False)
    with _progress() as tell:
        for job in client.progress(job):  # noqa: B020, PLR1704 - as it is now
            tell(job)
    if job.state != JobState.SUCCEEDED:
        if as_json:
            _show(job, as_json)
        raise JobFailed(
            f"job {job.id} {job.state}: {(job.problem or {}).get('detail', 'resume it to go on')}"
        )
    if as_json:
        _show(job, as_json)
    else:
        _print_models(client.models(job))


@contextmanager
def _progress() -> Iterator[Any]:
    with progress("job") as show_bar:

        def tell(job: JobView) -> None:
            told = job.progress or {}
            last = max(1, told.get("generations", 1))
            done = told.get("generation", 0)
            best = _number(told.get("best_error"))
            text = f"{job.state}, generation {done}/{told.get('generations', '?')}, best error {best}"
            islands = [
                f"  island {index:3d}  RMSE {_number(error)}"
                for index, error in enumerate(told.get("islands", ())[:16])
            ]
            show_bar(text, done / last if job.state not in TERMINAL else 1.0, islands)

        yield tell


def _show(job: JobView, as_json: bool) -> None:
    if as_json:
        _print_json(job.model_dump(mode="json"))
        return
    output.print(f"job {job.id}: {job.state}", markup=False)
    told = job.progress or {}
    if "generation" in told:
        best = _number(told["best_error"])
        output.print(
            f"generation {told['generation']}/{told['generations']}, best error {best}", markup=False
        )
    if job.summary is not None:
        output.print(job.summary["equation"], markup=False)
    if job.problem is not None:
        output.print(job.problem["detail"], markup=False)


def _print_models(models: tuple[ModelView, ...]) -> None:
    table = Table("rank", "terms", "MAPE est. %", "MAPE val. %", "hold drift %", "Property 1")
    for model in models:
        errors_of = [model.metrics[part]["free_run"]["mape"] for part in ("estimation", "validation")]
        table.add_row(
            str(model.rank),
            str(model.size),
            *map(_number, errors_of),
            _number(model.physics["hold_drift_percent"]),
            "yes" if model.physics["property_1"] else "no",
        )
    output.print(table)
    for model in models:
        output.print(f"{model.rank:2d}  {model.equation}", markup=False)


def _download(
    client: Client, job: str, document: dict[str, Any], models: tuple[ModelView, ...], folder: Path
) -> None:
    for name in ("models", "figures"):
        (folder / name).mkdir(parents=True, exist_ok=True)
    for model in models:
        (folder / "models" / f"{model.rank:02d}.json").write_text(
            client.export(job, model.rank, "json"), encoding="utf-8"
        )
    with progress("figures") as tell:
        names = client.figures(job)
        for done, (name, rank) in enumerate(names):
            tell(name, done / len(names))
            (folder / "figures" / f"{name}.svg").write_bytes(client.figure(job, name, rank))
    (folder / "result.json").write_text(
        json.dumps(document, indent=2, allow_nan=False) + "\n", encoding="utf-8"
    )


def _print_json(document: Any) -> None:
    typer.echo(json.dumps(document, indent=2))


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.4g}"
