"""Block of a model of one or several outputs: what all exported programs are written from.

The functions in Python, C and MATLAB read past samples from the caller's arrays. Simulators call a block once
per sample, so that it keeps the past: FMU, Simulink and Modelica. Its state is the past samples that the
equations read, newest first.
"""

import json
import math
import re
import textwrap
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property

from islands.errors import ModelError
from islands.expressions.printing import BRACKETED_OPERATORS, program_text
from islands.expressions.tree import Apply, Constant, Primitive, walk
from islands.io.coupled_models import equation_signals, input_signals, output_signals
from islands.models.coupled_narx import CoupledModel
from islands.models.equations import equation
from islands.models.narx import Model
from islands.models.signal_statement import describe_values, symbols


@dataclass(frozen=True)
class Block:
    """Equations of a model, and the signals that they read.

    Attributes
    ----------
    models : tuple of Model
        Equation of each output.
    columns : tuple of str
        Columns of the outputs, then of the inputs.
    signals : tuple of str
        Their names in programs: y and u, or y1, y2, u1, u2 ..
    names : tuple of mapping
        For each equation, the name in ``signals`` of each of its signals, ``{"y": "y2", "u2": "y1"}``.
    maximum_lag : int
    dt : float or None
        Sampling time in seconds; None for any.
    values : str
        What a sample is, see `describe_values`; empty for a sample of the record.
    """

    models: tuple[Model, ...]
    columns: tuple[str, ...]
    signals: tuple[str, ...]
    names: tuple[Mapping[str, str], ...]
    maximum_lag: int
    dt: float | None
    values: str

    @property
    def outputs(self) -> int:
        """Number of outputs."""
        return len(self.models)

    @property
    def equations(self) -> tuple[str, ...]:
        """Text of each equation: ``y1(k) = 0.9*y1(k-1) + 0.2*y2(k-1)``."""
        return tuple(
            re.sub(
                r"\b(y|u\d*)\(k(?=[-)])",
                lambda leaf, names=names: f"{names[leaf[1]]}(k",  # type: ignore[misc]
                equation(model),
            )
            for model, names in zip(self.models, self.names, strict=True)
        )

    def terms(
        self, place: int, sample: Callable[[str, int], str], function: Callable[[Primitive], str]
    ) -> list[str]:
        """Return the texts of the terms of an equation in the order in which the kernels add them.

        Parameters
        ----------
        place : int
            Place of the output.
        sample : callable
            ``sample("u", 2)`` returns the text of the sample u(k-2). The lag is 0 only for an input that the
            model reads one sample early (``u_V+1``).
        function : callable
            As in `program_text`.

        Raises
        ------
        ModelError
            The model has no parameters, or a parameter is not finite.
        """
        model = self.models[place]
        names, leads = list(self.names[place].values()), model.leads
        texts = []
        for parameter, item in zip(model.parameters, model.regressors, strict=True):
            if not math.isfinite(parameter):
                raise ModelError(
                    f"the parameter of {item.text} is {parameter}: an export needs finite parameters"
                )
            text = repr(float(parameter))
            if item.expression != Constant(1.0):
                text += "*" + program_text(
                    item.expression,
                    lambda channel, lag: sample(names[channel], lag - leads[channel]),
                    function,
                )
            texts.append(text)
        return texts

    @property
    def primitives(self) -> list[Primitive]:
        """Primitives that the equations call as functions, sorted by name."""
        called = {
            node.primitive.name: node.primitive
            for model in self.models
            for item in model.regressors
            for node in walk(item.expression)
            if isinstance(node, Apply) and node.primitive.name not in BRACKETED_OPERATORS
        }
        return [called[name] for name in sorted(called)]

    def find_unread(self, place: int) -> list[str]:
        """Return the signals that an equation does not read."""
        read = {channel for item in self.models[place].regressors for channel, _ in item.lags}
        return [name for channel, name in enumerate(self.names[place].values()) if channel not in read]

    @cached_property
    def lags(self) -> set[tuple[str, int]]:
        """Samples that the equations read: signal and lag."""
        return {
            (list(names.values())[channel], lag - model.leads[channel])
            for model, names in zip(self.models, self.names, strict=True)
            for item in model.regressors
            for channel, lag in item.lags
        }

    @cached_property
    def depths(self) -> tuple[int, ...]:
        """Number of past samples of each signal; at least one of each output."""
        lags = self.lags
        return tuple(
            max([int(channel < self.outputs), *(lag for read, lag in lags if read == name)])
            for channel, name in enumerate(self.signals)
        )

    @property
    def feedthrough(self) -> tuple[bool, ...]:
        """Whether an equation reads sample k of each signal, which is possible for inputs only."""
        lags = self.lags
        return tuple((name, 0) in lags for name in self.signals)

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

    def describe_state(self, mark: str) -> str:
        """Return a comment that lists the past samples in their order; every line begins with ``mark``."""
        listed = ", ".join(f"{self.signals[channel]}(k-{lag})" for channel, lag in self.samples)
        return textwrap.fill(listed, 100, initial_indent=mark, subsequent_indent=mark, break_on_hyphens=False)

    def describe_signals(self, quote: Callable[[str], str]) -> str:
        """Describe signals and sampling time; ``quote`` escapes a column name for use in a comment."""
        listed = [
            f"{name} = {quote(column)}" for name, column in zip(self.signals, self.columns, strict=True)
        ]
        outputs, inputs = ", ".join(listed[: self.outputs]), ", ".join(listed[self.outputs :])
        dt = "any" if self.dt is None else f"{self.dt!r} s"
        kind = "output" if self.outputs == 1 else "outputs"
        stated = [f"Inputs {inputs}", f"{kind} {outputs}", f"sampling time {dt}"]
        return f"{'; '.join(filter(None, [*stated, self.values]))}."

    def heading(self, mark: str) -> str:
        """Return the equations and the signals as an ASCII comment; every line begins with ``mark``."""
        wrapped = [f"NARX model: {self.equations[0]}"] if self.outputs == 1 else list(self.equations)
        lines = [] if self.outputs == 1 else ["Coupled NARX model:", ""]
        for each in wrapped:
            lines += textwrap.wrap(each, width=100, subsequent_indent="    ", break_long_words=False)
        # The names stay on one line: in C, a line that ends with a backslash continues on the next one.
        lines += ["", self.describe_signals(quote_name)]
        return "\n".join(f"{mark} {line}".rstrip() for line in lines)


