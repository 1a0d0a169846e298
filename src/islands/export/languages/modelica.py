"""Export of a model as a Modelica block."""

from collections.abc import Mapping
from types import MappingProxyType

from islands.errors import ModelError
from islands.export.languages.bodies import function_name
from islands.expressions.primitives import LARGEST_EXPONENT
from islands.expressions.tree import Primitive
from islands.models.block import Block
from islands.records.channel_names import parse_unit

_FILE = """\
block NarxModel "NARX model of {title}"
{heading}
  // The first sample is at time 0. The parameters are the samples before it, newest first.
{parameters}
{connectors}
protected
{states}{functions}equation
  when sample(0, {dt!r}) then
    {equations}
    {shifts}
  end when;
end NarxModel;
"""

#: Expressions of the primitives that are functions, in Modelica.
_BODIES: Mapping[str, str] = MappingProxyType(
    {
        "sign": "if a > 0 then 1.0 elseif a < 0 then -1.0 else 0.0",
        "div": "if b == 0 then 0.0 else a/b",
        "abs": "abs(a)",
        "sqrt": "sqrt(abs(a))",
        "exp": f"exp(min(a, {LARGEST_EXPONENT}))",
        "log": "if a == 0 then 0.0 else log(abs(a))",
        "sin": "sin(a)",
        "cos": "cos(a)",
        "tanh": "tanh(a)",
        "max": "if a > b then a else b",
        "min": "if a < b then a else b",
    }
)


def modelica_source(block: Block) -> str:
    """Return a block as a Modelica block.

    It has connectors of the Modelica Standard Library and samples its inputs with the sampling time of the
    model. Sums and products are evaluated in the same order as in this package's kernels.

    Raises
    ------
    ModelError
        The model has no finite parameters or no sampling time, or it has a user-defined primitive.
    """
    block.check_names()
    stored = [(name, depth) for name, depth in zip(block.signals, block.depths, strict=True) if depth]
    return _FILE.format(
        title=_escape(block.title),
        heading=block.heading("  //"),
        parameters="\n".join(_parameter(block, name, depth) for name, depth in stored),
        connectors="\n".join(_connector(block, channel) for channel in range(len(block.signals))),
        states="".join(
            f"  discrete Real past_{name}[{depth}](start = start_{name}, each fixed = true);\n"
            for name, depth in stored
        ),
        functions="".join(_function(each) for each in block.primitives),
        dt=block.dt,
        equations="\n    ".join(
            f"{name} = {_join_terms(block.terms(place, _sample, function_name))};"
            for place, name in ((place, block.signals[place]) for place in block.order)
        ),
        shifts="\n    ".join(
            f"past_{name}[{lag}] = {f'pre(past_{name}[{lag - 1}])' if lag > 1 else name};"
            for name, depth in stored
            for lag in range(1, depth + 1)
        ),
    )


def _sample(signal: str, lag: int) -> str:
    return f"pre(past_{signal}[{lag}])" if lag else signal


def _join_terms(terms: list[str]) -> str:
    # Modelica has no sign after an operator.
    return "\n      + ".join(terms).replace("+ -", "- ")


def _parameter(block: Block, name: str, depth: int) -> str:
    lags = ", ".join(f"{name}(k-{lag})" for lag in range(1, depth + 1))
    start = block.start_values()[block.position(name, 1)]
    return f'  parameter Real start_{name}[{depth}] = fill({start!r}, {depth}) "{lags}";'


def _connector(block: Block, channel: int) -> str:
    column, kind = block.columns[channel], "RealOutput" if channel < block.computed else "RealInput"
    unit = parse_unit(column)
    declared = f'(unit = "{_escape(unit)}")' if unit else ""
    return f'  Modelica.Blocks.Interfaces.{kind} {block.signals[channel]}{declared} "{_escape(column)}";'


def _function(primitive: Primitive) -> str:
    if primitive.name not in _BODIES:
        raise ModelError(
            f"primitive {primitive.name!r} has no text in Modelica: only built-in primitives can be exported"
        )
    inputs = "".join(f"    input Real {name};\n" for name in "ab"[: primitive.arity])
    name = function_name(primitive)
    return (
        f"  function {name}\n{inputs}    output Real r;\n  algorithm\n"
        f"    r := {_BODIES[primitive.name]};\n  end {name};\n"
    )


def _escape(text: str) -> str:
    """Return a text for a string literal."""
    return text.replace("\\", "\\\\").replace('"', '\\"')
