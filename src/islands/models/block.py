"""Block: the difference equations of a model, in the form that all classes of models have in common.

Simulation, refinement, prediction bands, exports and diagnosis work with blocks and serve every class. A
state that is not measured is a signal with an equation, as an output is. Exported functions read past samples
from the arrays of the caller. Simulators call a block once per sample, so that it keeps the past: FMU,
Simulink and Modelica. Its state is the past samples that the equations read, newest first.
"""

import json
import math
import textwrap
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial

from islands.errors import ModelError
from islands.expressions.evaluation import value
from islands.expressions.primitives import SUB
from islands.expressions.printing import BRACKETED_OPERATORS, program_text
from islands.expressions.tree import (
    Apply,
    Constant,
    Expression,
    Lagged,
    Primitive,
    Symbol,
    lags,
    replace_leaves,
    walk,
)
from islands.records.preprocessing_steps import Preprocessing


@dataclass(frozen=True, slots=True)
class BlockTerm:
    """Term of an equation: an expression, times a parameter if it has a weight.

    Attributes
    ----------
    expression : Expression
        ``Lagged(channel, lag)`` is a sample of a signal of the block, ``Symbol(name)`` a parameter.
    weight : str
        Name of the parameter that multiplies the expression; empty for 1.
    """

    expression: Expression
    weight: str = ""


