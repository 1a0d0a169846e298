"""Functions that are sequences of instructions, with the same bits on every processor."""

from collections.abc import Callable

from islands.kernels.interpreter import ADD, MULTIPLY
from islands.systems.ode import ode_kernel

#: Sixth convergent of Lambert's continued fraction of tanh: coefficients of its numerator and denominator, in
#: powers of the square of the argument.
_NUMERATOR = (1.0, 4.0 / 33.0, 1.0 / 495.0)
_DENOMINATOR = (1.0, 5.0 / 11.0, 2.0 / 99.0, 1.0 / 10395.0)

#: Argument above which the hyperbolic tangent is 1 in double precision.
_SATURATION = 20.0

#: Number of times that an argument is halved; the error of the convergent is then below the rounding.
_HALVINGS = 6

#: Makes the node of an operation on nodes.
Operate = Callable[..., int]


def generate_power(base: int, power: int, operate: Operate) -> int:
    """Generate a power with an exponent of at least 1 as multiplications."""
    if power == 1:
        return base
    half = generate_power(base, power // 2, operate)
    square = operate(MULTIPLY, half, half)
    return operate(MULTIPLY, square, base) if power % 2 else square


def generate_tanh(argument: int, operate: Operate, make_number: Callable[[float], int]) -> int:
    """Generate a hyperbolic tangent; its relative error is at most 1.2e-15, and a NaN remains.

    The function of a C library computes one lane at a time, and its last bits depend on its version. Here,
    numerator p and denominator q of ``tanh x`` give ``tanh 2x = 2pq/(p**2 + q**2)``.
    """

    def clip(node: int, limit: float) -> int:
        # A comparison with NaN gives the second operand.
        below = operate(ode_kernel.MINIMUM, make_number(limit), node)
        return operate(ode_kernel.MAXIMUM, make_number(-limit), below)

    def evaluate(coefficients: tuple[float, ...], variable: int) -> int:
        *lower, value = map(make_number, coefficients)
        for coefficient in reversed(lower):
            value = operate(ADD, coefficient, operate(MULTIPLY, value, variable))
        return value

    x = operate(MULTIPLY, clip(argument, _SATURATION), make_number(0.5**_HALVINGS))
    square = operate(MULTIPLY, x, x)
    p, q = operate(MULTIPLY, x, evaluate(_NUMERATOR, square)), evaluate(_DENOMINATOR, square)
    for _ in range(_HALVINGS):
        squares = operate(ADD, operate(MULTIPLY, p, p), operate(MULTIPLY, q, q))
        p, q = operate(MULTIPLY, operate(ADD, p, p), q), squares
    return clip(operate(ode_kernel.DIVIDE, p, q), 1.0)
