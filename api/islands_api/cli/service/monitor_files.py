"""States of a monitor of a service as text, and as the files of ``islands monitor``.

The import takes a second, since it loads the analysis and the figures.
"""

from collections.abc import Iterator
from pathlib import Path

from islands.report.documents.monitor_json import describe_alarm_text, describe_last_record, monitor_json
from islands.report.documents.monitor_state import monitor_from_json
from islands.report.figures.monitored_states import draw_monitored_states
from islands.report.figures.style import save

#: Files, as ``islands monitor`` writes them.
STATE, RESULT, FIGURE = "state.json", "monitor.json", "monitor.svg"


def describe_states(text: str) -> Iterator[str]:
    """Yield lines on the last record of a monitor, on its alarms and on rejected records.

    Parameters
    ----------
    text : str
        ``state.json`` of the monitor.
    """
    saved = monitor_from_json(text)
    yield describe_last_record(saved.state)
    for alarm in saved.state.alarms:
        yield describe_alarm_text(saved.state, alarm)
    for rejected in saved.rejected:
        yield f"{rejected.name}: rejected: {rejected.reason}"


def write_states(text: str, folder: Path) -> str:
    """Write the files of a monitor into a folder; return their names for a message."""
    saved = monitor_from_json(text)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / STATE).write_text(text, encoding="utf-8")
    (folder / RESULT).write_text(monitor_json(saved), encoding="utf-8")
    save(draw_monitored_states(saved.state), folder / FIGURE)
    return f"{folder}/: {STATE}, {RESULT}, {FIGURE}"
