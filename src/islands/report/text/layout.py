"""Layout of text for a terminal: wrapped paragraphs, and an equation with one term in each line."""

from collections.abc import Mapping
from html import escape
from textwrap import fill
from typing import Any

from islands.models.equations import signal_names
from islands.models.narx import Model
from islands.models.protocol import DynamicModel

#: Largest number of characters of a line.
WIDTH = 80

#: Mark of the recommended model, after its rank.
MARK = "*"

#: Explanation of the mark and of the order.
LEGEND = f"{MARK} recommended; ranked by the RMSE of the free run on the validation data"

_HEADING = "standard error"

#: Text in place of the standard error of a parameter that the constraints determine.
_FIXED = "fixed"


def wrap(text: str, indent: str = "  ") -> list[str]:
    """Return a paragraph as lines of at most `WIDTH` characters; those after the first are indented."""
    return fill(
        text, WIDTH, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False
    ).splitlines()


def term_table(model: DynamicModel) -> list[str]:
    """Return the equation as lines of at most 80 characters, unless a factor is longer.

    Parameters
    ----------
    model : DynamicModel
        Model with parameters.
    """
    errors = model.standard_errors
    heading = "" if errors is None else _HEADING
    if not isinstance(model, Model):
        return _list_parameters(model, heading)
    lines = [f"{signal_names(model)[0]}(k) =".ljust(WIDTH - len(heading)) + heading]
    for position, (term, theta) in enumerate(zip(model.equation().terms, model.parameters, strict=True)):
        error = "" if errors is None else (f"{errors[position]:.2g}" if errors[position] else _FIXED)
        weight = f"  {'-' if theta < 0 else '+'} {abs(theta):<11.6g}"
        lines += _break_term(weight if term == "1" else f"{weight} * {term}", error, len(weight) + 3)
    return [line.rstrip() for line in lines]


def front_table(result: Mapping[str, Any]) -> list[str]:
    """Return the form, the size, the error and the equation of every model of a result, each as one line.

    A state space has its structure in place of the equation.

    Parameters
    ----------
    result : mapping
        Content of ``result.json``.
    """
    names, units = (result["record"][key]["output"] for key in ("names", "units"))
    output, unit = (", ".join(each) if isinstance(each, list) else each for each in (names, units))
    lines = [("rank", "form", "size", f"RMSE val.{unit and f' {unit}'}", f"{output}(k) =")]
    for entry in result["models"]:
        error = entry["metrics"]["validation"]["free_run"]["rmse"]
        equation = entry["equation"].partition("\n")[0].partition(" = ")[2]
        lines.append(
            (
                f"{entry['rank']}{MARK if entry['recommended'] else ' '}",
                entry.get("form", ""),
                str(entry["size"]),
                "diverged" if error is None else f"{error:.4g}",
                entry.get("structure", equation),
            )
        )
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)][:-1]
    rows = ["  ".join([*map(str.rjust, cells, widths), last]) for *cells, last in lines]
    return [*(shorten_line(row, WIDTH) for row in rows), LEGEND]


def shorten_line(text: str, width: int) -> str:
    """Return a text of at most some characters, the end of which is left out."""
    return text if len(text) <= width else f"{text[: width - 3]}..."


def _list_parameters(model: DynamicModel, heading: str) -> list[str]:
    """Return the equations of a model, and its parameters by name."""
    lines = [part for line in model.equation().named.splitlines() for part in wrap(line, "    ")]
    lines.append("parameters".ljust(WIDTH - len(heading)) + heading)
    errors = model.standard_errors or (None,) * model.size
    for name, value, error in zip(model.parameter_names, model.parameters, errors, strict=True):
        stated = "" if error is None else f"{error:.2g}"
        text = f"  {name} = {value:.6g}"
        lines.append(text.ljust(WIDTH - len(stated)) + stated)
    return [line.rstrip() for line in lines]


def _break_term(text: str, error: str, indent: int) -> list[str]:
    """Return a term with its standard error at the right; a long term is broken between its factors."""
    first, *factors = _split_factors(text)
    lines = [first]
    for factor in factors:
        if len(lines[-1] + factor) < WIDTH - len(error):
            lines[-1] += factor
        else:
            lines.append(" " * indent + factor)
    return [*lines[:-1], lines[-1].ljust(WIDTH - len(error) - 1) + f" {error}"]


def _split_factors(text: str) -> list[str]:
    """Split a product before every multiplication sign that is outside of brackets."""
    parts, depth = [""], 0
    for character in text:
        depth += {"(": 1, "[": 1, ")": -1, "]": -1}.get(character, 0)
        if character == "*" and depth == 0:
            parts.append("")
        parts[-1] += character
    return parts


def write_html(sentence: str) -> str:
    """Write a sentence as HTML; names between backticks are code."""
    parts = map(escape, sentence.split("`"))
    return "".join(f"<code>{part}</code>" if at % 2 else part for at, part in enumerate(parts))
