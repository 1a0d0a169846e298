"""``islands jobs``: submission and monitoring of jobs, over REST only."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer

from islands.cli import options, simulation_options
from islands.cli.console import errors, output
from islands.cli.output_folder import check_folder
from islands.cli.settings_options import NONE, Given, with_settings
from islands.errors import SettingsError
from islands.evolution.presets import AUTO
from islands.evolution.settings import NARX, Settings
from islands.persistence.models import MODEL_CLASSES
from islands.records.coupled import join_columns
from islands.records.reading.options import ReadingOptions
from islands.settings_schema import setting, settings_class
from islands.simulators.specification.code import FmuSpec
from islands.simulators.specification.table import parse_spec
from islands_api.cli.service import job_views as views
from islands_api.cli.service.client_options import LOCAL, ApiKey, Json, Url, open_client, read_pages
from islands_api.client import Client, JobFailedError
from islands_api.client.calls import make_part
from islands_api.client.diagnosis_calls import parse_simulation
from islands_api.client.upload_calls import name_uploaded
from islands_api.schemas import JobView
from islands_service.domain.job import IDENTIFICATION, KINDS, MAX_NAME_LENGTH, PRIORITIES, JobState

jobs = typer.Typer(
    help="Jobs of a service: submit, diagnose, list, show, label, stop, resume, result.",
    no_args_is_help=True,
    add_completion=False,
)

Name = Annotated[str, typer.Option("--name", help="Name of the job, for display.")]
Tags = Annotated[
    list[str] | None, typer.Option("--tag", help="Tag of the job, for the list; may be repeated.")
]
Watch = Annotated[bool, typer.Option("--watch", help="Wait for the job and print its result.")]
Id = Annotated[str, typer.Argument(help="The job's id.")]


@settings_class
class SubmissionSettings:
    """Settings of the submission of a job."""

    priority: int = setting(
        0, "Of your own jobs, higher ones run first.", ge=PRIORITIES.start, le=PRIORITIES.stop - 1
    )
    idempotency_key: str | None = setting(None, "Submitting again with the same key returns the same job.")


@jobs.command()
@with_settings(reading=ReadingOptions, changes=Settings, submission=SubmissionSettings)
def submit(
    records: options.Records,
    inputs: options.Inputs,
    output_columns: options.Outputs,
    dt: options.SamplingTime = None,
    rows: options.Rows = None,
    reading: Given = NONE,
    validation: Annotated[
        str | None,
        typer.Option("--validation", help="FILE, FRACTION of the end (default 0.25), or START:STOP."),
    ] = None,
    model: Annotated[
        str, typer.Option("--model", help=f"Class of the models: {', '.join((NARX, *MODEL_CLASSES))}.")
    ] = NARX,
    preset: options.Preset = AUTO,
    changes: Given = NONE,
    seed: options.Seed = 0,
    name: Name = "",
    tags: Tags = None,
    submission: Given = NONE,
    url: Url = LOCAL,
    key: ApiKey = None,
    watch: Watch = False,
    as_json: Json = False,
) -> None:
    """Upload recordings and submit a job that identifies one model of them."""
    names, outputs = options.columns(inputs), options.columns(output_columns)
    read = ReadingOptions(**reading).changes()
    _, output_column = join_columns(names, outputs)
    held_out = _parse_validation(validation)
    if isinstance(held_out, str) and len(records) > 1:
        raise SettingsError(f"--validation {held_out}: with several recordings, give a file or a fraction")
    with open_client(url, key) as client:
        whole = output_column if rows is None else None
        dataset, *others = (client.upload(record, names, whole, dt, read) for record in records)
        validation_data: float | dict[str, Any] | None
        match held_out:
            case Path():
                validation_data = {"dataset": client.upload(held_out, names, output_column, dt, read).id}
            case str():
                validation_data = {"dataset": dataset.id, "rows": held_out}
            case _:
                validation_data = held_out
        job = client.submit(
            dataset,
            names,
            outputs if len(outputs) > 1 else output_column,
            model=model,
            preset=preset,
            seed=seed,
            dt=dt,
            rows=rows,
            recordings=[make_part(other, rows) for other in others],
            validation=validation_data,
            name=_make_name(name, records),
            tags=tags or (),
            **submission,
            **changes,
        )
    _follow(url, key, job, as_json, watch)


@jobs.command()
@with_settings(reading=ReadingOptions, submission=SubmissionSettings)
def diagnose(
    records: options.Records,
    inputs: options.Inputs,
    output_column: options.Output,
    simulated: simulation_options.Simulated,
    channels: simulation_options.Channels = None,
    tolerance: simulation_options.Tolerances = None,
    noise_level: simulation_options.NoiseLevel = None,
    dt: options.SamplingTime = None,
    rows: options.Rows = None,
    validation: options.HeldOut = None,
    reading: Given = NONE,
    seed: options.Seed = 0,
    name: Name = "",
    tags: Tags = None,
    submission: Given = NONE,
    url: Url = LOCAL,
    key: ApiKey = None,
    watch: Watch = False,
    as_json: Json = False,
) -> None:
    """Upload recordings and submit a job that diagnoses the errors of a simulation on them."""
    driving, tolerances = (
        simulation_options.single_input(options.columns(inputs)),
        simulation_options.tolerances(tolerance or []),
    )
    channel_names = options.columns(channels or [])
    spec = parse_spec(simulated)
    simulation = {} if isinstance(spec, FmuSpec) else parse_simulation(simulated)
    columns = [driving, *channel_names, *([simulation["column"]] if "column" in simulation else [])]
    read = ReadingOptions(**reading).changes()
    with open_client(url, key) as client:
        if isinstance(spec, FmuSpec):
            simulation = name_uploaded(spec, client.upload_fmu(spec.file))
        whole = output_column if rows is None else None
        dataset, *others = (client.upload(record, columns, whole, dt, read) for record in records)
        held_out = validation and client.upload(validation, columns, output_column, dt, read)
        job = client.diagnose(
            dataset,
            driving,
            output_column,
            simulation,
            channels=channel_names,
            tolerance=tolerances,
            noise_level=noise_level,
            seed=seed,
            dt=dt,
            rows=rows,
            recordings=[make_part(other, rows) for other in others],
            validation=held_out or None,
            name=_make_name(name, records),
            tags=tags or (),
            **submission,
        )
    _follow(url, key, job, as_json, watch)


@jobs.command("list")
def list_jobs(
    state: Annotated[str | None, typer.Option("--state", help=", ".join(JobState))] = None,
    kind: Annotated[str | None, typer.Option("--kind", help=", ".join(KINDS))] = None,
    tag: Annotated[str | None, typer.Option("--tag", help="Only jobs with this tag.")] = None,
    search: Annotated[
        str | None,
        typer.Option("--search", help="Words in the name, tags, data set, equation or verdict, in any case."),
    ] = None,
    best: Annotated[
        bool,
        typer.Option("--best", help="List jobs with a model, least error first, instead of newest first."),
    ] = False,
    limit: Annotated[int, typer.Option("--limit", min=1, help="Largest number of jobs to list.")] = 50,
    url: Url = LOCAL,
    key: ApiKey = None,
    as_json: Json = False,
) -> None:
    """List the jobs, newest first."""
    with open_client(url, key) as client:
        read_page = partial(client.jobs, state, kind=kind, tag=tag, q=search, sort="error" if best else None)
        views.show_jobs(read_pages(read_page, limit), as_json)


@jobs.command()
def show(job: Id, url: Url = LOCAL, key: ApiKey = None, watch: Watch = False, as_json: Json = False) -> None:
    """Show a job. With --watch follow it until it has ended; Ctrl-C stops watching, not the job."""
    with open_client(url, key) as client:
        now = client.job(job)
    _follow(url, key, now, as_json, watch)


@jobs.command()
def label(
    job: Id,
    name: Annotated[str | None, typer.Option("--name", help="The new name; an empty one for none.")] = None,
    tags: Annotated[
        list[str] | None, typer.Option("--tag", help="A new tag, instead of the present ones; '' for none.")
    ] = None,
    url: Url = LOCAL,
    key: ApiKey = None,
    as_json: Json = False,
) -> None:
    """Change the name or the tags of a job."""
    new = None if tags is None else [tag for tag in tags if tag]
    with open_client(url, key) as client:
        views.show_labels(client.label(job, name, tags=new), as_json)


@jobs.command()
def stop(
    job: Id,
    cancel: Annotated[bool, typer.Option("--cancel", help="Cancel the job; it can be resumed.")] = False,
    url: Url = LOCAL,
    key: ApiKey = None,
    as_json: Json = False,
) -> None:
    """Stop the search of a job, which then succeeds with the best models found so far, or cancel it."""
    with open_client(url, key) as client:
        views.show_job(client.cancel(job) if cancel else client.stop(job), as_json)


@jobs.command()
def resume(job: Id, url: Url = LOCAL, key: ApiKey = None, as_json: Json = False) -> None:
    """Resume a job that has failed or was cancelled from its last checkpoint."""
    with open_client(url, key) as client:
        views.show_job(client.resume(job), as_json)


@jobs.command()
def result(
    job: Id,
    out: Annotated[
        Path | None, typer.Option("--out", help="Folder for the result with its models, figures and report.")
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace a result that is in the folder.")] = False,
    url: Url = LOCAL,
    key: ApiKey = None,
    as_json: Json = False,
) -> None:
    """Show the result of a job, and download it. A cancelled search has the models found so far."""
    if out is not None:
        for kind in views.RESULTS.values():
            check_folder(out, force, kind.file)
    with open_client(url, key) as client:
        document = client.result(job)
        kind = next(kind for name, kind in views.RESULTS.items() if name in document)
        if out is not None:
            kind.download(client, job, document, out)
        if as_json:
            views.print_json(document)
        else:
            kind.show(client, job, document)
            if out is not None:
                output.print(f"{out}/: {kind.contents}", markup=False)


def _make_name(name: str, records: Sequence[Path]) -> str:
    """Return the name of a job; if it is empty, the file names of the recordings."""
    files = ", ".join(record.name for record in records)
    return name or "".join(each for each in files if each.isprintable())[:MAX_NAME_LENGTH]


def _parse_validation(text: str | None) -> Path | str | float | None:
    """Read ``--validation`` before any upload: a file, rows of the record, or a fraction of its end.

    Raises
    ------
    SettingsError
        The text is none of the three.
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


