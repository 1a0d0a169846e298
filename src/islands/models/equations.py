"""Equation of a model in plain text, LaTeX and MathML."""

import re
from collections.abc import Callable, Sequence
from html import escape, unescape
from textwrap import wrap
from typing import Protocol

from islands.expressions.parsing import parse
from islands.expressions.printing import (
    MINUS,
    TIMES,
    latex_factor,
    latex_number,
    mathml,
    mathml_factor,
    mathml_number,
    reader_factor,
    reader_text,
)
from islands.expressions.tree import Constant, Expression, Lagged, replace_leaves
from islands.models.regressor import Regressor
from islands.models.signal_statement import describe_signals
from islands.records.channel_names import parse_channel_name
from islands.records.signal_map import SignalReference

#: Maximum number of visible characters of a row of MathML.
_ROW_CHARACTERS = 80


class NarxTerms(SignalReference, Protocol):
    """Terms of an equation, and their parameters: what the text of a NARX model is written from."""

    @property
    def regressors(self) -> tuple[Regressor, ...]:
        """Regressors."""

    @property
    def theta(self) -> tuple[float, ...] | None:
        """One parameter per regressor. None before estimation."""

    @property
    def inputs(self) -> int:
        """Number of inputs."""

    @property
    def leads(self) -> tuple[int, ...]:
        """Number of samples that the output and each input are read early."""


def equation(
    model: NarxTerms, digits: int = 6, write: Callable[[Expression, int], str] = reader_factor
) -> str:
    """Write a model as one line: ``y(k) = 1*y(k-1) + 0.77*(u(k-1) - u(k-2))``.

    The parameters are rounded to ``digits`` significant digits. A model without parameters shows theta1 ...
    The input of a column that is read one sample early (``u_V+1``) is written as ``u(k)`` for its lag 1.
    ``write`` writes an expression of a number of inputs as a factor.
    """
    return f"y(k) = {_join_terms(_plain_terms(model, digits, write))}"


def plain_text(model: NarxTerms) -> str:
    """Write a model as one line; a second one states its signals, unless they are those of the record."""
    statement = describe_signals(model)
    return f"{equation(model)}\nwhere {statement}" if statement else equation(model)


def _plain_terms(
    model: NarxTerms, digits: int, write: Callable[[Expression, int], str] = reader_factor
) -> list[str]:
    parts = []
    for position, expression in enumerate(expressions_of_record(model)):
        weight = f"theta{position + 1}" if model.theta is None else f"{model.theta[position]:.{digits}g}"
        constant = expression == Constant(1.0)
        parts.append(weight if constant else f"{weight}*{write(expression, model.inputs)}")
    return parts


def expressions_of_record(model: NarxTerms) -> list[Expression]:
    """Return the expressions of the regressors in the columns of the record, without a lead."""
    leads = model.leads
    if not any(leads):
        return [item.expression for item in model.regressors]
    return [_delay(item.expression, leads) for item in model.regressors]


def _delay(expression: Expression, leads: Sequence[int]) -> Expression:
    return replace_leaves(expression, lambda leaf: Lagged(leaf.channel, leaf.lag - leads[leaf.channel]))


def named_equation(model: NarxTerms, digits: int = 6) -> str:
    """Write a model as one line with the column names of its record: ``y_um(k) = 0.9*y_um(k-1) + u_V(k-1)``.

    The signals have the names of `signal_names`; a factor of 1 is left out. The text is for readers;
    `parse` needs that of `equation`.
    """
    terms = [re.sub(r"^(-?)1\*", r"\1", term) for term in _plain_terms(model, digits)]
    return _name_signals(f"y(k) = {_join_terms(terms)}", model)


def signal_names(model: SignalReference) -> tuple[str, ...]:
    """Return the names of the output and of every input in the text of an equation.

    They are the columns of the record. A unit in brackets is left out (``flow`` for ``flow (l/s)``), unless
    two signals would have the same name. Other names are written in brackets: ``[flow 2]``.
    """
    return name_columns(model.output_name, model.input_names)


def name_columns(output: str, inputs: Sequence[str]) -> tuple[str, ...]:
    """Return the names of an output column and of input columns in the text of an equation."""
    columns = (output, *(parse_channel_name(name).base for name in inputs))
    stems = [name if name.isidentifier() else parse_channel_name(name).stem for name in columns]
    return tuple(
        stem if stem.isidentifier() and stems.count(stem) == 1 else f"[{name}]"
        for name, stem in zip(columns, stems, strict=True)
    )


def named_term(model: NarxTerms, position: int) -> str:
    """Write one regressor of a model with the column names of its record."""
    return _name_signals(reader_factor(expressions_of_record(model)[position], model.inputs), model)


def named_statement(text: str, model: NarxTerms) -> str:
    """Write a statement about a model with the column names of its record.

    ``[u2(k-1)] >= 0`` becomes ``[flow(k-1)] >= 0``, and ``gain(u2) = 2`` becomes ``gain(flow) = 2``. An input
    that is read one sample early has its sample in the record, as in `equation`.
    """

    def name_term(term: re.Match[str]) -> str:
        written = _delay(parse(term[1]), model.leads)
        return f"[{_name_signals(reader_text(written, model.inputs), model)}]"

    return name_gains(re.sub(r"\[([^\[\]]+)\]", name_term, text), model)


