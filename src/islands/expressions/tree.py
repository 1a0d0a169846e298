"""Expressions: the genes of evolution, the regressors of a model, the equations of a simulation.

An expression is an immutable tree with five kinds of node. A leaf is a lagged signal, a constant, or the name
of a value. Genes and regressors read lagged signals: channel 0 is the output y, channel i >= 1 is the input
u_i, and the lag is one sample by default. A back-shift adds to the lags of all leaves below it, so
``q5(q5(u1))`` is ``u1(k-11)`` (the paper, section 5.1). Equations read names.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field

from islands.errors import ModelError


@dataclass(frozen=True, slots=True)
class Primitive:
    """A function for use in expressions.

    ``scalar`` defines the function. The other attributes declare properties for simplification and export.
    Two primitives are equal if they have the same name, and both or neither of them are protected.

    Attributes
    ----------
    name : str
        Name in plain text: ``tanh``.
    arity : int
        1 or 2, or 3 for ``where`` in equations.
    scalar : callable
        Maps ``arity`` finite floats to a finite float. It uses only arithmetic and the functions of ``math``,
        so that it can be compiled. A function that is not protected also maps arrays, and is NaN or infinite
        outside its domain.
    latex : str
        Format string with ``{0}`` and ``{1}`` for the arguments.
    c, matlab : str
        Body of a function of ``a`` (and ``b``): ``return a > b ? a : b;`` in C with the functions of math.h,
        ``r = max(a, b);`` in MATLAB. If empty, a model with this primitive cannot be exported to that
        language.
    parity : -1, 0 or 1
        1: f(-x) = f(x). -1: f(-x) = -f(x). 0: neither. Only for unary primitives.
    degree : float or None
        f(c x) = c^degree f(x) for every c > 0. None if not homogeneous. Only for unary primitives.
    commutative : bool
        Whether f(a, b) = f(b, a).
    simplify : callable or None
        Maps the canonical arguments to an equal, simpler expression, or to None if it finds none.
    summary : str
        One-line description for the reference.
    is_protected : bool
        Whether the function is finite everywhere, as a search needs. The functions of equations are not, but
        sums, differences and products are the same functions in both.
    protected_text : str
        Format string of the function in the text of an equation for readers: ``sqrt(abs({0}))`` of a square
        root that is protected. If empty, the name and the arguments.
    """

    name: str
    arity: int = field(compare=False)
    scalar: Callable[..., float] = field(compare=False)
    latex: str = field(default="", compare=False)
    c: str = field(default="", compare=False)
    matlab: str = field(default="", compare=False)
    parity: int = field(default=0, compare=False)
    degree: float | None = field(default=None, compare=False)
    commutative: bool = field(default=False, compare=False)
    simplify: "Callable[..., Expression | None] | None" = field(default=None, compare=False)
    summary: str = field(default="", compare=False)
    is_protected: bool = True
    protected_text: str = field(default="", compare=False)


def name_function(name: str) -> Primitive:
    """Return a function that is printed by its name, and not evaluated."""
    return Primitive(name, 1, _read_signal, is_protected=False)


def _read_signal(*_: float) -> float:
    raise ModelError("a rate, a delay and a value of an FMU are given, not computed from numbers")


#: Functions of a signal as a whole in equations: its rate and its delay, evaluated before the integration.
RATE = Primitive("rate", 1, _read_signal, is_protected=False)
DELAY = Primitive("delay", 2, _read_signal, is_protected=False)
SIGNAL_FUNCTIONS = (RATE, DELAY)

#: Function of the name of a state or an output: its derivative or its value according to an FMU.
FMU = Primitive("fmu", 1, _read_signal, is_protected=False)


@dataclass(frozen=True, slots=True)
class Lagged:
    """A lagged signal: ``Lagged(0, 2)`` is y(k-2), ``Lagged(1, 1)`` is u1(k-1)."""

    channel: int
    lag: int = 1


@dataclass(frozen=True, slots=True)
class Constant:
    """A finite number."""

    value: float


@dataclass(frozen=True, slots=True)
class Symbol:
    """The name of a value: an input, a channel, a state, a variable, a parameter, ``t`` or ``force``."""

    name: str


@dataclass(frozen=True, slots=True)
class Shift:
    """The back-shift operator, which adds ``samples`` to every lag of ``argument``."""

    samples: int
    argument: "Expression"
    _hash: int = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        # A search looks up trees a million times, and trees share subtrees: compute the hash once.
        object.__setattr__(self, "_hash", hash((self.samples, self.argument)))

    def __hash__(self) -> int:
        return self._hash

    def __reduce__(self) -> tuple[type, tuple[object, ...]]:
        # The hash is valid in this process only: do not pickle it.
        return Shift, (self.samples, self.argument)


@dataclass(frozen=True, slots=True)
class Apply:
    """A primitive applied to its arguments. Canonical sums and products have any number of arguments."""

    primitive: Primitive
    arguments: "tuple[Expression, ...]"
    _hash: int = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_hash", hash((self.primitive.name, self.arguments)))

    def __hash__(self) -> int:
        return self._hash

    def __reduce__(self) -> tuple[type, tuple[object, ...]]:
        return Apply, (self.primitive, self.arguments)


Expression = Lagged | Constant | Symbol | Shift | Apply


def children(expression: Expression) -> tuple[Expression, ...]:
    """Return the child nodes of the root."""
    match expression:
        case Shift(_, argument):
            return (argument,)
        case Apply(_, arguments):
            return arguments
        case _:
            return ()


def walk(expression: Expression) -> Iterator[Expression]:
    """Yield every node in pre-order, from left to right."""
    yield expression
    for child in children(expression):
        yield from walk(child)


def height(expression: Expression) -> int:
    """Count the edges from the root to the deepest leaf, back-shifts included (the paper's GP height)."""
    return max((1 + height(child) for child in children(expression)), default=0)


def remove_shifts(expression: Expression, samples: int = 0) -> Expression:
    """Replace every back-shift by larger lags at the leaves, and add ``samples`` to all lags."""
    match expression:
        case Lagged(channel, lag):
            return Lagged(channel, lag + samples)
        case Shift(more, argument):
            return remove_shifts(argument, samples + more)
        case Apply(primitive, arguments):
            return Apply(primitive, tuple(remove_shifts(argument, samples) for argument in arguments))
        case Constant() | Symbol():
            return expression


def lags(expression: Expression) -> frozenset[tuple[int, int]]:
    """Return the pairs (channel, lag) that the expression reads."""
    found: list[tuple[int, int]] = []
    _add_lags(expression, 0, found)
    return frozenset(found)


def _add_lags(expression: Expression, samples: int, found: list[tuple[int, int]]) -> None:
    """Add the pairs of the leaves, without building the tree that has no back-shifts."""
    match expression:
        case Lagged(channel, lag):
            found.append((channel, lag + samples))
        case Apply(_, arguments):
            for argument in arguments:
                _add_lags(argument, samples, found)
        case Shift(more, argument):
            _add_lags(argument, samples + more, found)


def find_symbols(expression: Expression) -> Iterator[str]:
    """Yield the names in an expression from left to right, also those of delayed signals and their delays.

    What an FMU computes has no names of the equations.
    """
    match expression:
        case Symbol(name):
            yield name
        case Apply(primitive, arguments) if primitive != FMU:
            for argument in arguments:
                yield from find_symbols(argument)


def content(expression: Expression) -> tuple[object, ...]:
    """Return the key of the canonical order, which is the same on every machine and in every run."""
    match expression:
        case Lagged(channel, lag):
            return (0, channel, lag)
        case Apply(primitive, arguments):
            return (1, primitive.name, len(arguments), *(content(argument) for argument in arguments))
        case Shift(samples, argument):
            return (2, samples, content(argument))
        case Constant(number):
            return (3, number)
        case Symbol(name):
            return (4, name)


def replace(expression: Expression, find: Callable[[Expression], Expression | None]) -> Expression:
    """Return an expression in which parts are replaced.

    Parameters
    ----------
    expression : Expression
    find : callable
        ``find(part)`` returns what replaces a part of the expression; None to look at the parts below it. The
        first call is with the whole expression.
    """
    found = find(expression)
    if found is not None:
        return found
    match expression:
        case Shift(samples, argument):
            return Shift(samples, replace(argument, find))
        case Apply(primitive, arguments):
            return Apply(primitive, tuple(replace(argument, find) for argument in arguments))
    return expression


def replace_leaves(expression: Expression, transform: Callable[[Lagged], Expression]) -> Expression:
    """Return an expression in which every signal is replaced by what ``transform`` returns for it."""
    return replace(expression, lambda part: transform(part) if isinstance(part, Lagged) else None)


def substitute(expression: Expression, replacements: Mapping[str, Expression]) -> Expression:
    """Return an expression with names replaced by expressions."""
    return replace(expression, lambda part: replacements.get(part.name) if isinstance(part, Symbol) else None)
