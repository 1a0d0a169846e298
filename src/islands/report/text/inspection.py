"""An inspection as text of 80 columns."""

from collections.abc import Iterator, Sequence
from textwrap import wrap

from islands.records.inspection.fact import Fact
from islands.records.inspection.findings import InspectedColumn, InspectedSampling, RecordInspection
from islands.report.text.layout import WIDTH
from islands.sentences import write_one

#: Titles of the facts, by name; facts with the same title are one paragraph.
_TITLES = {
    "samples": "record",
    "dead-time": "dead time",
    "feedback": "feedback",
    "rest": "rest",
    "loop": "loop",
    "noise": "noise",
    "quantisation": "quantisation",
    "saturation": "saturation",
    "drift": "drift",
    "band": "excitation",
    "levels": "excitation",
    "coverage": "excitation",
    "excitation-order": "excitation",
    "sampling-time": "rate",
    "linear": "linear",
}

#: Width of the column of titles.
_TITLE = 14

#: Columns of a file that are listed, at most, and characters of a name.
_MOST_COLUMNS, _NAME = 40, 28

#: Deviation of the steps, relative to the sampling time, from which on it is stated.
_LEAST_JITTER = 1e-3

#: Rows of a kind, and problems of columns, that are listed.
_LISTED = 3


def format_inspection(inspection: RecordInspection) -> str:
    """Return an inspection as text with lines of at most 80 characters."""
    lines = [inspection.file] if inspection.file else []
    lines += ["", *_format_columns(inspection.columns), ""]
    choice = inspection.choice
    lines += _format_paragraph("sampling", _describe_sampling(inspection.sampling))
    lines += _format_paragraph("choice", write_one("record", "text_choice", choice=choice))
    for title in dict.fromkeys(_TITLES.values()):
        sentences = [
            fact.sentence
            for fact in inspection.facts.facts
            if _TITLES[fact.name] == title and _says_much(fact)
        ]
        if sentences:
            lines += _format_paragraph(title, " ".join(sentences))
    # Without a choice, what is wrong with the columns is what to mend.
    problems = [] if choice.output else [each.problem for each in inspection.columns if each.problem]
    for note in dict.fromkeys([*inspection.warnings, *problems[:_LISTED]]):
        lines += _format_paragraph("note", note)
    if inspection.command:
        lines += ["", "Next:", *_format_command(inspection.command)]
    return "\n".join(lines) + "\n"


def _says_much(fact: Fact) -> bool:
    """Return whether a fact belongs into the text: not that a signal is as it should be."""
    if fact.name in ("feedback", "quantisation", "saturation", "levels"):
        return bool(fact.value)
    return fact.name != "samples" or ". " in fact.sentence


def _format_columns(columns: Sequence[InspectedColumn]) -> Iterator[str]:
    width = min(_NAME, max((len(column.name) for column in columns), default=0) + 1)
    width = max(width, len("column") + 1)
    yield f"{'column':<{width}}{'unit':<8}{'minimum':>12}{'maximum':>12}{'missing':>9}  role"
    for column in columns[:_MOST_COLUMNS]:
        name = _shorten(column.name, width - 1)
        role = column.role or ("unusable" if column.problem else "")
        low, high = ("" if value is None else f"{value:.5g}" for value in (column.minimum, column.maximum))
        missing = str(column.missing) if column.missing else ""
        line = f"{name:<{width}}{column.unit[:7]:<8}{low:>12}{high:>12}{missing:>9}  {role}"
        yield line.rstrip()
    if len(columns) > _MOST_COLUMNS:
        yield f"and {len(columns) - _MOST_COLUMNS} more"


def _shorten(name: str, most: int) -> str:
    """Return a name without its middle if it is long: the names of a logger may differ at their ends only."""
    if len(name) <= most:
        return name
    end = (most - 3) // 2
    return f"{name[: most - 3 - end]}...{name[-end:]}"


def _describe_sampling(sampling: InspectedSampling) -> str:
    kinds = {"gaps": sampling.gaps, "repeated": sampling.repeated, "backward": sampling.backward}
    breaks = [
        (kind, rows[:_LISTED], sampling.counts[kind] - min(len(rows), _LISTED))
        for kind, rows in kinds.items()
        if rows
    ]
    varies = sampling.jitter is not None and sampling.jitter >= _LEAST_JITTER
    return write_one("record", "text_sampling", sampling=sampling, varies=varies, breaks=breaks)


def _format_paragraph(title: str, text: str) -> list[str]:
    return wrap(
        text,
        WIDTH,
        initial_indent=f"{title:<{_TITLE}}",
        subsequent_indent=" " * _TITLE,
        break_on_hyphens=False,
    )


def _format_command(command: str) -> list[str]:
    """Return a command that can be pasted; long ones continue on the next line."""
    lines = [""]
    for option in command.replace(" --", "\n--").split("\n"):
        if lines[-1] and len(lines[-1]) + len(option) + 5 > WIDTH:
            lines.append("")
        lines[-1] += (" " if lines[-1] else "") + option
    return [
        f"{'  ' if place == 0 else '    '}{line}" + " \\" * (place + 1 < len(lines))
        for place, line in enumerate(lines)
    ]