def name_gains(text: str, model: SignalReference) -> str:
    """Write a statement without terms with the column names of a record, as `named_statement`."""

    def name_gain(gain: re.Match[str]) -> str:
        return f"gain({signal_names(model)[int(gain[1] or 1)]})"

    return re.sub(r"gain\(u(\d*)\)", name_gain, text)


def _name_signals(text: str, model: NarxTerms) -> str:
    output, *inputs = signal_names(model)
    names = {"y": output, "u": inputs[0]} | {f"u{index}": name for index, name in enumerate(inputs, start=1)}
    return re.sub(r"\b(y|u\d*)\(k(?=[-)])", lambda leaf: f"{names[leaf[1]]}(k", text)


def named_signals(model: SignalReference) -> str:
    """State which signals an equation reads, with the names of `signal_names`; see `describe_signals`."""
    return describe_signals(model, signal_names(model))


def latex_equation(model: NarxTerms, digits: int = 6, statement: str | None = None) -> str:
    """Write a model as LaTeX without dollar signs: one line, and a second one for signals not of the record.

    Parameters
    ----------
    model : NarxTerms
    digits : int
        Significant digits of the parameters.
    statement : str, optional
        Statement about the signals; by default that of `describe_signals`, none if it is empty.
    """
    parts = []
    for position, expression in enumerate(expressions_of_record(model)):
        weight = (
            rf"\theta_{{{position + 1}}}"
            if model.theta is None
            else latex_number(f"{model.theta[position]:.{digits}g}")
        )
        constant = expression == Constant(1.0)
        parts.append(weight if constant else rf"{weight} \, {latex_factor(expression, model.inputs)}")
    line = f"y_{{k}} = {_join_terms(parts)}"
    statement = describe_signals(model) if statement is None else statement
    if not statement:
        return line
    return f"\\begin{{gathered}} {line} \\\\ {latex_statement(statement)} \\end{{gathered}}"


def latex_statement(statement: str) -> str:
    """Write a statement about the signals of an equation as a text in LaTeX."""
    escaped = re.sub(r"([%_&#${}])", r"\\\1", statement)
    return rf"\text{{where {escaped}}}"


def _join_terms(terms: Sequence[str]) -> str:
    return " + ".join(terms).replace("+ -", "- ")


def mathml_equation(model: NarxTerms, digits: int = 6, statement: str | None = None) -> str:
    """Write a model as a ``math`` element in ASCII that browsers render without a library.

    Browsers do not break the lines of an equation, so a long equation is a table of several rows. The last
    rows state the signals, unless they are those of the record.

    Parameters
    ----------
    model : NarxTerms
    digits : int
        Significant digits of the parameters.
    statement : str, optional
        Statement about the signals; by default that of `describe_signals`, none if it is empty.
    """
    left = f"{mathml(Lagged(0, 0))}<mo>=</mo>"
    statement = describe_signals(model) if statement is None else statement
    rows = [*_break_rows(_mathml_terms(model, digits)), *mathml_statement(statement)]
    if len(rows) == 1:
        return f'<math display="block"><mrow>{left}{rows[0]}</mrow></math>'
    lines = [
        f'<mtr><mtd>{"" if index else left}</mtd><mtd style="text-align: left">{row}</mtd></mtr>'
        for index, row in enumerate(rows)
    ]
    return f'<math display="block"><mtable>{"".join(lines)}</mtable></math>'


def mathml_statement(statement: str) -> list[str]:
    """Return the rows of a statement about the signals of an equation; none if it is empty."""
    lines = wrap(f"where {statement}", _ROW_CHARACTERS, break_on_hyphens=False) if statement else []
    return [f"<mtext>{escape(line).encode('ascii', 'xmlcharrefreplace').decode()}</mtext>" for line in lines]


def _mathml_terms(model: NarxTerms, digits: int) -> list[str]:
    """Return the terms of the model, each with its sign."""
    parts = []
    for position, expression in enumerate(expressions_of_record(model)):
        number = f"theta{position + 1}" if model.theta is None else f"{model.theta[position]:.{digits}g}"
        if model.theta is None:
            weight = f"<msub><mi>&#x3B8;</mi><mn>{position + 1}</mn></msub>"
        else:
            weight = mathml_number(number.removeprefix("-"))
        if expression != Constant(1.0):
            weight += TIMES + mathml_factor(expression, model.inputs)
        sign = MINUS if number.startswith("-") else "<mo>+</mo>" if position else ""
        # At the start of a row the sign is still a binary operator.
        parts.append((sign.replace("<mo>", '<mo form="infix">') if position else sign) + weight)
    return parts


def _break_rows(terms: Sequence[str]) -> list[str]:
    """Join terms to rows of at most `_ROW_CHARACTERS` visible characters; a longer term has its own row."""
    rows, length = [terms[0]], _count_characters(terms[0])
    for term in terms[1:]:
        if length + _count_characters(term) > _ROW_CHARACTERS:
            rows.append("")
            length = 0
        rows[-1] += term
        length += _count_characters(term)
    return rows


def _count_characters(element: str) -> int:
    return len(unescape(re.sub("<[^<>]*>", "", element)))
