"""Table of primitives: the functions that can be evolved, compiled, written and parsed.

The paper uses multiplication, subtraction and sign (its phi1 and phi2) and the back-shifts q1 .. q5. Users
define further primitives from scalar functions with `primitive` and pass them in a separate table.
"""

import inspect
import keyword
import math
import re
from collections.abc import Callable, Mapping
from types import MappingProxyType

from islands.errors import ModelError
from islands.model.expression import Apply, Constant, Expression, Primitive
from islands.model.primitive_checks import check

#: Names of signals, time and back-shifts in text.
SIGNALS = re.compile(r"y|u\d*|k|q\d+")

#: A divisor or argument of a logarithm with a smaller absolute value counts as zero.
TINY = 1e-9

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
    return 1.0 if abs(b) < TINY else a / b


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
    return 0.0 if abs(a) < TINY else math.log(abs(a))


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
    if a == b:
        return Constant(1.0)
    if isinstance(b, Constant):
        return Constant(1.0) if abs(b.value) < TINY else Apply(MUL, (Constant(1.0 / b.value), a))
    return None


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
        r"\frac{{{0}}}{{{1}}}",
        c=f"return fabs(b) < {TINY} ? 1.0 : a / b;",
        matlab=f"if abs(b) < {TINY}, r = 1; else, r = a / b; end",
        simplify=_simplify_quotient,
        summary=f"`a/b`; 1 if the divisor is smaller than {TINY}, so that `x/x` is 1 everywhere",
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
    ),
    Primitive(
        "exp",
        1,
        _exponential,
        r"\exp({0})",
        c=f"return exp(a > {LARGEST_EXPONENT} ? {LARGEST_EXPONENT} : a);",
        matlab=f"r = exp(min(a, {LARGEST_EXPONENT}));",
        summary=f"Exponential; the argument is clipped at {LARGEST_EXPONENT:g}",
    ),
    Primitive(
        "log",
        1,
        _logarithm,
        r"\ln\left|{0}\right|",
        c=f"return fabs(a) < {TINY} ? 0.0 : log(fabs(a));",
        matlab=f"if abs(a) < {TINY}, r = 0; else, r = log(abs(a)); end",
        parity=1,
        summary=f"Natural logarithm of the absolute value; 0 if that is smaller than {TINY}",
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

PRIMITIVES: Mapping[str, Primitive] = MappingProxyType({entry.name: entry for entry in _BUILT_IN})


def primitive(
    name: str,
    scalar: Callable[..., float],
    latex: str = "",
    parity: int = 0,
    commutative: bool = False,
    c: str = "",
    matlab: str = "",
) -> Primitive:
    """Make a user-defined primitive from a scalar function, and check its declared properties.

    Parameters
    ----------
    name : str
        A Python identifier that differs from the names of built-in primitives and signals.
    scalar : callable
        Maps one or two floats to a float with arithmetic and the functions of ``math``.
    latex : str
        Format string with ``{0}`` and ``{1}``. If empty, it is derived from the name.
    parity : -1, 0 or 1
        Parity as in `Primitive`.
    commutative : bool
        Whether the arguments can be exchanged, as in `Primitive`.
    c, matlab : str
        Function bodies as in `Primitive`. Required only to export models to C or MATLAB.

    Raises
    ------
    ModelError
        The name is taken or invalid, the function does not take one or two arguments, it is not finite at
        zero, a negative or a large argument, it lacks a declared property, or the LaTeX is not a format
        string.
    """
    free = name not in PRIMITIVES and not keyword.iskeyword(name) and not SIGNALS.fullmatch(name)
    if not (free and name.isidentifier()):
        raise ModelError(
            f"{name!r} cannot name a primitive: use an identifier that is not in use and not y, u, k, q1 .."
        )
    arity = _count_arguments(name, scalar)
    if arity not in (1, 2):
        raise ModelError(f"primitive {name!r} takes {arity} arguments: a primitive must take one or two")
    upright = name.replace("_", r"\_")
    entry = Primitive(
        name,
        arity,
        scalar,
        latex or rf"\operatorname{{{{{upright}}}}}(" + ", ".join(f"{{{i}}}" for i in range(arity)) + ")",
        c=c,
        matlab=matlab,
        parity=parity,
        commutative=commutative,
    )
    check(entry)
    return entry


def _count_arguments(name: str, scalar: Callable[..., float]) -> int:
    try:
        return len(inspect.signature(scalar).parameters)
    except ValueError as error:
        raise ModelError(
            f"primitive {name!r} has no signature: wrap it in a function of one or two arguments"
        ) from error
