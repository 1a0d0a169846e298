"""Regressors and their canonical form, which makes equal regressors compare equal.

In canonical form, back-shifts are merged into the leaves, products and sums are flat and in canonical order,
numeric factors are extracted (the factor of a regressor belongs to its parameter), and equal terms of a sum
are merged. ``sign^3`` becomes ``sign``, but ``sign^2`` never becomes 1: it is 0 while the input is constant.
``x*sign(x)^2`` becomes ``x``, which it equals exactly.
"""

import math
from dataclasses import dataclass, field

from islands.errors import ModelError
from islands.expressions.primitives import ADD, MUL, PRIMITIVES, SIGN, SUB
from islands.expressions.printing import plain
from islands.expressions.tree import (
    Apply,
    Constant,
    Expression,
    Lagged,
    Primitive,
    Shift,
    Symbol,
    content,
    lags,
    remove_shifts,
)

_ONE = Constant(1.0)

_ABS = PRIMITIVES["abs"]

#: A sum of weights whose ratio to the sum of their absolute values is not larger counts as zero.
_ROUNDING = 1e-14


@dataclass(frozen=True, slots=True)
class Regressor:
    """An expression in canonical form that reads only past samples. Make it with `regressor`."""

    expression: Expression = field(compare=False)
    #: Canonical text with numbered inputs. It identifies the regressor, and a string caches its hash.
    text: str = field(init=False, repr=False)
    #: Key of the canonical order.
    content: tuple[object, ...] = field(init=False, repr=False, compare=False)
    #: Pairs (channel, lag) that the regressor reads; channel 0 is y.
    lags: frozenset[tuple[int, int]] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "text", plain(self.expression, inputs=2))
        object.__setattr__(self, "content", content(self.expression))
        object.__setattr__(self, "lags", lags(self.expression))

    @property
    def degree(self) -> int:
        """Number of factors of a product; 1 for any other expression."""
        return len(_get_operands(self.expression, MUL))

    @property
    def maximum_lag(self) -> int:
        """Largest lag; 0 for a constant."""
        return max((lag for _, lag in self.lags), default=0)

    @property
    def output_lag(self) -> int:
        """Lag i of a linear output y(k-i); 0 for any other regressor."""
        match self.expression:
            case Lagged(0, lag):
                return lag
        return 0


@dataclass(frozen=True, slots=True)
class CanonicalForms:
    """Canonical forms of some expressions, one function for each name of a primitive.

    Attributes
    ----------
    parts : dict
        Factor and core of expressions.
    regressors : dict
        Regressors by their core.
    """

    parts: dict[Expression, tuple[float, Expression]] = field(default_factory=dict)
    regressors: dict[Expression, Regressor] = field(default_factory=dict)


def regressor(expression: Expression, known: CanonicalForms | None = None) -> tuple[float, Regressor | None]:
    """Bring an expression into canonical form.

    Parameters
    ----------
    expression : Expression
    known : CanonicalForms, optional
        Forms from earlier calls, updated. The genes of a search share most of their parts.

    Returns
    -------
    factor : float
        The expression equals ``factor`` times the regressor.
    regressor : Regressor or None
        None if the expression is identically zero; the factor is then 0.

    Raises
    ------
    ModelError
        A lag is less than 1 (the regressor would read the present or the future), or a number overflows.
    """
    factor, core = canonical(expression, known)
    if not factor:
        return 0.0, None
    found = known.regressors.get(core) if known else None
    if found is None:
        found = Regressor(core)
        for channel, lag in sorted(found.lags):
            if lag < 1:
                raise ModelError(
                    f"a regressor reads only past samples: channel {channel} has lag {lag}, take 1 or more"
                )
        if known:
            known.regressors[core] = found
    return factor, found


def canonical(expression: Expression, known: CanonicalForms | None = None) -> tuple[float, Expression]:
    """Return (factor, core) with ``expression = factor * core``; zero is (0, 1) and a number c is (c, 1).

    Raises
    ------
    ModelError
        The numbers in the expression overflow.
    """
    if known is None or not isinstance(expression, Apply | Shift):
        factor, core = _canonical(expression, known)
        return _check_finite(factor), core
    found = known.parts.get(expression)
    if found is None:
        factor, core = _canonical(expression, known)
        found = known.parts[expression] = _check_finite(factor), core
    return found


def _canonical(expression: Expression, known: CanonicalForms | None) -> tuple[float, Expression]:
    match expression:
        case Lagged() | Symbol():
            return 1.0, expression
        case Constant(number):
            return number, _ONE
        case Shift():
            return canonical(remove_shifts(expression), known)
        case Apply(primitive, arguments):
            parts = [canonical(argument, known) for argument in arguments]
            if primitive == MUL:
                return _product(parts)
            if primitive in (ADD, SUB):
                negate = -1.0 if primitive == SUB else 1.0
                return _sum([parts[0], *((negate * factor, core) for factor, core in parts[1:])])
            return _function(primitive, parts)


