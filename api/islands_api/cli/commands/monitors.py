"""``islands monitors``: monitors of a service, over REST only."""

import hashlib
from pathlib import Path
from typing import Annotated

import typer

from islands.cli import options, simulation_options
from islands.cli.console import errors, output
from islands.cli.settings_options import Given, with_settings
from islands.cli.watched_folder import find_time, hash_file, order_of_recording
from islands.diagnosis.settings import MonitoringSettings
from islands.errors import SettingsError
from islands.records.reading.options import ReadingOptions
from islands.settings_schema import setting_of, settings_class
from islands_api.cli.service.client_options import LOCAL, ApiKey, Json, Url, open_client, read_pages
from islands_api.cli.service.job_views import print_json
from islands_api.client import Client
from islands_api.monitor_schemas import MonitorView
from islands_api.schemas import JobView, SubmissionSettings
from islands_service.domain.job import TERMINAL

monitors = typer.Typer(no_args_is_help=True, add_completion=False)

Id = Annotated[str, typer.Argument(help="The monitor's id.")]

#: Line of a monitor in a list.
_LINE = "{:32}  {:8}  {:>7}  {:>6}  {:>7}  {}"

#: Exit code if an added record has raised an alarm.
ALARM_EXIT = 3


@settings_class
class RecordJobSettings:
    """Settings of the jobs of a monitor."""

    priority: int = setting_of(SubmissionSettings, "priority")


@monitors.command()
@with_settings
def add(
    *,
    records: Annotated[
        list[Path] | None, typer.Argument(metavar="RECORD...", help="Records to add, as for islands fit.")
    ] = None,
    monitor: Annotated[
        str | None, typer.Option("--monitor", help="Id of a monitor; without one, a new one is created.")
    ] = None,
    diagnosis: Annotated[
        str | None,
        typer.Option(
            "--diagnosis", help="Id of a discrepancy job whose simulation is followed, or give --simulation."
        ),
    ] = None,
    simulated: Annotated[
        str | None, typer.Option("--simulation", help="Simulation to follow, as for islands jobs diagnose.")
    ] = None,
    inputs: options.InputsOrNone = None,
    output_column: options.OutputOrNone = None,
    channels: simulation_options.Channels = None,
    dt: options.SamplingTime = None,
    changes: Annotated[Given, MonitoringSettings],
    name: Annotated[str, typer.Option("--name", help="Name of a new monitor, for display.")] = "",
    jobs: Annotated[Given, RecordJobSettings],
    reading: ReadingOptions,
    url: Url = LOCAL,
    key: ApiKey = None,
    as_json: Json = False,
    watch: Annotated[
        bool, typer.Option("--watch/--no-watch", help="Wait until the records are analysed, and show them.")
    ] = True,
) -> None:
    """Upload records to a monitor, in the order of recording, or create one; known records are left out.

    Exit code 3 if one of them has raised an alarm.
    """
    driving = options.columns(inputs or [])
    described = {
        "simulation": simulated,
        "input": simulation_options.single_input(driving) if driving else None,
        "output": output_column,
        "channels": options.columns(channels or []),
        "dt": dt,
        "name": name,
        **changes,
        **jobs,
    }
    with open_client(url, key) as client:
        if monitor is None:
            made = client.create_monitor(diagnosis, **described)
            _show_status(made, as_json)
            monitor = made.id
        elif given := [each for each, value in {"diagnosis": diagnosis, **described}.items() if value]:
            raise SettingsError(f"{given[0]} is of a new monitor: leave it out, or leave out --monitor")
        known = _find_known(client, monitor)
        added = []
        for path in sorted(records or [], key=order_of_recording):
            content = hash_file(path)
            if (path.name, content) not in known:
                added.append(_add_file(client, monitor, path, content, reading))
    if not watch:
        for job in added:
            output.print(f"job {job.id}: {job.name}", markup=False)
        return
    with Client(url, key) as client:
        raised = sum(_await_record(client, job) for job in added)
    if raised:
        raise typer.Exit(ALARM_EXIT)