@dataclass(frozen=True, eq=False)
class Block:
    """Equations of a model, and the signals that they read.

    Attributes
    ----------
    equations : tuple of tuple of BlockTerm
        Terms of the equation of each output and of each state, which are added in their order. An equation
        reads past samples; that of an output may also read sample k of the states.
    columns : tuple of str
        Columns of the outputs, names of the states, columns of the inputs.
    signals : tuple of str
        Their names in programs: y and u, or y1, y2, x1, u1, u2 ..
    starts : tuple of Expression
        Value of each state in the samples before the first prediction, as an expression of parameters and of
        the outputs at that sample, ``Lagged(0, 0)``.
    leads : tuple of int
        Number of samples that each signal is read early: 0, or 1 for an input that acts within the sample.
        ``Lagged(channel, 1)`` of such an input is its sample k.
    parameters : mapping
        Value of each parameter by name, in the order of the model.
    warm_up : int
        Number of samples of a record before the first one that a simulation computes, unless another one is
        given.
    dt : float or None
        Sampling time in seconds; None for any.
    values : str
        What a sample is, see `describe_values`; empty for a sample of the record.
    texts : tuple of str
        Text of the equations: ``y1(k) = 0.9*y1(k-1) + 0.2*y2(k-1)``.
    levels : mapping
        Value of outputs and inputs, by name, before the first sample of a program unless others are given; 0
        for signals that are not listed.
    """

    equations: tuple[tuple[BlockTerm, ...], ...]
    columns: tuple[str, ...]
    signals: tuple[str, ...]
    starts: tuple[Expression, ...]
    leads: tuple[int, ...]
    parameters: Mapping[str, float]
    warm_up: int
    dt: float | None
    values: str
    texts: tuple[str, ...]
    levels: Mapping[str, float] = field(default_factory=dict)

    @property
    def computed(self) -> int:
        """Number of outputs and states, which have the first channels."""
        return len(self.equations)

    @property
    def outputs(self) -> int:
        """Number of outputs."""
        return self.computed - len(self.starts)

    @property
    def order(self) -> tuple[int, ...]:
        """Channels in the order in which their equations are evaluated: the states, then the outputs."""
        return (*range(self.outputs, self.computed), *range(self.outputs))

    @property
    def restarts_from_outputs(self) -> bool:
        """Whether measured outputs determine all states, so that a simulation can restart at any sample."""
        return all(lags(start) for start in self.starts)

    def terms(
        self, place: int, sample: Callable[[str, int], str], function: Callable[[Primitive], str]
    ) -> list[str]:
        """Return the texts of the terms of an equation in the order in which the kernels add them.

        Parameters
        ----------
        place : int
            Channel of the output or the state.
        sample : callable
            ``sample("u", 2)`` returns the text of the sample u(k-2). The lag is 0 for an input that the model
            reads one sample early (``u_V+1``), and for a state that is computed before.
        function : callable
            As in `program_text`.

        Raises
        ------
        ModelError
            A parameter is not finite.
        """
        texts = []
        for term in self.equations[place]:
            text = self._write(term.expression, sample, function)
            if term.weight:
                number = repr(self._finite(term.weight))
                text = number if term.expression == Constant(1.0) else f"{number}*{text}"
            texts.append(text)
        return texts

    def start_text(
        self, place: int, sample: Callable[[str, int], str], function: Callable[[Primitive], str]
    ) -> str:
        """Return the text of the value of a state before the first prediction; arguments as for `terms`."""
        return self._write(self.starts[place], sample, function)

    def _write(
        self,
        expression: Expression,
        sample: Callable[[str, int], str],
        function: Callable[[Primitive], str],
    ) -> str:
        return program_text(
            expression,
            lambda channel, lag: sample(self.signals[channel], lag - self.leads[channel]),
            function,
            lambda name: f"({self._finite(name)!r})",
        )

    def _finite(self, name: str) -> float:
        value = float(self.parameters[name])
        if not math.isfinite(value):
            raise ModelError(f"the parameter of {name} is {value}: an export needs finite parameters")
        return value

    @cached_property
    def maximum_lag(self) -> int:
        """Number of samples from which a simulation starts.

        They are those of the warm-up, whose outputs are measured; of a state space, those that it reads.
        """
        if not self.is_state_space:
            return self.warm_up
        return max((lag for each in self._expressions for _, lag in lags(each)), default=1)

    @cached_property
    def is_state_space(self) -> bool:
        """Whether the states at one sample, and the inputs, determine all outputs.

        An equation of a state reads the states one sample back, that of an output reads those of sample
        k, and no measured output determines a state.
        """
        channels = {name: channel for channel, name in enumerate(self.signals)}
        reads_states = all(
            channels[name] >= (self.outputs if lag == int(place >= self.outputs) else self.computed)
            for place in range(self.computed)
            for name, lag in self._find_samples(place)
        )
        return bool(self.starts) and reads_states and not any(map(lags, self.starts))

    @cached_property
    def late_inputs(self) -> tuple[tuple[str, int], ...]:
        """Past inputs that are part of the state of a state space: name and lag; none of other blocks."""
        if not self.is_state_space:
            return ()
        late = dict.fromkeys(self.signals[self.computed :], 0)
        for place in range(self.computed):
            for name, lag in self._find_samples(place):
                if name in late:
                    late[name] = max(late[name], lag - (place >= self.outputs))
        return tuple((name, lag) for name, deepest in late.items() for lag in range(1, deepest + 1))

    def expand_delays(self) -> "Block":
        """Return the block of a state space with the inputs that it reads late as further states.

        Programs of it need no inputs before their first sample. The state ``u_2`` is the input u(k-2).
        """
        if not self.late_inputs:
            return self
        names = [f"{name}_{lag}" for name, lag in self.late_inputs]
        signals = (*self.signals[: self.computed], *names, *self.signals[self.computed :])
        channels = {name: channel for channel, name in enumerate(signals)}
        leads = dict(zip(self.signals, self.leads, strict=True))

        def move(leaf: Lagged, now: int) -> Expression:
            name = self.signals[leaf.channel]
            late = f"{name}_{leaf.lag - leads[name] - now}"
            return Lagged(channels[late], now) if late in names else Lagged(channels[name], leaf.lag)

        def delay(name: str, lag: int) -> BlockTerm:
            before = f"{name}_{lag - 1}"
            return BlockTerm(
                Lagged(channels[name], 1 + leads[name]) if lag == 1 else Lagged(channels[before], 1)
            )

        moved = [
            tuple(
                replace(
                    term,
                    expression=replace_leaves(term.expression, partial(move, now=int(place >= self.outputs))),
                )
                for term in equation
            )
            for place, equation in enumerate(self.equations)
        ]
        levels = [Constant(self.levels.get(name, 0.0)) for name, _ in self.late_inputs]
        return replace(
            self,
            equations=(*moved, *((delay(*each),) for each in self.late_inputs)),
            columns=(*self.columns[: self.computed], *names, *self.columns[self.computed :]),
            signals=signals,
            starts=(*self.starts, *levels),
            leads=tuple(leads.get(name, 0) for name in signals),
            texts=(*self.texts, f"where {names[0]}(k) = {self.late_inputs[0][0]}(k-1)"),
        )

    def start_at(self, states: Mapping[str, float]) -> "Block":
        """Return the block that starts at given states, which are further parameters, in their order."""
        return replace(self, starts=tuple(map(Symbol, states)), parameters={**self.parameters, **states})

    def start_values(self) -> tuple[float, ...]:
        """Return the value of each past sample of the state of a program, unless others are given."""
        levels = self.find_levels()
        return tuple(levels[channel] for channel, _ in self.samples)

    def first_states(self) -> tuple[float, ...]:
        """Return the states of a state space at the first sample of a program, unless others are given.

        They follow from `start_values`, so that they are those of the start, up to rounding, if it is a rest.
        """
        levels = self.find_levels()
        return tuple(self.evaluate(place, levels) for place in range(self.outputs, self.computed))

    def find_levels(self) -> list[float]:
        """Return the value of each signal before the first sample of a program."""
        found = [self.levels.get(name, 0.0) for name in self.signals]
        for place, start in enumerate(self.starts, start=self.outputs):
            found[place] = value(start, lambda channel, _lag: found[channel], self.parameters)
        if self.is_state_space:
            found[: self.outputs] = [self.evaluate(place, found) for place in range(self.outputs)]
        return found

    def evaluate(self, place: int, levels: Sequence[float]) -> float:
        """Return the right side of an equation if all signals are constant, rounded as in programs."""
        total = 0.0
        for term in self.equations[place]:
            found = value(term.expression, lambda channel, _lag: levels[channel], self.parameters)
            total += self.parameters[term.weight] * found if term.weight else found
        return float(total)

    @property
    def _expressions(self) -> list[Expression]:
        return [*(term.expression for equation in self.equations for term in equation), *self.starts]

    @property
    def primitives(self) -> list[Primitive]:
        """Primitives that the equations call as functions, sorted by name."""
        called = {
            node.primitive.name: node.primitive
            for expression in self._expressions
            for node in walk(expression)
            if isinstance(node, Apply) and node.primitive.name not in BRACKETED_OPERATORS
        }
        return [called[name] for name in sorted(called)]

    def find_unread(self, place: int) -> list[str]:
        """Return the signals that an equation does not read."""
        read = {channel for term in self.equations[place] for channel, _ in lags(term.expression)}
        return [name for channel, name in enumerate(self.signals) if channel not in read]

    @cached_property
    def samples_read(self) -> set[tuple[str, int]]:
        """Samples that the equations read: signal and lag."""
        return {sample for place in range(self.computed) for sample in self._find_samples(place)}

    def _find_samples(self, place: int) -> set[tuple[str, int]]:
        """Return the samples that one equation reads: signal and lag."""
        return {
            (self.signals[channel], lag - self.leads[channel])
            for term in self.equations[place]
            for channel, lag in lags(term.expression)
        }

    @cached_property
    def depths(self) -> tuple[int, ...]:
        """Number of past samples of each signal; at least one of each output and state."""
        read = self.samples_read
        return tuple(
            max([int(channel < self.computed), *(lag for name_read, lag in read if name_read == name)])
            for channel, name in enumerate(self.signals)
        )

    @property
    def feedthrough(self) -> tuple[bool, ...]:
        """Whether an equation reads sample k of each input."""
        read = self.samples_read
        return tuple((name, 0) in read for name in self.signals[self.computed :])

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

    @property
    def kind_title(self) -> str:
        """First line of the comment that lists several equations."""
        return f"Model of {self.title} with states:" if self.starts else "Coupled NARX model:"

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
        kinds = (
            ("Inputs", listed[self.computed :]),
            ("output" if self.outputs == 1 else "outputs", listed[: self.outputs]),
            ("states", listed[self.outputs : self.computed]),
        )
        stated = [f"{kind} {', '.join(signals)}" for kind, signals in kinds if signals]
        dt = "any" if self.dt is None else f"{self.dt:.10g} s"
        return f"{'; '.join(filter(None, [*stated, f'sampling time {dt}', self.values]))}."

    def heading(self, mark: str) -> str:
        """Return the equations and the signals as an ASCII comment; every line begins with ``mark``."""
        wrapped = [f"NARX model: {self.texts[0]}"] if self.computed == 1 else list(self.texts)
        lines = [] if self.computed == 1 else [self.kind_title, ""]
        for each in wrapped:
            lines += textwrap.wrap(each, width=100, subsequent_indent="    ", break_long_words=False)
        # The names stay on one line: in C, a line that ends with a backslash continues on the next one.
        lines += ["", self.describe_signals(quote_name)]
        return "\n".join(f"{mark} {line}".rstrip() for line in lines)

    def describe_start(self, mark: str) -> str:
        """Return a comment that states where a free run starts; every line begins with ``mark``."""
        if self.is_state_space:
            names = self.signals[self.computed :]
            point = ", ".join(f"{name} = {self.levels.get(name, 0.0):.6g}" for name in names)
            text = (
                "The free run starts from the states at sample 0, given ones or those at the operating point "
                f"{point}, and computes every sample. `islands simulate` estimates them from the measured "
                f"output of the first {self.warm_up} samples, prints them, and computes the next samples."
            )
        else:
            samples = "sample" if self.warm_up == 1 else f"{self.warm_up} samples"
            text = (
                f"The free run starts from the first {samples} of the measured output, as does "
                f"`islands simulate --set warm_up={self.warm_up}` unless it states that it estimated them."
            )
        return textwrap.fill(text, 100, initial_indent=mark, subsequent_indent=mark)

    def check_names(self) -> None:
        """Check that a simulator can call the block at its sampling time.

        Raises
        ------
        ModelError
            The model has no sampling time, two of its columns have the same name, or a name has a character
            that cannot be printed.
        """
        if self.dt is None:
            raise ModelError("the model has no sampling time, which a block needs: set dt of the model")
        for name in self.columns:
            if self.columns.count(name) > 1 or not name.isprintable():
                raise ModelError(f"the column {name!r} cannot name a signal of a block: rename it")


