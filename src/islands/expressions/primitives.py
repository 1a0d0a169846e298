"""Tables of primitives: functions that can be evolved and compiled, and functions of equations.

The paper uses multiplication, subtraction and sign (its phi1 and phi2) and the back-shifts q1 .. q5. Users
define further primitives from scalar functions with `primitive`. Those of equations follow the mathematical
definition: a search needs ``sqrt(-4)`` to be finite, in an equation it is a mistake.
"""

import math
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from islands.expressions.tree import Apply, Constant, Expression, Primitive

#: Arguments of exp are clipped here, so that the bound of a free run detects divergence before an overflow.
LARGEST_EXPONENT = 50.0


def _multiply(a: float, b: float) -> float:
    return a * b


def _subtract(a: float, b: float) -> float:
    return a - b


def _add(a: float, b: float) -> float:
    return a + b


def _sign(a: float) -> float:
    return 1.0 if a > 0.0 else -1.0 if a < 0.0 else 0.0


def _sign_of_difference(a: float, b: float) -> float:
    return 1.0 if a > b else -1.0 if a < b else 0.0


def _divide(a: float, b: float) -> float:
    # Another value at zero, or a threshold for small divisors, would depend on the units (decision 0015).
    return 0.0 if b == 0.0 else a / b


def _absolute(a: float) -> float:
    return abs(a)


def _square(a: float) -> float:
    return a * a


def _cube(a: float) -> float:
    return a * a * a


def _root(a: float) -> float:
    return math.sqrt(abs(a))


def _exponential(a: float) -> float:
    return math.exp(min(a, LARGEST_EXPONENT))


def _logarithm(a: float) -> float:
    return 0.0 if a == 0.0 else math.log(abs(a))


def _sine(a: float) -> float:
    return math.sin(a)


def _cosine(a: float) -> float:
    return math.cos(a)


def _hyperbolic_tangent(a: float) -> float:
    return math.tanh(a)


def _larger(a: float, b: float) -> float:
    return a if a > b else b


def _smaller(a: float, b: float) -> float:
    return a if a < b else b


# C and MATLAB need no function for operators, nor for primitives that the canonical form replaces by
# operators (phi1, square) or by other primitives (phi2).
MUL = Primitive("mul", 2, _multiply, r"{0} {1}", commutative=True, summary="`a*b`")
ADD = Primitive("add", 2, _add, r"{0} + {1}", commutative=True, summary="`a + b`")
SUB = Primitive("sub", 2, _subtract, r"{0} - {1}", summary="`a - b`")


def _simplify_sign(a: Expression) -> Expression | None:
    return a if isinstance(a, Apply) and a.primitive == SIGN else None


SIGN = Primitive(
    "sign",
    1,
    _sign,
    r"\operatorname{{sign}}({0})",
    c="return (double)(a > 0.0) - (double)(a < 0.0);",
    matlab="r = (a > 0) - (a < 0);",
    parity=-1,
    degree=0.0,
    simplify=_simplify_sign,
    summary="-1, 0 or 1; `sign(0)` is 0, so `sign(x)^2` is not simplified to 1",
)


def _replace_phi1(a: Expression, b: Expression) -> Expression:
    return Apply(SUB, (a, b))


def _replace_phi2(a: Expression, b: Expression) -> Expression:
    return Apply(SIGN, (Apply(SUB, (a, b)),))


def _replace_square(a: Expression) -> Expression:
    return Apply(MUL, (a, a))


def _replace_cube(a: Expression) -> Expression:
    return Apply(MUL, (a, a, a))


def _simplify_quotient(a: Expression, b: Expression) -> Expression | None:
    (over, above), (under, below) = _split_factor(a), _split_factor(b)
    if 0.0 in (over, under):
        return Constant(0.0)
    factor = Constant(over / under)
    if below == Constant(1.0):
        return Apply(MUL, (factor, above))
    if above == below:
        return Apply(MUL, (factor, Apply(SIGN, (above,)), Apply(SIGN, (above,))))
    divide = PRIMITIVES["div"]
    match above, below:
        case _, Apply(inner, (upper, lower)) if inner == divide:
            above, below = Apply(MUL, (above, lower)), upper
        case Apply(inner, (upper, lower)), _ if inner == divide:
            above, below = upper, Apply(MUL, (lower, below))
        case _ if over == under == 1.0:
            return None
    return Apply(MUL, (factor, Apply(divide, (above, below))))


def _split_factor(expression: Expression) -> tuple[float, Expression]:
    match expression:
        case Constant(number):
            return number, Constant(1.0)
        case Apply(primitive, (Constant(number), first, *others)) if primitive == MUL:
            return number, Apply(MUL, (first, *others)) if others else first
        case _:
            return 1.0, expression


def _simplify_extremum(a: Expression, b: Expression) -> Expression | None:
    return a if a == b else None


