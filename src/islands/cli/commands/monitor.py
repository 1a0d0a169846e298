"""``islands monitor``: states of the effects of a simulation from record to record, and alarms."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from time import sleep
from time import time as read_clock
from typing import Annotated, Any

import typer

from islands.cli import options, simulation_options
from islands.cli.console import errors, output
from islands.cli.output_folder import check_folder
from islands.cli.progress_display import compile_kernels
from islands.cli.recordings import Recordings
from islands.cli.settings_options import Given, with_settings
from islands.cli.watched_folder import WatchedFolder, find_time, hash_file
from islands.diagnosis.settings import MonitoringSettings
from islands.errors import IslandsError, SettingsError
from islands.facade.record_monitor import (
    create_monitor,
    monitor_record,
    parse_monitored,
    reject_record,
)
from islands.records.dataset import Dataset
from islands.records.reading.options import ReadingOptions
from islands.report.documents.monitor_json import describe_alarm_text, describe_last_record, monitor_json
from islands.report.documents.monitor_state import (
    RejectedRecord,
    SavedMonitor,
    read_monitor,
    write_monitor,
)
from islands.report.figures.monitored_states import draw_monitored_states
from islands.report.figures.style import save
from islands.settings_schema import setting, settings_class
from islands.simulators.specification.equations import OdeSpec
from islands.simulators.specification.table import ColumnSpec, ExtendedSpec, LocalSpec, innermost

#: File of the state, from which the monitor continues.
STATE = "state.json"

#: File of the states and alarms, for other programs.
RESULT = "monitor.json"

#: File of the figure.
FIGURE = "monitor.svg"

#: Exit code of a run that raised an alarm.
ALARM_EXIT = 3

#: Seconds between two looks at the folder.
POLL = 1.0


@settings_class
class FolderSettings:
    """Settings of a folder of records."""

    settle: float = setting(2.0, "Time without a change after which a file is complete.", ge=0, unit="s")


@with_settings
def monitor(
    *,
    folder: Annotated[Path, typer.Argument(help="Folder into which records are written, one file each.")],
    out: Annotated[Path, typer.Option("--out", help="Folder for states, alarms and figure.")],
    simulated: Annotated[
        str | None,
        typer.Option(
            "--simulation",
            help="extended.json or folder of a diagnosis, or a simulation as for diagnose; not needed to "
            "continue.",
        ),
    ] = None,
    inputs: options.InputsOrNone = None,
    output_column: options.OutputOrNone = None,
    channels: simulation_options.Channels = None,
    changes: Annotated[Given, MonitoringSettings],
    follow: Annotated[bool, typer.Option("--follow", help="Wait for further records, until Ctrl-C.")] = False,
    folder_settings: FolderSettings,
    dt: options.SamplingTime = None,
    reading: ReadingOptions,
    force: Annotated[bool, typer.Option("--force", help="Start again, without the states in --out.")] = False,
) -> None:
    """Follow a simulation over the records of a folder, and raise an alarm when an effect has changed.

    Exit code 3 if this run has raised an alarm. Run it again to continue with further records.
    """
    check_folder(out, force=True)
    watched = WatchedFolder(folder, folder_settings.settle)
    known = read_monitor(out / STATE) if (out / STATE).exists() and not force else None
    if simulated is not None:
        spec = parse_monitored(simulated)
    elif known is not None:
        spec = known.simulation
    else:
        raise SettingsError("a new monitor needs --simulation: extended.json or the folder of a diagnosis")
    driving = [*options.columns(inputs or []), *(channels or [])]
    columns = _find_columns(spec, known, driving, output_column)
    reader = _Reader(*columns, spec, dt, reading)
    MonitoringSettings(**changes)  # An error is shown before the first record arrives.
    settings = {"interval": watched.interval, **changes}
    out.mkdir(parents=True, exist_ok=True)
    run = _Run(out, reader, spec, settings, known)
    try:
        while True:
            for path in watched.take_complete(read_clock()):
                run.analyse(path)
            if not follow and not watched.has_unfinished:
                break
            sleep(POLL)
    finally:
        run.write_result()
    if run.saved is None:
        raise SettingsError(f"{folder} has no record that can be monitored")
    if run.alarms:
        raise typer.Exit(ALARM_EXIT)


@dataclass(frozen=True, slots=True)
class _Reader:
    """Columns of the records, and how files are read."""

    inputs: list[str]
    output: str
    spec: LocalSpec
    dt: float | None
    reading: ReadingOptions

    def read(self, path: Path) -> tuple[Dataset, Mapping[str, Any]]:
        """Return a record, and the column of a simulation that was recorded in it."""
        inner = innermost(self.spec)
        extra = [inner.column] if isinstance(inner, ColumnSpec) else []
        names = [*self.inputs, *extra]
        recordings = Recordings(
            *([path], names, [self.output], self.dt, self.reading), resting_inputs=True, signals=extra
        )
        (whole,) = recordings.read().records
        kept = len(self.inputs)
        return whole.first_inputs(kept), dict.fromkeys(extra, whole.u[:, -1])


class _Run:
    """One run of the command: the monitor, and the number of alarms that this run has raised."""

    def __init__(
        self,
        out: Path,
        reader: _Reader,
        spec: LocalSpec,
        settings: dict[str, Any],
        saved: SavedMonitor | None,
    ) -> None:
        self.saved, self.alarms = saved, 0
        self._out, self._reader, self._spec, self._settings = out, reader, spec, settings
        self._rejected: list[RejectedRecord] = []
        self._is_compiled = False

    def analyse(self, path: Path) -> None:
        """Analyse a file, and write the state; report a file that cannot be used, and continue."""
        sha256 = hash_file(path)
        if self.saved is not None and self.saved.knows(path.name, sha256):
            return
        try:
            record, columns = self._reader.read(path)
            record = replace(record, sha256=sha256)
            self._compile()
            monitor = self.saved or self._create(record, columns)
            before = len(monitor.state.alarms)
            monitor = monitor_record(monitor, record, path.name, find_time(path.name), columns)
        except (IslandsError, OSError) as error:
            self._reject(path.name, sha256, str(error))
            return
        for each in self._rejected:
            monitor = reject_record(monitor, each.name, each.sha256, each.reason)
        self._rejected.clear()
        self._keep(monitor)
        output.print(describe_last_record(monitor.state), markup=False)
        for alarm in monitor.state.alarms[before:]:
            self.alarms += 1
            output.print(describe_alarm_text(monitor.state, alarm), markup=False)
            self.write_result()

    def _compile(self) -> None:
        """Compile the kernels once, after the first record is read: an error in it is shown at once."""
        if not self._is_compiled:
            compile_kernels()
            self._is_compiled = True

    def _create(self, record: Dataset, columns: Mapping[str, Any]) -> SavedMonitor:
        monitor = create_monitor(record, self._spec, columns=columns, **self._settings)
        per_alarm = 1.0 / monitor.state.settings.false_alarms
        output.print(
            f"false alarms: {monitor.false_alarms}, with a record every {monitor.interval:g} s one in "
            f"{per_alarm:.0f} records",
            markup=False,
        )
        return monitor

    def write_result(self) -> None:
        """Write states and alarms for other programs, and the figure."""
        if self.saved is None:
            return
        (self._out / RESULT).write_text(monitor_json(self.saved), encoding="utf-8")
        save(draw_monitored_states(self.saved.state), self._out / FIGURE)

    def _reject(self, name: str, sha256: str, reason: str) -> None:
        errors.print(f"{name}: skipped: {reason}", markup=False)
        if self.saved is None:
            self._rejected.append(RejectedRecord(name, sha256, reason))
        else:
            self._keep(reject_record(self.saved, name, sha256, reason))

    def _keep(self, monitor: SavedMonitor) -> None:
        write_monitor(monitor, self._out / STATE)
        self.saved = monitor


def _find_columns(
    spec: LocalSpec, known: SavedMonitor | None, inputs: list[str], output_column: str | None
) -> tuple[list[str], str]:
    """Return the input columns and the output column: those given, or those of the simulation."""
    if known is not None:
        expected, expected_output = known.inputs, known.output
    elif isinstance(spec, ExtendedSpec):
        expected, expected_output = spec.inputs, spec.output
    elif isinstance(spec, OdeSpec):
        expected, expected_output = (spec.input, *spec.channels), spec.output
    else:
        expected, expected_output = (), ""
    chosen, chosen_output = inputs or list(expected), output_column or expected_output
    if not chosen or not chosen_output:
        raise SettingsError("this simulation does not name its columns: give --input and --output")
    return chosen, chosen_output
