"""Sampled block of one or several equations, with a state: the past samples that they read, newest first.

Simulators call a block once per sample, so that the block keeps the past: FMU, Simulink and Modelica. The C
and MATLAB functions read it from the caller's arrays.
"""

import textwrap
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

from islands.errors import ModelError
from islands.export.coupled.coupled_signals import (
    coupled_functions,
    coupled_heading,
    equation_terms,
    equation_text,
    input_signals,
    output_signals,
)
from islands.export.languages.c import c_name, definition
from islands.export.parts import functions, heading, signals, terms
from islands.expressions.tree import Expression, Lagged, Primitive, walk
from islands.model.equations import equation
from islands.model.model import Model
from islands.model.signal_statement import describe_values
from islands.simulation.coupled_model import CoupledModel

#: Writes the terms of an equation; the arguments are those of `terms`.
_TermWriter = Callable[[Callable[[str, int], str], Callable[[Primitive], str]], list[str]]


@dataclass(frozen=True, slots=True)
class SampledBlock:
    """Equations of a block and the layout of its state.

    Attributes
    ----------
    columns : tuple of str
        Columns of the outputs, then of the inputs.
    signals : tuple of str
        Their names in programs: y and u, or y1, y2, u1, u2 ..
    outputs : int
        Number of outputs.
    depths : tuple of int
        Number of past samples of each signal; at least one of each output.
    feedthrough : tuple of bool
        Whether an equation reads sample k of the signal, which is possible for inputs only.
    dt : float
        Sampling time in seconds.
    values : str
        What a sample of the block is, see `describe_values`; empty for a sample of the record.
    equations : tuple of str
        Text of the equation of each output.
    terms : tuple of callable
        ``terms[place](sample, function)`` returns the texts of the terms of an equation; see `terms`.
    primitives : tuple of Primitive
        Primitives that are called as functions.
    heading : callable
        ``heading(mark)`` returns the equations and the signals as a comment.
    """

    columns: tuple[str, ...]
    signals: tuple[str, ...]
    outputs: int
    depths: tuple[int, ...]
    feedthrough: tuple[bool, ...]
    dt: float
    values: str
    equations: tuple[str, ...]
    terms: tuple[_TermWriter, ...]
    primitives: tuple[Primitive, ...]
    heading: Callable[[str], str]

    @property
    def size(self) -> int:
        """Number of past samples of all signals."""
        return sum(self.depths)

    @property
    def samples(self) -> tuple[tuple[int, int], ...]:
        """The pairs (channel, lag) of the state, in its order."""
        return tuple(
            (channel, lag) for channel, depth in enumerate(self.depths) for lag in range(1, depth + 1)
        )

    @property
    def title(self) -> str:
        """Columns of the outputs."""
        return ", ".join(self.columns[: self.outputs])

    def position(self, signal: str, lag: int) -> int:
        """Return the position of a past sample; ``position("u", 1)`` is that of u(k-1)."""
        return sum(self.depths[: self.signals.index(signal)]) + lag - 1

    def describe(self, mark: str) -> str:
        """Return a comment that lists the past samples in their order; every line begins with ``mark``."""
        listed = ", ".join(f"{self.signals[channel]}(k-{lag})" for channel, lag in self.samples)
        return textwrap.fill(listed, 100, initial_indent=mark, subsequent_indent=mark, break_on_hyphens=False)


