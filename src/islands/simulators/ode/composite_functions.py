"""Functions that are sequences of instructions, with the same bits on every processor.

The functions of a C library compute one lane at a time, and their last bits depend on its version.
"""

from collections.abc import Callable, Sequence
from math import factorial

from islands.kernels.interpreter import ADD, MULTIPLY, SUBTRACT
from islands.simulators.ode import kernel as ode_kernel

#: Sixth convergent of Lambert's continued fraction of tanh: coefficients of its numerator and denominator, in
#: powers of the square of the argument.
_NUMERATOR = (1.0, 4.0 / 33.0, 1.0 / 495.0)
_DENOMINATOR = (1.0, 5.0 / 11.0, 2.0 / 99.0, 1.0 / 10395.0)

#: Argument above which the hyperbolic tangent is 1 in double precision.
_SATURATION = 20.0

#: Number of times that an argument is halved; the error of the convergent is then below the rounding.
_HALVINGS = 6

#: Taylor series of sin(x)/x in powers of the square of x, which is at most pi/2.
_SINE = tuple((-1.0) ** k / factorial(2 * k + 1) for k in range(12))

#: Inverse of pi, and pi as a sum of three numbers. Products of the first two with an integer of 20 bits are
#: exact (Cody and Waite, Software Manual for the Elementary Functions, 1980).
_INVERSE_PI = 0.3183098861837907
_PI = (3.1415926534682512, 1.2154201012607932e-10, 4.04453249759190126e-21)

#: Number to which another one is added and from which it is subtracted to round it to an integer.
_ROUNDING = 1.5 * 2.0**52

#: Makes the node of an operation on nodes.
Operate = Callable[..., int]


class CompositeFunctions:
    """Generator of functions of nodes.

    Parameters
    ----------
    operate : callable
    make_number : callable
        Makes the node of a number.
    """

    def __init__(self, operate: Operate, make_number: Callable[[float], int]) -> None:
        self._operate, self._number = operate, make_number

    def power(self, base: int, power: int) -> int:
        """Generate a power with an exponent of at least 1 as multiplications."""
        if power == 1:
            return base
        half = self.power(base, power // 2)
        square = self._operate(MULTIPLY, half, half)
        return self._operate(MULTIPLY, square, base) if power % 2 else square

    def tanh(self, argument: int) -> int:
        """Generate a hyperbolic tangent; its relative error is at most 1.2e-15, and a NaN remains.

        Numerator p and denominator q of ``tanh x`` give ``tanh 2x = 2pq/(p**2 + q**2)``.
        """
        operate = self._operate
        x = operate(MULTIPLY, self._clip(argument, _SATURATION), self._number(0.5**_HALVINGS))
        square = operate(MULTIPLY, x, x)
        p = operate(MULTIPLY, x, self._evaluate(_NUMERATOR, square))
        q = self._evaluate(_DENOMINATOR, square)
        for _ in range(_HALVINGS):
            squares = operate(ADD, operate(MULTIPLY, p, p), operate(MULTIPLY, q, q))
            p, q = operate(MULTIPLY, operate(ADD, p, p), q), squares
        return self._clip(operate(ode_kernel.DIVIDE, p, q), 1.0)

    def sine(self, argument: int) -> int:
        """Generate a sine; its error is at most 5e-16 up to an argument of 1e6, and a NaN remains."""
        return self._generate_wave(argument, 0.0)

    def cosine(self, argument: int) -> int:
        """Generate a cosine; see `sine`."""
        return self._generate_wave(argument, 0.5)

    def _generate_wave(self, argument: int, shift: float) -> int:
        """Generate ``sin(x + pi*shift)`` of the argument x.

        With an integer n, it is ``(-1)**n * sin(r)``, and ``r = x + pi*(shift - n)`` is at most pi/2.
        """
        operate, number = self._operate, self._number
        half_turns = operate(MULTIPLY, argument, number(_INVERSE_PI))
        if shift:
            half_turns = operate(ADD, half_turns, number(shift))
        n = self._round(half_turns)
        turned = operate(SUBTRACT, n, number(shift)) if shift else n
        r = argument
        for part in _PI:
            r = operate(SUBTRACT, r, operate(MULTIPLY, turned, number(part)))
        sine = operate(MULTIPLY, r, self._evaluate(_SINE, operate(MULTIPLY, r, r)))
        even = self._round(operate(MULTIPLY, n, number(0.5)))
        odd = operate(SUBTRACT, n, operate(ADD, even, even))  # -1, 0 or 1
        sign = operate(SUBTRACT, number(1.0), operate(MULTIPLY, operate(ADD, odd, odd), odd))
        return self._clip(operate(MULTIPLY, sine, sign), 1.0)

    def _round(self, node: int) -> int:
        shifted = self._operate(ADD, node, self._number(_ROUNDING))
        return self._operate(SUBTRACT, shifted, self._number(_ROUNDING))

    def _clip(self, node: int, limit: float) -> int:
        # A comparison with NaN gives the second operand.
        below = self._operate(ode_kernel.MINIMUM, self._number(limit), node)
        return self._operate(ode_kernel.MAXIMUM, self._number(-limit), below)

    def _evaluate(self, coefficients: Sequence[float], variable: int) -> int:
        *lower, value = map(self._number, coefficients)
        for coefficient in reversed(lower):
            value = self._operate(ADD, coefficient, self._operate(MULTIPLY, value, variable))
        return value
