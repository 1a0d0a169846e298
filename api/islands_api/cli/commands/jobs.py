"""``islands jobs``: submit jobs to a service and follow them. It speaks REST and nothing else."""

from pathlib import Path
from typing import Annotated, Any

import typer

from islands.errors import SettingsError
from islands_api.cli import job_views as views
from islands_api.cli import options
from islands_api.cli.console import errors, output
from islands_api.cli.output_folder import check_folder
from islands_api.cli.search_options import DEFAULTS, SearchOptions, Seed, with_search_options
from islands_api.client import Client, JobFailedError
from islands_api.client.diagnosis_calls import simulation_of
from islands_api.schemas import JobView
from islands_service.domain.job import DISCREPANCY, JobState

jobs = typer.Typer(
    help="Jobs of a service: submit, diagnose, list, show, watch, cancel, resume, result.",
    no_args_is_help=True,
    add_completion=False,
)

Url = Annotated[str, typer.Option("--url", envvar="ISLANDS_URL", help="The service's address.")]
ApiKey = Annotated[
    str | None, typer.Option("--key", envvar="ISLANDS_KEY", help="Not needed on the service's own machine.")
]
Json = Annotated[bool, typer.Option("--json", help="Print JSON.")]
Name = Annotated[str, typer.Option("--name", help="For people.")]
Priority = Annotated[int, typer.Option("--priority", help="Higher ones go first.")]
IdempotencyKey = Annotated[
    str | None, typer.Option("--idempotency-key", help="The same one again is the same job.")
]
Watch = Annotated[bool, typer.Option("--watch", help="Wait for it, and print what it found.")]
Id = Annotated[str, typer.Argument(help="The job's id.")]

LOCAL = "http://127.0.0.1:8000"

#: Seconds for which a service that is away is waited for. Somebody looks on; one that is watched may take the
#: client's own time to be started again.
PATIENCE = 5.0

#: The most characters of a job's name.
_NAME = 200


@jobs.command()
@with_search_options
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
    search: SearchOptions = DEFAULTS,
    name: Name = "",
    priority: Priority = 0,
    idempotency_key: IdempotencyKey = None,
    url: Url = LOCAL,
    key: ApiKey = None,
    watch: Watch = False,
    as_json: Json = False,
) -> None:
    """Upload a record and submit a job that identifies it."""
    names = options.columns(inputs)
    held_out = _held_out(validation)
    with _client(url, key) as client:
        dataset = client.upload(record, names, output_column if rows is None else None, dt)
        validating: float | dict[str, Any] | None
        match held_out:
            case Path():
                validating = {"dataset": client.upload(held_out, names, output_column, dt).id}
            case str():
                validating = {"dataset": dataset.id, "rows": held_out}
            case _:
                validating = held_out
        job = client.submit(
            dataset,
            names,
            output_column,
            preset=search.preset,
            seed=search.seed,
            dt=dt,
            rows=rows,
            validation=validating,
            name=_called(name, record),
            priority=priority,
            idempotency_key=idempotency_key,
            **search.changes,
        )
    if watch:
        _follow(url, key, job, as_json)
    else:
        views.show_job(job, as_json)


@jobs.command()
def diagnose(
    record: Annotated[Path, typer.Argument(help="The record: CSV, NPZ, MAT or Parquet.")],
    inputs: options.Inputs,
    output_column: options.Output,
    simulated: options.Simulated,
    channels: options.Channels = None,
    tolerance: options.Tolerances = None,
    dt: options.SamplingTime = None,
    rows: options.Rows = None,
    seed: Seed = 0,
    name: Name = "",
    priority: Priority = 0,
    idempotency_key: IdempotencyKey = None,
    url: Url = LOCAL,
    key: ApiKey = None,
    watch: Watch = False,
    as_json: Json = False,
) -> None:
    """Upload a record and submit a job that finds out what a simulation gets wrong about it."""
    driving, known = options.single_input(options.columns(inputs)), options.tolerances(tolerance or [])
    beside = options.columns(channels or [])
    asked = simulation_of(simulated)
    read = [driving, *beside, *([asked["column"]] if "column" in asked else [])]
    with _client(url, key) as client:
        whole = output_column if rows is None else None
        job = client.diagnose(
            client.upload(record, read, whole, dt),
            driving,
            output_column,
            asked,
            channels=beside,
            tolerance=known,
            seed=seed,
            dt=dt,
            rows=rows,
            name=_called(name, record),
            priority=priority,
            idempotency_key=idempotency_key,
        )
    if watch:
        _follow(url, key, job, as_json)
    else:
        views.show_job(job, as_json)


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
    with _client(url, key) as client:
        page = client.jobs(state, limit=min(limit, 200))
        found += page.items
        while page.next is not None and len(found) < limit:
            page = client.jobs(state, page.next, min(limit - len(found), 200))
            found += page.items
    views.show_jobs(found, as_json)


