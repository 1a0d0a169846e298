"""Partial derivatives of expressions with respect to past outputs, as sums of products of expressions."""

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import NamedTuple

from islands.expressions.primitives import ADD, LARGEST_EXPONENT, MUL, PRIMITIVES, SIGN, SUB
from islands.expressions.tree import Apply, Constant, Expression, Lagged

_Factors = tuple[Expression, ...]

#: Products whose sum is the partial derivative of a primitive with respect to one of its arguments.
_Sum = tuple[tuple[float, _Factors], ...]

_DIV, _ABS, _SQRT, _EXP, _LOG, _SIN, _COS, _TANH, _MAX, _MIN = (
    PRIMITIVES[name] for name in ("div", "abs", "sqrt", "exp", "log", "sin", "cos", "tanh", "max", "min")
)


_LIMIT = Constant(LARGEST_EXPONENT)


class OutputDerivative(NamedTuple):
    """A product in a partial derivative: ``weight`` times the product of the ``factors``.

    Attributes
    ----------
    lag : int
        Lag of the output with respect to which the expression is differentiated.
    weight : float
    factors : tuple of Expression
        Empty for a constant derivative.
    """

    lag: int
    weight: float
    factors: _Factors


def _invert(a: Expression) -> Expression:
    return Apply(_DIV, (Constant(1.0), a))


def _choose(larger: Expression, smaller: Expression) -> _Sum:
    """Return 1 where the first expression is larger and 0 where it is smaller; 1/2 where both are equal."""
    return (0.5, ()), (0.5, (Apply(SIGN, (Apply(SUB, (larger, smaller)),)),))


def _differentiate_exp(a: Expression) -> tuple[_Sum]:
    return (tuple((weight, (*rest, Apply(_EXP, (a,)))) for weight, rest in _choose(_LIMIT, a)),)


#: Partial derivatives of the primitives of the canonical form by argument. At a kink or a step they are the
#: mean of both sides, or 0: a sample there has no derivative, and the others are not affected.
_PARTIALS: Mapping[str, Callable[..., tuple[_Sum, ...]]] = MappingProxyType(
    {
        "div": lambda a, b: (
            ((1.0, (_invert(b),)),),
            ((-1.0, (Apply(_DIV, (a, b)), _invert(b))),),
        ),
        "sign": lambda _: ((),),
        "abs": lambda a: (((1.0, (Apply(SIGN, (a,)),)),),),
        "sqrt": lambda a: (((0.5, (Apply(_DIV, (Apply(SIGN, (a,)), Apply(_SQRT, (a,)))),)),),),
        "exp": _differentiate_exp,
        "log": lambda a: (((1.0, (_invert(a),)),),),
        "sin": lambda a: (((1.0, (Apply(_COS, (a,)),)),),),
        "cos": lambda a: (((-1.0, (Apply(_SIN, (a,)),)),),),
        "tanh": lambda a: (((1.0, ()), (-1.0, (Apply(_TANH, (a,)), Apply(_TANH, (a,))))),),
        "max": lambda a, b: (_choose(a, b), _choose(b, a)),
        "min": lambda a, b: (_choose(b, a), _choose(a, b)),
    }
)


def differentiate_by_outputs(expression: Expression) -> tuple[OutputDerivative, ...] | None:
    """Return the partial derivatives of a canonical expression with respect to all past outputs.

    Returns
    -------
    tuple of OutputDerivative or None
        Derivatives in the order of the lags; the derivative for one lag is the sum of its products. None if
        the expression contains a primitive whose derivative is not known, such as one of the user.
    """
    found = _differentiate(expression)
    if found is None:
        return None
    merged: dict[tuple[int, _Factors], float] = {}
    for lag, weight, factors in found:
        merged[lag, factors] = merged.get((lag, factors), 0.0) + weight
    products = (OutputDerivative(lag, weight, factors) for (lag, factors), weight in merged.items() if weight)
    return tuple(sorted(products, key=lambda each: each.lag))


def _differentiate(expression: Expression) -> list[OutputDerivative] | None:
    match expression:
        case Lagged(0, lag):
            return [OutputDerivative(lag, 1.0, ())]
        case Apply(_, arguments):
            inner = [_differentiate(argument) for argument in arguments]
            products = []
            for place, derivatives in enumerate(inner):
                if derivatives is None:
                    return None
                # Arguments without outputs contribute nothing, whatever the primitive is.
                outer = _differentiate_primitive(expression, place) if derivatives else ()
                if outer is None:
                    return None
                products += [
                    OutputDerivative(lag, weight * number, (*factors, *rest))
                    for weight, factors in outer
                    for lag, number, rest in derivatives
                ]
            return products
    return []


def _differentiate_primitive(called: Apply, place: int) -> _Sum | None:
    """Return the derivative of a primitive with respect to one of its arguments."""
    primitive, arguments = called.primitive, called.arguments
    if primitive == MUL:
        return ((1.0, (*arguments[:place], *arguments[place + 1 :])),)
    if primitive == ADD:
        return ((1.0, ()),)
    if primitive == SUB:
        return ((1.0 if place == 0 else -1.0, ()),)
    partials = _PARTIALS.get(primitive.name)
    return None if partials is None else partials(*arguments)[place]
