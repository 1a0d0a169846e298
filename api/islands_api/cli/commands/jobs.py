"""``islands jobs``: submission and monitoring of jobs, over REST only."""

import re
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer

from islands.cli import options, simulation_options
from islands.cli.console import errors, output
from islands.cli.output_folder import check_folder
from islands.cli.recordings import parse_held_out
from islands.cli.settings_options import Given, with_settings
from islands.diagnosis.settings import DiagnosisSettings
from islands.errors import SettingsError
from islands.evolution.presets import AUTO
from islands.evolution.settings import NARX, Settings
from islands.persistence.models import MODEL_CLASSES
from islands.records.coupled import check_outputs
from islands.records.reading.options import ReadingOptions
from islands.simulators.specification.code import FmuSpec
from islands.simulators.specification.table import parse_spec
from islands_api.cli.service import job_views as views
from islands_api.cli.service.client_options import LOCAL, ApiKey, Json, Url, open_client, read_pages
from islands_api.client import Client, JobFailedError
from islands_api.client.calls import make_part
from islands_api.client.diagnosis_calls import parse_simulation
from islands_api.client.upload_calls import name_uploaded
from islands_api.schemas import JobView, SubmissionSettings
from islands_service.domain.job import KINDS, MAX_NAME_LENGTH, JobState

jobs = typer.Typer(no_args_is_help=True, add_completion=False)

Name = Annotated[str, typer.Option("--name", help="Name of the job, for display.")]
Tags = Annotated[
    list[str] | None, typer.Option("--tag", help="Tag of the job, for the list; may be repeated.")
]
Watch = Annotated[bool, typer.Option("--watch", help="Wait for the job and print its result.")]

#: Job to compare, by its recommended model or by that of a rank.
_MODEL = re.compile("([0-9a-f]{32})(?::([1-9][0-9]*))?")


@jobs.command()
@with_settings
def submit(
    *,
    records: options.Records,
    inputs: options.Inputs,
    output_columns: options.Outputs,
    dt: options.SamplingTime = None,
    rows: options.Rows = None,
    reading: ReadingOptions,
    validation: options.Validation = None,
    model: Annotated[
        str, typer.Option("--model", help=f"Class of the models: {', '.join((NARX, *MODEL_CLASSES))}.")
    ] = NARX,
    preset: options.Preset = AUTO,
    changes: Annotated[Given, Settings],
    seed: options.Seed = 0,
    name: Name = "",
    tags: Tags = None,
    submission: Annotated[Given, SubmissionSettings],
    url: Url = LOCAL,
    key: ApiKey = None,
    watch: Watch = False,
    as_json: Json = False,
) -> None:
    """Upload recordings and submit a job that identifies one model of them."""
    names, outputs = options.columns(inputs), options.columns(output_columns)
    read = reading.changes()
    if len(outputs) > 1:
        check_outputs(names, outputs)
    held_out = parse_held_out(validation)
    if isinstance(held_out, str) and len(records) > 1:
        raise SettingsError(f"--validation {held_out}: with several recordings, give a file or a fraction")
    with open_client(url, key) as client:
        whole = outputs[0] if rows is None else None
        dataset, *others = (client.upload(record, names, whole, dt, read) for record in records)
        validation_data: float | dict[str, Any] | None
        match held_out:
            case Path():
                validation_data = {"dataset": client.upload(held_out, names, outputs[0], dt, read).id}
            case str():
                validation_data = {"dataset": dataset.id, "rows": held_out}
            case _:
                validation_data = held_out
        job = client.submit(
            dataset,
            names,
            outputs if len(outputs) > 1 else outputs[0],
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
@with_settings
def diagnose(
    *,
    records: options.Records,
    inputs: options.Inputs,
    output_column: options.Output,
    simulated: simulation_options.Simulated,
    channels: simulation_options.Channels = None,
    changes: Annotated[Given, DiagnosisSettings],
    dt: options.SamplingTime = None,
    rows: options.Rows = None,
    validation: options.HeldOut = None,
    reading: ReadingOptions,
    seed: options.Seed = 0,
    name: Name = "",
    tags: Tags = None,
    submission: Annotated[Given, SubmissionSettings],
    url: Url = LOCAL,
    key: ApiKey = None,
    watch: Watch = False,
    as_json: Json = False,
) -> None:
    """Upload recordings and submit a job that diagnoses the errors of a simulation on them."""
    driving = simulation_options.single_input(options.columns(inputs))
    channel_names = options.columns(channels or [])
    spec = parse_spec(simulated)
    simulation = {} if isinstance(spec, FmuSpec) else parse_simulation(simulated)
    columns = [driving, *channel_names, *([simulation["column"]] if "column" in simulation else [])]
    read = reading.changes()
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
            seed=seed,
            dt=dt,
            rows=rows,
            recordings=[make_part(other, rows) for other in others],
            validation=held_out or None,
            name=_make_name(name, records),
            tags=tags or (),
            **submission,
            **changes,
        )
    _follow(url, key, job, as_json, watch)