@jobs.command()
def show(job: Id, url: Url = LOCAL, key: ApiKey = None, as_json: Json = False) -> None:
    """Show a job as it stands."""
    with _client(url, key) as client:
        views.show_job(client.job(job), as_json)


@jobs.command()
def watch(job: Id, url: Url = LOCAL, key: ApiKey = None, as_json: Json = False) -> None:
    """Follow a job until it has ended, and print what it found. Ctrl-C stops the watching, not the job."""
    with _client(url, key) as client:
        now = client.job(job)
    _follow(url, key, now, as_json)


@jobs.command()
def cancel(job: Id, url: Url = LOCAL, key: ApiKey = None, as_json: Json = False) -> None:
    """Cancel a job; it can be resumed."""
    with _client(url, key) as client:
        views.show_job(client.cancel(job), as_json)


@jobs.command()
def resume(job: Id, url: Url = LOCAL, key: ApiKey = None, as_json: Json = False) -> None:
    """Have a job that failed or was cancelled go on from its last checkpoint."""
    with _client(url, key) as client:
        views.show_job(client.resume(job), as_json)


@jobs.command()
def result(
    job: Id,
    out: Annotated[
        Path | None, typer.Option("--out", help="Folder for the result, its models and figures, its report.")
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace a result that is in the folder.")] = False,
    url: Url = LOCAL,
    key: ApiKey = None,
    as_json: Json = False,
) -> None:
    """Show what a job that has succeeded found, and download it."""
    if out is not None:
        # It brings the kernels along: who only looks does not wait for them.

        for kept in views.RESULTS.values():
            check_folder(out, force, kept.file)
    with _client(url, key) as client:
        document = client.result(job)
        kept = views.RESULTS["models" if "models" in document else "verdict"]
        if out is not None:
            kept.download(client, job, document, out)
        if as_json:
            views.print_json(document)
        else:
            kept.show(client, job, document)
            if out is not None:
                output.print(f"{out}/: {kept.holds}", markup=False)


def _called(name: str, record: Path) -> str:
    """Return what a job is called: as its record, unless it has a name."""
    return name or "".join(each for each in record.name if each.isprintable())[:_NAME]


def _held_out(text: str | None) -> Path | str | float | None:
    """Read ``--validation``: a file, rows of the record, or a fraction of its end; before anything is sent.

    Raises
    ------
    SettingsError
        It is none of the three.
    """
    if text is None:
        return None
    if Path(text).exists():
        return Path(text)
    if ":" in text:
        return text
    try:
        return float(text)
    except ValueError:
        raise SettingsError(
            f"--validation {text}: give a file that exists, a fraction such as 0.25, or rows START:STOP"
        ) from None


def _client(url: str, key: str | None) -> Client:
    return Client(url, key, retry=PATIENCE)


def _follow(url: str, key: str | None, job: JobView, as_json: bool) -> None:
    """Show a job's progress until it has ended, then what it found.

    Raises
    ------
    JobFailedError
    """
    errors.print(f"job {job.id}", markup=False)
    with Client(url, key) as client:
        try:
            with views.job_progress_bar() as tell:
                for job in client.progress(job):  # noqa: B020, PLR1704 - as it is now
                    tell(job)
        except KeyboardInterrupt:
            errors.print(f"the job goes on: 'islands jobs watch {job.id}' follows it again", markup=False)
            raise
        if as_json:
            views.show_job(job, as_json)
        elif job.state == JobState.SUCCEEDED and job.kind == DISCREPANCY:
            views.show_words(job)
        elif job.state == JobState.SUCCEEDED:
            views.show_models(client.models(job))
    if job.state != JobState.SUCCEEDED:
        detail = (job.problem or {}).get("detail", "resume it to go on")
        raise JobFailedError(f"job {job.id} {job.state}: {detail}")