def quote_name(name: str) -> str:
    """Return a name as a JSON string: ASCII, no line breaks, and no asterisk that could end a C comment."""
    return json.dumps(name).replace("*", r"\u002a")


def subtract_offsets(block: Block, preprocessing: Preprocessing | None) -> Block:
    """Return the block of a model of deviations as one of the measured signals.

    Parameters
    ----------
    block : Block
        Block of one output.
    preprocessing : Preprocessing or None
        Its offsets are subtracted from the samples that the equations read, and added to the output.
    """
    if preprocessing is None or not any((preprocessing.output_offset, *preprocessing.input_offsets)):
        return block
    states = (0.0,) * len(block.starts)
    offsets = (preprocessing.output_offset, *states, *preprocessing.input_offsets)

    def subtract(leaf: Lagged) -> Expression:
        offset = offsets[leaf.channel]
        return Apply(SUB, (leaf, Constant(offset))) if offset else leaf

    equations = [
        [BlockTerm(replace_leaves(term.expression, subtract), term.weight) for term in equation]
        for equation in block.equations
    ]
    equations[0].append(BlockTerm(Constant(offsets[0])))
    starts = tuple(replace_leaves(start, subtract) for start in block.starts)
    levels = {
        name: block.levels.get(name, 0.0) + offset
        for name, offset in zip(block.signals, offsets, strict=True)
    }
    return replace(block, equations=tuple(map(tuple, equations)), starts=starts, levels=levels)
