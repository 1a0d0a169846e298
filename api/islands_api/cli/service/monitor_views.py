"""Views of ``islands monitors``: monitors of a service as JSON or lines."""

from collections.abc import Sequence

from islands.io.checkpoints.monitor_state import SavedMonitor
from islands.io.result_text.monitor_text import describe_alarm_text, describe_last_record
from islands_api.cli.console import output
from islands_api.cli.service.job_views import print_json
from islands_api.monitor_schemas import MonitorSummary, MonitorView

#: Line of a monitor in a list.
_LINE = "{:32}  {:8}  {:>7}  {:>6}  {:>7}  {}"


def show_monitor(monitor: MonitorView, saved: SavedMonitor | None, as_json: bool) -> None:
    """Show a monitor: its status, its last record, and its alarms.

    Parameters
    ----------
    saved : SavedMonitor or None
        Its states; None before the first record.
    """
    if as_json:
        print_json(monitor.model_dump(mode="json"))
        return
    named = f" ({monitor.name})" if monitor.name else ""
    counts = f"records {monitor.records}, alarms {monitor.alarms}"
    waiting = f", records to analyse {monitor.pending}" if monitor.pending else ""
    output.print(f"monitor {monitor.id}{named}: {monitor.status}, {counts}{waiting}", markup=False)
    if saved is None:
        return
    output.print(describe_last_record(saved.state), markup=False)
    for alarm in saved.state.alarms:
        output.print(describe_alarm_text(saved.state, alarm), markup=False)
    for rejected in saved.rejected:
        output.print(f"{rejected.name}: rejected: {rejected.reason}", markup=False)


def show_monitors(monitors: Sequence[MonitorSummary], as_json: bool) -> None:
    """Show a list of monitors."""
    if as_json:
        print_json({"items": [monitor.model_dump(mode="json") for monitor in monitors]})
        return
    # Not a table: it would truncate the ids in a narrow terminal or a pipe.
    output.print(_LINE.format("monitor", "status", "records", "alarms", "pending", "name"), markup=False)
    for each in monitors:
        line = _LINE.format(each.id, each.status, each.records, each.alarms, each.pending, each.name)
        output.print(line, markup=False)