def make_block(model: Model | CoupledModel) -> SampledBlock:
    """Return the block of a model, or of a model of several outputs.

    Raises
    ------
    ModelError
        The model has no sampling time, two of its columns have the same name, or a name has a character that
        cannot be printed.
    """
    if isinstance(model, CoupledModel):
        places = range(len(model.models))
        outputs, first = output_signals(model), model.models[0]
        columns = (*model.output_names, *first.column_names[: len(model.input_names)])
        names = (*outputs, *input_signals(model))
        expressions = [each for place in places for each in model.expressions(place)]
        equations = tuple(equation_text(model, place) for place in places)
        writers = tuple(partial(equation_terms, model, place) for place in places)
        primitives, write_heading = coupled_functions(model), partial(coupled_heading, model)
    else:
        outputs = ["y"]
        columns, names = (model.output_name, *model.column_names), tuple(signals(model))
        expressions = [item.expression for item in model.regressors]
        equations, writers = (equation(model),), (partial(terms, model),)
        primitives, write_heading = functions(model), partial(heading, model)
    if model.dt is None:
        raise ModelError("the model has no sampling time, which a block needs: set dt of the model")
    for name in columns:
        if columns.count(name) > 1 or not name.isprintable():
            raise ModelError(f"the column {name!r} cannot name a signal of a block: rename it")
    lags = _collect_lags(expressions, model.leads)
    depths = [max([0, *(lag for each, lag in lags if each == channel)]) for channel in range(len(names))]
    return SampledBlock(
        columns,
        names,
        len(outputs),
        tuple(max(depth, int(channel < len(outputs))) for channel, depth in enumerate(depths)),
        tuple((channel, 0) in lags for channel in range(len(names))),
        float(model.dt),
        describe_values(model),
        equations,
        writers,
        tuple(primitives),
        write_heading,
    )


def _collect_lags(expressions: Sequence[Expression], leads: Sequence[int]) -> set[tuple[int, int]]:
    leaves = (node for each in expressions for node in walk(each) if isinstance(node, Lagged))
    return {(leaf.channel, leaf.lag - leads[leaf.channel]) for leaf in leaves}


_C_BLOCK = """\
enum {{ OUTPUTS = {outputs}, INPUTS = {inputs}, STATES = {states}, FEEDTHROUGH = {feedthrough} }};

/* Number of past samples of each output and each input in the state, newest first. */
static const int DEPTHS[OUTPUTS + INPUTS] = {{{depths}}};

/* Sampling time in seconds. */
static const double STEP = {dt!r};

{functions}/* Compute the outputs of sample k from the past samples and the inputs of sample k. */
static void compute(const double *state, const double *input, double *output)
{{
    double total;
    (void)input;
    {equations}
}}

/* Move on to the next sample: the outputs and inputs of sample k become the newest past samples. */
static void advance(double *state, const double *output, const double *input)
{{
    for (int channel = 0; channel < OUTPUTS + INPUTS; ++channel) {{
        for (int place = DEPTHS[channel] - 1; place > 0; --place) {{
            state[place] = state[place - 1];
        }}
        if (DEPTHS[channel] > 0) {{
            state[0] = channel < OUTPUTS ? output[channel] : input[channel - OUTPUTS];
        }}
        state += DEPTHS[channel];
    }}
}}
"""


def c_block(block: SampledBlock) -> str:
    """Return the functions ``compute`` and ``advance`` of a block in C99, for inclusion in a program.

    Sums and products are evaluated in the same order as in this package's kernels.

    Raises
    ------
    ModelError
        The model has no finite parameters, or a user-defined primitive has no C body.
    """

    def read(signal: str, lag: int) -> str:
        if lag:
            return f"state[{block.position(signal, lag)}]"
        return f"input[{block.signals.index(signal) - block.outputs}]"

    lines = ["(void)state;"]
    for place, write in enumerate(block.terms):
        lines += ["total = 0.0;", *(f"total += {term};" for term in write(read, c_name))]
        lines.append(f"output[{place}] = total;")
    return _C_BLOCK.format(
        outputs=block.outputs,
        inputs=len(block.signals) - block.outputs,
        states=block.size,
        feedthrough=int(any(block.feedthrough)),
        depths=", ".join(map(str, block.depths)),
        dt=block.dt,
        functions="".join(f"{definition(each, c_name(each))}\n" for each in block.primitives),
        equations="\n    ".join(lines),
    )