def _find_known(client: Client, monitor: str) -> set[tuple[str, str]]:
    """Return the names and hashes of the records that a monitor has analysed or rejected."""
    known: set[tuple[str, str]] = set()
    for rejected in (False, True):
        after = -1
        while items := client.monitor_records(monitor, after, rejected=rejected).items:
            known.update((each["name"], each["sha256"]) for each in items)
            after = items[-1]["index"]
    return known


def _add_file(client: Client, monitor: str, path: Path, content: str, reading: ReadingOptions) -> JobView:
    dataset = client.upload(path, reading=reading.changes())
    # The same file, added again while it waits in the queue, gives the same job.
    key = hashlib.sha256(f"{monitor} {path.name} {content} {dataset.id}".encode()).hexdigest()
    return client.add_record(monitor, dataset, name=path.name, time=find_time(path.name), idempotency_key=key)


def _await_record(client: Client, job: JobView) -> int:
    """Wait until a record is analysed, show it, and return the number of alarms that it has raised."""
    for current in client.progress(job):
        if current.state not in TERMINAL:
            continue
        if current.summary is None:
            detail = (current.problem or {}).get("detail", f"job {job.id} was cancelled")
            errors.print(f"{job.name}: {detail}", markup=False)
        else:
            output.print(current.summary["words"], markup=False)
            return int(current.summary["alarms"])
    return 0


@monitors.command()
def show(
    monitor: Annotated[
        str | None, typer.Argument(help="The monitor's id; without one, monitors are listed, newest first.")
    ] = None,
    limit: Annotated[int, typer.Option("--limit", min=1, help="Largest number of monitors to list.")] = 50,
    out: Annotated[
        Path | None,
        typer.Option("--out", help="Folder for states, alarms and figure, as of islands monitor."),
    ] = None,
    url: Url = LOCAL,
    key: ApiKey = None,
    as_json: Json = False,
) -> None:
    """List the monitors, or show the last record and the alarms of one and download its states.

    Raises
    ------
    SettingsError
        There is nothing to download before the first record.
    """
    if monitor is None:
        _list(url, key, limit, as_json)
        return
    with open_client(url, key) as client:
        found = client.monitor(monitor)
        if found.result is None and out is not None:
            raise SettingsError(f"monitor {monitor} waits for its first record: there is nothing to download")
        state = None if found.result is None else client.monitor_state(monitor)
    _show_status(found, as_json)
    if state is None:
        return
    from islands_api.cli.service.monitor_files import describe_states, write_states  # noqa: PLC0415

    if not as_json:
        for line in describe_states(state):
            output.print(line, markup=False)
    if out is not None:
        errors.print(write_states(state, out), markup=False)


@monitors.command()
def delete(monitor: Id, url: Url = LOCAL, key: ApiKey = None) -> None:
    """Delete a monitor; records that wait are cancelled."""
    with open_client(url, key) as client:
        client.delete_monitor(monitor)
    output.print(f"monitor {monitor} is deleted", markup=False)


def _show_status(monitor: MonitorView, as_json: bool) -> None:
    """Show the status of a monitor and the numbers of its records and alarms."""
    if as_json:
        print_json(monitor.model_dump(mode="json"))
        return
    named = f" ({monitor.name})" if monitor.name else ""
    counts = f"records {monitor.records}, alarms {monitor.alarms}"
    waiting = f", records to analyse {monitor.pending}" if monitor.pending else ""
    output.print(f"monitor {monitor.id}{named}: {monitor.status}, {counts}{waiting}", markup=False)


def _list(url: str, key: str | None, limit: int, as_json: bool) -> None:
    with open_client(url, key) as client:
        found = read_pages(client.monitors, limit)
    if as_json:
        print_json({"items": [each.model_dump(mode="json") for each in found]})
        return
    # Not a table: it would truncate the ids in a narrow terminal or a pipe.
    output.print(_LINE.format("monitor", "status", "records", "alarms", "pending", "name"), markup=False)
    for each in found:
        line = _LINE.format(each.id, each.status, each.records, each.alarms, each.pending, each.name)
        output.print(line, markup=False)