def _product(parts: list[tuple[float, Expression]]) -> tuple[float, Expression]:
    factor = 1.0
    cores: list[Expression] = []
    for number, core in parts:
        factor *= number
        cores.extend(_get_operands(core, MUL))
    if factor == 0.0:
        return 0.0, _ONE
    cores = sorted((core for core in _reduce_sign_powers(cores) if core != _ONE), key=content)
    if not cores:
        return factor, _ONE
    return factor, cores[0] if len(cores) == 1 else Apply(MUL, tuple(cores))


def _reduce_sign_powers(cores: list[Expression]) -> list[Expression]:
    """Reduce odd powers of a sign to the first, even powers to the second (which is 0 at rest, not 1).

    An even power in a product with its argument or the absolute value of it is left out: all are 0
    at the same time.
    """
    signs = [core for core in cores if isinstance(core, Apply) and core.primitive == SIGN]
    others = [core for core in cores if core not in signs]
    kept = list(others)
    for sign in dict.fromkeys(signs):
        if signs.count(sign) % 2:
            kept.append(sign)
        elif not {*sign.arguments, Apply(_ABS, sign.arguments)}.intersection(others):
            kept += [sign, sign]
    return kept


def _sum(parts: list[tuple[float, Expression]]) -> tuple[float, Expression]:
    weights: dict[Expression, list[float]] = {}
    for outer, core in parts:
        for inner, term in _get_terms(core):
            weights.setdefault(term, []).append(outer * inner)
    merged = ((core, sum(parts), sum(map(abs, parts))) for core, parts in weights.items())
    # 0.1 + 0.2 - 0.3 is zero except for rounding and must vanish. A weight that has overflowed is kept (its
    # ratio is NaN); the check of the result then refuses it.
    terms = sorted(
        ((core, weight) for core, weight, size in merged if size and not abs(weight) / size <= _ROUNDING),
        key=lambda term: content(term[0]),
    )
    if not terms:
        return 0.0, _ONE
    leading = terms[0][1]
    scaled = [(core, weight / leading) for core, weight in terms if weight / leading]
    if len(scaled) == 1:
        return leading, scaled[0][0]
    (first, _), (second, ratio) = scaled[:2]
    if len(scaled) == 2 and (ratio == -1.0 or (ratio < 0.0 and second == _ONE)):
        return leading, Apply(SUB, (first, _multiply(-ratio, second)))
    return leading, Apply(ADD, tuple(_multiply(ratio, core) for core, ratio in scaled))


def _get_terms(core: Expression) -> list[tuple[float, Expression]]:
    if isinstance(core, Apply) and core.primitive == SUB:
        number, subtracted = canonical(core.arguments[1])
        return [(1.0, core.arguments[0]), (-number, subtracted)]
    if isinstance(core, Apply) and core.primitive == ADD:
        return [canonical(term) for term in core.arguments]
    return [(1.0, core)]


def _function(primitive: Primitive, parts: list[tuple[float, Expression]]) -> tuple[float, Expression]:
    """Canonicalise a call.

    Fold constants, extract signs and scales from odd, even and homogeneous functions, order the arguments
    of commutative functions, and simplify.
    """
    if all(core == _ONE for _, core in parts):
        return _fold_constants(primitive, [factor for factor, _ in parts]), _ONE
    outer = 1.0
    if primitive.parity and parts[0][0] < 0.0:
        outer = float(primitive.parity)
        parts = [(-parts[0][0], parts[0][1])]
    if primitive.degree is not None and parts[0][0] > 0.0:
        outer *= parts[0][0] ** primitive.degree
        parts = [(1.0, parts[0][1])]
    arguments = [_multiply(factor, core) for factor, core in parts]
    if primitive.commutative:
        arguments.sort(key=content)
    simpler = primitive.simplify(*arguments) if primitive.simplify else None
    if simpler is None:
        return outer, Apply(primitive, tuple(arguments))
    factor, core = canonical(simpler)
    return outer * factor, core


def _fold_constants(primitive: Primitive, numbers: list[float]) -> float:
    try:
        return float(primitive.scalar(*numbers))
    except (ArithmeticError, ValueError) as error:
        raise ModelError(
            f"primitive {primitive.name!r} fails at {numbers} ({error}): protect it there"
        ) from error


def _check_finite(number: float) -> float:
    if not math.isfinite(number):
        raise ModelError("the numbers in an expression overflow: take smaller ones")
    return number


def _multiply(factor: float, core: Expression) -> Expression:
    if core == _ONE:
        return Constant(_check_finite(factor))
    return core if factor == 1.0 else Apply(MUL, (Constant(_check_finite(factor)), *_get_operands(core, MUL)))


def _get_operands(core: Expression, primitive: Primitive) -> tuple[Expression, ...]:
    return core.arguments if isinstance(core, Apply) and core.primitive == primitive else (core,)
