"""State of a sampled block: the past samples that a model reads, newest first, one signal after the other.

Simulators call a block once per sample, so that the block keeps the past: FMU, Simulink and Modelica. The C
and MATLAB functions read it from the caller's arrays.
"""

import textwrap
from dataclasses import dataclass

from islands.errors import ModelError
from islands.io.export.c import c_name, definition
from islands.io.export.parts import functions, signals, terms
from islands.model.model import Model


@dataclass(frozen=True, slots=True)
class SampledState:
    """Layout of the state of a model.

    Attributes
    ----------
    columns : tuple of str
        Column of the output, then of every input.
    signals : tuple of str
        Their names in programs: y and u, or y, u1, u2 ..
    depths : tuple of int
        Number of past samples of each; at least one of the output.
    feedthrough : tuple of bool
        Whether y(k) reads sample k of the signal, which is possible for inputs only.
    dt : float
        Sampling time in seconds.
    """

    columns: tuple[str, ...]
    signals: tuple[str, ...]
    depths: tuple[int, ...]
    feedthrough: tuple[bool, ...]
    dt: float

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

    def position(self, signal: str, lag: int) -> int:
        """Return the position of a past sample; ``position("u", 1)`` is that of u(k-1)."""
        return sum(self.depths[: self.signals.index(signal)]) + lag - 1

    def describe(self, mark: str) -> str:
        """Return a comment that lists the past samples in their order; every line begins with ``mark``."""
        listed = ", ".join(f"{self.signals[channel]}(k-{lag})" for channel, lag in self.samples)
        return textwrap.fill(listed, 100, initial_indent=mark, subsequent_indent=mark, break_on_hyphens=False)


def make_sampled_state(model: Model) -> SampledState:
    """Return the layout of the state of a model.

    Raises
    ------
    ModelError
        The model has no sampling time, two of its columns have the same name, or a name has a character that
        cannot be printed.
    """
    columns = (model.output_name, *model.column_names)
    if model.dt is None:
        raise ModelError("the model has no sampling time, which a block needs: set dt of the model")
    for name in columns:
        if columns.count(name) > 1 or not name.isprintable():
            raise ModelError(f"the column {name!r} cannot name a signal of a block: rename it")
    lags = {(channel, lag - model.leads[channel]) for item in model.regressors for channel, lag in item.lags}
    depths = [
        max([0, *(lag for each, lag in lags if each == channel)]) for channel in range(model.inputs + 1)
    ]
    return SampledState(
        columns,
        tuple(signals(model)),
        (max(depths[0], 1), *depths[1:]),
        tuple((channel, 0) in lags for channel in range(model.inputs + 1)),
        float(model.dt),
    )


_C_BLOCK = """\
enum {{ INPUTS = {inputs}, STATES = {states}, FEEDTHROUGH = {feedthrough} }};

/* Number of past samples of the output and of each input in the state, newest first. */
static const int DEPTHS[1 + INPUTS] = {{{depths}}};

/* Sampling time in seconds. */
static const double STEP = {dt!r};

{functions}/* Return y(k) from the past samples and the inputs of sample k. */
static double output(const double *state, const double *input)
{{
    double total = 0.0;
    (void)state;
    (void)input;
    {terms}
    return total;
}}

/* Move on to the next sample: y(k) and the inputs of sample k become the newest past samples. */
static void advance(double *state, double y, const double *input)
{{
    for (int channel = 0; channel <= INPUTS; ++channel) {{
        for (int place = DEPTHS[channel] - 1; place > 0; --place) {{
            state[place] = state[place - 1];
        }}
        if (DEPTHS[channel] > 0) {{
            state[0] = channel == 0 ? y : input[channel - 1];
        }}
        state += DEPTHS[channel];
    }}
}}
"""


def c_block(model: Model, state: SampledState) -> str:
    """Return the functions ``output`` and ``advance`` of a model in C99, for inclusion in a program.

    Sums and products are evaluated in the same order as in this package's kernels.
    """
    lines = terms(
        model,
        lambda signal, lag: (
            f"state[{state.position(signal, lag)}]" if lag else f"input[{state.signals.index(signal) - 1}]"
        ),
        c_name,
    )
    return _C_BLOCK.format(
        inputs=model.inputs,
        states=state.size,
        feedthrough=int(any(state.feedthrough)),
        depths=", ".join(map(str, state.depths)),
        dt=state.dt,
        functions="".join(f"{definition(each, c_name(each))}\n" for each in functions(model)),
        terms="\n    ".join(f"total += {term};" for term in lines),
    )