def make_block(model: Model | CoupledModel) -> Block:
    """Return the block of a model, or of a model of several outputs."""
    dt = None if model.dt is None else float(model.dt)
    if isinstance(model, CoupledModel):
        columns = (*model.output_names, *model.models[0].column_names[: len(model.input_names)])
        names = tuple(equation_signals(model, place) for place in range(len(model.models)))
        signals = (*output_signals(model), *input_signals(model))
        return Block(model.models, columns, signals, names, model.maximum_lag, dt, describe_values(model))
    signals = symbols(model.inputs)
    columns = (model.output_name, *model.column_names)
    names = (dict(zip(signals, signals, strict=True)),)
    return Block((model,), columns, signals, names, model.maximum_lag, dt, describe_values(model))


def make_sampled_block(model: Model | CoupledModel) -> Block:
    """Return the block of a model for a simulator, which calls it at its sampling time.

    Raises
    ------
    ModelError
        The model has no sampling time, two of its columns have the same name, or a name has a character that
        cannot be printed.
    """
    block = make_block(model)
    if block.dt is None:
        raise ModelError("the model has no sampling time, which a block needs: set dt of the model")
    for name in block.columns:
        if block.columns.count(name) > 1 or not name.isprintable():
            raise ModelError(f"the column {name!r} cannot name a signal of a block: rename it")
    return block


def quote_name(name: str) -> str:
    """Return a name as a JSON string: ASCII, no line breaks, and no asterisk that could end a C comment."""
    return json.dumps(name).replace("*", r"\u002a")