@jobs.command()
def show(
    ids: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[JOB...]",
            help="Id of a job; without one, jobs are listed, newest first; two to six for a report that "
            "compares their recommended models, or those of JOB:RANK.",
        ),
    ] = None,
    out: Annotated[
        Path | None, typer.Option("--out", help="Folder for the result with its models, figures and report.")
    ] = None,
    force: options.Force = False,
    report: Annotated[
        Path | None, typer.Option("--report", help="HTML file for the report, or for the comparison.")
    ] = None,
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
    watch: Watch = False,
    as_json: Json = False,
) -> None:
    """List jobs, or show one with its result, and download it. A cancelled search has models, too.

    With --watch follow a job until it has ended; Ctrl-C stops watching, not the job.
    """
    if not ids:
        if out or report or watch:
            raise SettingsError("--out, --report and --watch are for a job: give its id")
        sort = "error" if best else None
        with open_client(url, key) as client:
            read_page = partial(client.jobs, state, kind=kind, tag=tag, q=search, sort=sort)
            views.show_jobs(read_pages(read_page, limit), as_json)
        return
    if report is not None:
        models = [_parse_model(each) for each in ids] if len(ids) > 1 else []
        with open_client(url, key) as client:
            report.write_bytes(client.comparison_report(models) if models else client.report(ids[0]))
        output.print(report, markup=False, highlight=False, soft_wrap=True)
        return
    if len(ids) > 1:
        raise SettingsError("several jobs are compared in a report: add --report FILE")
    if out is not None:
        for result in views.RESULTS.values():
            check_folder(out, force, result.file)
    with open_client(url, key) as client:
        now = client.job(ids[0])
    if watch:
        now = _watch(url, key, now, as_json)
    with open_client(url, key) as client:
        if not watch or as_json:
            views.show_job(now, as_json, client)
        if out is not None:
            views.download_result(client, now, out)


@jobs.command()
def change(
    job: Annotated[str, typer.Argument(help="The job's id.")],
    name: Annotated[str | None, typer.Option("--name", help="The new name; an empty one for none.")] = None,
    tags: Annotated[
        list[str] | None, typer.Option("--tag", help="A new tag, instead of the present ones; '' for none.")
    ] = None,
    stop: Annotated[
        bool, typer.Option("--stop", help="End the search; the job succeeds with the best models so far.")
    ] = False,
    cancel: Annotated[bool, typer.Option("--cancel", help="Cancel the job; it can be resumed.")] = False,
    resume: Annotated[
        bool,
        typer.Option("--resume", help="Resume a failed or cancelled job from its last checkpoint."),
    ] = False,
    url: Url = LOCAL,
    key: ApiKey = None,
    as_json: Json = False,
) -> None:
    """Change the name or the tags of a job, or stop, cancel or resume it."""
    actions = [each for each, given in (("stop", stop), ("cancel", cancel), ("resume", resume)) if given]
    if len(actions) + (name is not None or tags is not None) != 1:
        raise SettingsError("give --name and --tag, or one of --stop, --cancel and --resume")
    with open_client(url, key) as client:
        if actions:
            views.show_job(getattr(client, actions[0])(job), as_json)
        else:
            new = None if tags is None else [tag for tag in tags if tag]
            views.show_labels(client.label(job, name, tags=new), as_json)


def _parse_model(text: str) -> str | tuple[str, int]:
    found = _MODEL.fullmatch(text)
    if found is None:
        raise SettingsError(f"{text} is no job: a comparison has ids of jobs, JOB or JOB:RANK")
    job, rank = found.groups()
    return job if rank is None else (job, int(rank))


def _make_name(name: str, records: Sequence[Path]) -> str:
    """Return the name of a job; if it is empty, the file names of the recordings."""
    files = ", ".join(record.name for record in records)
    return name or "".join(each for each in files if each.isprintable())[:MAX_NAME_LENGTH]


def _follow(url: str, key: str | None, job: JobView, as_json: bool, watch: bool) -> None:
    """Show a job that was submitted; with ``watch`` its progress until it has ended, and its result."""
    if watch:
        job = _watch(url, key, job, as_json)
    if as_json or not watch:
        views.show_job(job, as_json)


def _watch(url: str, key: str | None, job: JobView, as_json: bool) -> JobView:
    """Show the progress of a job until it has ended, and its result as text; return the job.

    Raises
    ------
    JobFailedError
        The job has failed or was cancelled.
    """
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
        if job.state == JobState.SUCCEEDED and not as_json:
            views.show_result(client, job)
    if job.state != JobState.SUCCEEDED:
        if as_json:
            views.show_job(job, as_json)
        if kept := views.describe_kept_models(job):
            raise JobFailedError(f"job {job.id} {kept}")
        detail = (job.problem or {}).get("detail", "resume it to continue")
        raise JobFailedError(f"job {job.id} {job.state}: {detail}")
    return job