_BUILT_IN = (
    MUL,
    SUB,
    SIGN,
    Primitive(
        "phi1", 2, _subtract, r"\left({0} - {1}\right)", simplify=_replace_phi1, summary="`a - b`, as `sub`"
    ),
    Primitive(
        "phi2",
        2,
        _sign_of_difference,
        r"\operatorname{{sign}}({0} - {1})",
        simplify=_replace_phi2,
        summary="`sign(a - b)`, as `sign` and `sub`",
    ),
    ADD,
    Primitive(
        "div",
        2,
        _divide,
        r"\operatorname{{div}}({0}, {1})",
        c="return b == 0.0 ? 0.0 : a / b;",
        matlab="if b == 0, r = 0; else, r = a / b; end",
        simplify=_simplify_quotient,
        summary="`a/b`; 0 if the divisor is zero, so that `x/x` is `sign(x)^2`",
        protected_text="div({0}, {1})",
    ),
    Primitive(
        "abs", 1, _absolute, r"\left|{0}\right|", "return fabs(a);", "r = abs(a);", 1, 1.0, summary="`|a|`"
    ),
    Primitive("square", 1, _square, r"\left({0}\right)^{{2}}", simplify=_replace_square, summary="`a^2`"),
    Primitive("cube", 1, _cube, r"\left({0}\right)^{{3}}", simplify=_replace_cube, summary="`a^3`"),
    Primitive(
        "sqrt",
        1,
        _root,
        r"\sqrt{{\left|{0}\right|}}",
        c="return sqrt(fabs(a));",
        matlab="r = sqrt(abs(a));",
        parity=1,
        degree=0.5,
        summary="Square root of the absolute value",
        protected_text="sqrt(abs({0}))",
    ),
    Primitive(
        "exp",
        1,
        _exponential,
        rf"\exp(\min({{0}}, {LARGEST_EXPONENT:g}))",
        c=f"return exp(a > {LARGEST_EXPONENT} ? {LARGEST_EXPONENT} : a);",
        matlab=f"r = exp(min(a, {LARGEST_EXPONENT}));",
        summary=f"Exponential; the argument is clipped at {LARGEST_EXPONENT:g}",
        protected_text=f"exp(min({{0}}, {LARGEST_EXPONENT:g}))",
    ),
    Primitive(
        "log",
        1,
        _logarithm,
        r"\ln\left|{0}\right|",
        c="return a == 0.0 ? 0.0 : log(fabs(a));",
        matlab="if a == 0, r = 0; else, r = log(abs(a)); end",
        parity=1,
        summary="Natural logarithm of the absolute value; 0 if that is zero",
        protected_text="log(abs({0}))",
    ),
    Primitive("sin", 1, _sine, r"\sin({0})", "return sin(a);", "r = sin(a);", parity=-1),
    Primitive("cos", 1, _cosine, r"\cos({0})", "return cos(a);", "r = cos(a);", parity=1),
    Primitive("tanh", 1, _hyperbolic_tangent, r"\tanh({0})", "return tanh(a);", "r = tanh(a);", parity=-1),
    Primitive(
        "max",
        2,
        _larger,
        r"\max({0}, {1})",
        c="return a > b ? a : b;",
        matlab="if a > b, r = a; else, r = b; end",
        commutative=True,
        simplify=_simplify_extremum,
    ),
    Primitive(
        "min",
        2,
        _smaller,
        r"\min({0}, {1})",
        c="return a < b ? a : b;",
        matlab="if a < b, r = a; else, r = b; end",
        commutative=True,
        simplify=_simplify_extremum,
    ),
)


class _Primitives(dict[str, Primitive]):
    """Primitives whose representation, in the signatures of functions, is their public name."""

    def __repr__(self) -> str:
        return "islands.PRIMITIVES"


PRIMITIVES: Mapping[str, Primitive] = MappingProxyType(
    _Primitives({entry.name: entry for entry in _BUILT_IN})
)


def _less(a: ArrayLike, b: ArrayLike) -> NDArray[np.float64]:
    return np.less(a, b) * 1.0


def _less_equal(a: ArrayLike, b: ArrayLike) -> NDArray[np.float64]:
    return np.less_equal(a, b) * 1.0


def _minimum(a: ArrayLike, b: ArrayLike) -> NDArray[np.float64]:
    return np.where(np.less(a, b), a, b)


def _maximum(a: ArrayLike, b: ArrayLike) -> NDArray[np.float64]:
    return np.where(np.greater(a, b), a, b)


def _choose(condition: ArrayLike, a: ArrayLike, b: ArrayLike) -> NDArray[np.float64]:
    return np.where(np.greater(condition, 0.0), a, b)


def _equation_function(name: str, arity: int, scalar: Callable[..., Any], summary: str = "") -> Primitive:
    return Primitive(name, arity, scalar, summary=summary, is_protected=False)


DIV = _equation_function("div", 2, np.divide, "`a/b`")
POW = _equation_function("pow", 2, np.power, "`a**b`; NaN if a is negative and b is not an integer")
NEG = _equation_function("neg", 1, np.negative, "`-a`")
LESS = _equation_function("less", 2, _less, "`a < b`: 1 if true, else 0")
LESS_EQUAL = _equation_function("less_equal", 2, _less_equal, "`a <= b`: 1 if true, else 0")

#: Functions of equations by name. The operators are the first ones.
EQUATION_FUNCTIONS: Mapping[str, Primitive] = MappingProxyType(
    {
        entry.name: entry
        for entry in (
            ADD,
            SUB,
            MUL,
            DIV,
            POW,
            NEG,
            LESS,
            LESS_EQUAL,
            _equation_function("abs", 1, np.abs, "absolute value"),
            _equation_function("sqrt", 1, np.sqrt, "square root; NaN if a is negative"),
            _equation_function("exp", 1, np.exp, "exponential"),
            _equation_function("log", 1, np.log, "natural logarithm; NaN if a is negative"),
            _equation_function("sin", 1, np.sin, "sine"),
            _equation_function("cos", 1, np.cos, "cosine"),
            _equation_function("tan", 1, np.tan, "tangent"),
            _equation_function("tanh", 1, np.tanh, "hyperbolic tangent"),
            _equation_function("atan", 1, np.arctan, "arc tangent"),
            _equation_function("sign", 1, np.sign, "-1, 0 or 1"),
            _equation_function("min", 2, _minimum, "the smaller of two or more values"),
            _equation_function("max", 2, _maximum, "the larger of two or more values"),
            _equation_function("where", 3, _choose, "`where(x > y, a, b)`: a if the condition holds, else b"),
        )
    }
)
