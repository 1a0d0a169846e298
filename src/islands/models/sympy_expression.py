"""A model as an equation of SymPy (extra ``sympy``)."""

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from islands.distribution import describe_missing_extra
from islands.errors import ModelError
from islands.expressions.primitives import LARGEST_EXPONENT
from islands.expressions.tree import Apply, Constant, Expression, Lagged, Primitive, Shift
from islands.models.equations import expressions_of_record, signal_names
from islands.models.narx import require_narx
from islands.models.protocol import DynamicModel

if TYPE_CHECKING:
    import sympy

#: Primitives in SymPy, with their values where the plain function has none (decision 0015).
_FUNCTIONS: Mapping[str, Callable[..., Any]] = MappingProxyType(
    {
        "mul": lambda _sp, a, b: a * b,
        "add": lambda _sp, a, b: a + b,
        "sub": lambda _sp, a, b: a - b,
        "div": lambda sp, a, b: a / b if b.is_nonzero else sp.Piecewise((0, sp.Eq(b, 0)), (a / b, True)),
        "sign": lambda sp, a: sp.sign(a),
        "abs": lambda sp, a: sp.Abs(a),
        "sqrt": lambda sp, a: sp.sqrt(sp.Abs(a)),
        "exp": lambda sp, a: sp.exp(sp.Min(a, LARGEST_EXPONENT)),
        "log": lambda sp, a: sp.Piecewise((0, sp.Eq(a, 0)), (sp.log(sp.Abs(a)), True)),
        "sin": lambda sp, a: sp.sin(a),
        "cos": lambda sp, a: sp.cos(a),
        "tanh": lambda sp, a: sp.tanh(a),
        "max": lambda sp, a, b: sp.Max(a, b),
        "min": lambda sp, a, b: sp.Min(a, b),
    }
)


def to_sympy(model: DynamicModel) -> "sympy.Eq":
    """Return a model as a SymPy equation.

    Parameters
    ----------
    model : DynamicModel
        Model with parameters.

    Returns
    -------
    sympy.Eq
        ``y(k) = ...``: signals are functions of the integer symbol ``k`` with the names of the columns, and
        parameters are exact floats. ``sympy.lambdify([y(k - 1), u(k - 1)], equation.rhs)`` evaluates it. A
        primitive of your own is an undefined function with its name.

    Raises
    ------
    ModelError
        SymPy is not installed, or the model has no parameters.
    """
    narx = require_narx(model)
    try:
        import sympy as sp  # noqa: PLC0415 - an extra
    except ImportError as error:
        raise ModelError(describe_missing_extra("the equation of SymPy", "sympy")) from error
    k = sp.Symbol("k", integer=True)
    names = (name.strip("[]") for name in signal_names(narx))
    signals = [sp.Function(name, real=True) for name in names]

    def call(primitive: Primitive, *arguments: Any) -> Any:
        convert = _FUNCTIONS.get(primitive.name)
        return convert(sp, *arguments) if convert else sp.Function(primitive.name)(*arguments)

    def convert(expression: Expression, shift: int = 0) -> Any:
        match expression:
            case Lagged(channel, lag):
                return signals[channel](k - lag - shift)
            case Constant(number):
                return sp.Float(number)
            case Shift(samples, argument):
                return convert(argument, shift + samples)
            case Apply(primitive, (first, *others)):
                found = convert(first, shift)
                if not others:
                    return call(primitive, found)
                for other in others:
                    found = call(primitive, found, convert(other, shift))
                return found
        raise ModelError(f"{expression!r} is not an expression")

    terms = (
        sp.Float(parameter) * convert(expression)
        for parameter, expression in zip(narx.parameters, expressions_of_record(narx), strict=True)
    )
    return sp.Eq(signals[0](k), sp.Add(*terms), evaluate=False)
