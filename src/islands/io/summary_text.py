"""Text summary of a result: the recommended model in sentences, the search, and the table of models."""

from collections.abc import Iterator
from textwrap import fill

from islands.evolution.search_result import SearchResult
from islands.io.certificates import summarise_certificates
from islands.io.model_description import describe
from islands.io.model_table import LEGEND, table
from islands.model.equations import equation, signal_names

#: Width of the lines of settings in characters.
_WIDTH = 80


def summary(found: SearchResult) -> str:
    """Return the result as plain text."""
    record, search = found.record, found.search
    outcomes = ", ".join(f"{count} {name}" for name, count in search.outcomes.items())
    full = search.full_set
    lines = [
        *describe(found),
        "",
        f"{record.samples} samples, {record.dt:g} s: {', '.join(record.input_names)} to {record.output_name}",
        *_describe_settings(found),
        f"{search.evaluations} models estimated: {outcomes}",
        f"full polynomial set: {full['candidates']} candidates, a matrix of {full['bytes'] / 1e6:.0f} MB",
        "",
        *table(found),
        LEGEND,
        *summarise_certificates(found),
        "",
        *_describe_signals(found),
        *(f"{rank:2d}  {equation(entry.model)}" for rank, entry in enumerate(found.models, start=1)),
    ]
    return "\n".join(lines) + "\n"


def _describe_signals(found: SearchResult) -> Iterator[str]:
    model = found.recommended.model
    if model.inputs > 1:
        output, *inputs = signal_names(model)
        numbered = ", ".join(f"u{index} is {name}" for index, name in enumerate(inputs, start=1))
        yield f"y is {output}, {numbered}:"


def _describe_settings(found: SearchResult) -> list[str]:
    settings = {name: value for name, value in found.settings.items() if name != "own_primitives"}
    settings["seed"] = found.seed
    text = ", ".join(f"{name} {_format_setting(name, value)}" for name, value in settings.items())
    return fill(
        text, _WIDTH, subsequent_indent="  ", break_long_words=False, break_on_hyphens=False
    ).splitlines()


def _format_setting(name: str, value: object) -> str:
    text = " ".join(map(str, value)) if isinstance(value, tuple | list) else str(value)
    return text or ("by validation" if name == "estimator" else "none")
