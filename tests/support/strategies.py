"""Hypothesis strategies: expressions, signals, models, small records, topologies and schedules.

Tests that compare values draw numbers from a coarse grid of binary fractions. Sums and products of a few of
them are exact: an argument is either exactly at a jump of sign, max or a protected division, or far from it.
"""

import math
import random
from dataclasses import replace

import numpy as np
from hypothesis import settings
from hypothesis import strategies as st

from islands.evolution.migration import TOPOLOGIES, WITH_DEGREE
from islands.expressions.evaluation import value
from islands.expressions.primitives import ADD, MUL, PRIMITIVES
from islands.expressions.tree import Apply, Constant, Lagged, Shift
from islands.models.narx import make_model
from islands.models.regressor import regressor
from islands.records.dataset import Dataset

#: Number of inputs.
INPUTS = 2

#: Largest lag of a leaf.
DEEPEST = 12

#: Multiples of 1/8 up to 4 in size.
grid = st.integers(-32, 32).map(lambda eighths: eighths / 8)
numbers = st.one_of(st.sampled_from([0.0, 1.0, -1.0, 2.0, -0.5]), grid)
any_number = st.floats(allow_nan=False, allow_infinity=False)


def leaves(inputs=INPUTS):
    return st.builds(Lagged, st.integers(0, inputs), st.integers(1, DEEPEST))


#: Kinds of nodes. Those that canonical form changes (products, sums, powers, coefficients) are more frequent.
_KINDS = (
    *("leaf", "leaf", "constant"),
    *("function", "function", "function"),
    *("several", "several", "power", "scaled", "shift"),
)


@st.composite
def expressions(draw, inputs=INPUTS, constants=numbers, height=4):
    """Draw trees over y, u1 .. and every primitive; sums and products have up to five arguments."""
    kind = draw(st.sampled_from(_KINDS)) if height else draw(st.sampled_from(["leaf", "leaf", "constant"]))
    below = expressions(inputs, constants, height - 1)
    match kind:
        case "leaf":
            return draw(leaves(inputs))
        case "constant":
            return Constant(draw(constants))
        case "function":
            primitive = draw(st.sampled_from(list(PRIMITIVES.values())))
            return Apply(primitive, tuple(draw(below) for _ in range(primitive.arity)))
        case "several":
            primitive = draw(st.sampled_from([MUL, ADD]))
            return Apply(primitive, tuple(draw(st.lists(below, min_size=2, max_size=5))))
        case "power":
            return Apply(MUL, (draw(below),) * draw(st.integers(2, 5)))
        case "scaled":
            return Apply(MUL, (Constant(draw(constants)), draw(below)))
        case _:
            return Shift(draw(st.integers(1, 5)), draw(below))


def regressors(inputs=INPUTS, height=3):
    """Return a strategy for canonical regressors that are not identically zero."""
    return (
        expressions(inputs, height=height)
        .map(lambda expression: regressor(expression)[1])
        .filter(lambda item: item is not None)
    )


@st.composite
def signals(draw):
    """Draw a function (channel, lag) -> number on the grid, for every lag that an expression can reach."""
    seed = draw(st.integers(0, 2**32 - 1))
    return lambda channel, lag: random.Random(seed + 1000 * channel + lag).randint(-32, 32) / 8


@st.composite
def models(draw, inputs=INPUTS, most=5):
    """Draw models with parameters."""
    terms = draw(st.lists(st.tuples(regressors(inputs, 2), grid), min_size=1, max_size=most))
    names = ("u",) if inputs == 1 else tuple(f"u{index + 1}" for index in range(inputs))
    return make_model([(item.expression, theta) for item, theta in terms], names)


@st.composite
def records(draw, inputs=INPUTS, shortest=1, longest=40):
    """Draw small records of one to three segments with values of order one."""
    segments = tuple(draw(st.lists(st.integers(shortest, longest), min_size=1, max_size=3)))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    samples = sum(segments)
    return Dataset(rng.normal(size=(samples, inputs)), rng.normal(size=samples), 0.1, segments=segments)


def settled_value(expression, signal, perturbations=4):
    """Return the value of an expression, or None if it depends on rounding errors.

    The result of every node is perturbed by 1e-10 of its size. A value that changes by much more is at a jump
    of sign or of a protected function, or is the result of a cancellation.
    """
    try:
        plain = value(expression, signal)
        perturbed = [
            value(_perturb(expression, random.Random(seed)), signal) for seed in range(perturbations)
        ]
    except (OverflowError, ValueError):
        return None
    tolerance = 1e-7 * abs(plain)
    stable = abs(plain) < 1e100 and all(abs(other - plain) <= tolerance for other in perturbed)
    return plain if stable else None


def _perturb(expression, rng):
    match expression:
        case Shift(samples, argument):
            return Shift(samples, _perturb(argument, rng))
        case Apply(primitive, arguments):
            scalar = primitive.scalar
            noisy = replace(
                primitive, scalar=lambda *values: scalar(*values) * (1 + 1e-10 * rng.uniform(-1, 1))
            )
            return Apply(noisy, tuple(_perturb(argument, rng) for argument in arguments))
        case _:
            return expression


def nearly(a, b):
    """Return whether two values of `settled_value` are equal up to rounding."""
    return math.isclose(a, b, rel_tol=1e-6, abs_tol=1e-280)


def edges(islands):
    """Return a strategy for unique edges between different islands."""
    pairs = [(source, target) for source in range(islands) for target in range(islands) if source != target]
    return st.lists(st.sampled_from(pairs), min_size=1, max_size=3 * islands, unique=True)


@st.composite
def layouts(draw, most=12):
    """Draw the text of a topology and a number of islands that it supports."""
    islands = draw(st.integers(1, most))
    texts = [st.sampled_from([name for name in TOPOLOGIES if name not in WITH_DEGREE])]
    if islands > 1:
        texts.append(edges(islands).map(lambda drawn: ",".join(f"{a}>{b}" for a, b in drawn)))
        texts.append(st.integers(1, islands - 1).map(lambda degree: f"random-regular:{degree}"))
    return draw(st.one_of(texts)), islands


@st.composite
def schedules(draw, least=1, most=9, latest=40):
    """Draw the pieces of a schedule: first generation and value of each."""
    begins = draw(st.lists(st.integers(1, latest), max_size=3, unique=True).map(sorted))
    return tuple((begin, draw(st.integers(least, most))) for begin in (0, *begins))


def schedule_text(pieces):
    (_, first), *others = pieces
    return ",".join([str(first), *(f"{begin}:{value}" for begin, value in others)])


def part_of_the_examples(share):
    """Return settings of a costly property: the number of examples of the profile, divided by ``share``."""
    return settings(max_examples=max(1, settings().max_examples // share))