def _follow(url: str, key: str | None, job: JobView, as_json: bool, watch: bool = True) -> None:
    """Show the progress of a job until it has ended, then its result; without ``watch`` show the job only.

    Raises
    ------
    JobFailedError
        The job has failed or was cancelled.
    """
    if not watch:
        views.show_job(job, as_json)
        return
    errors.print(f"job {job.id}", markup=False)
    with Client(url, key) as client:
        try:
            with views.job_progress_bar() as update:
                for current in client.progress(job):
                    job = current
                    update(job)
        except KeyboardInterrupt:
            errors.print(
                f"the job continues: 'islands jobs show {job.id} --watch' follows it again", markup=False
            )
            raise
        if as_json:
            views.show_job(job, as_json)
        elif job.state == JobState.SUCCEEDED and job.kind != IDENTIFICATION:
            views.show_findings(job)
        elif job.state == JobState.SUCCEEDED:
            views.show_models(client, job, client.models(job))
            if kept := views.describe_kept_models(job):
                output.print(f"The job {kept}.", markup=False)
    if job.state != JobState.SUCCEEDED:
        if kept := views.describe_kept_models(job):
            raise JobFailedError(f"job {job.id} {kept}")
        detail = (job.problem or {}).get("detail", "resume it to continue")
        raise JobFailedError(f"job {job.id} {job.state}: {detail}")
