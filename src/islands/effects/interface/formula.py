"""Formula of an effect for readers, as it is inserted into the equations of a simulation."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from islands.effects.interface.context import Parameter, Signal, SimulationContext


class FormulaQuantity(NamedTuple):
    """A number in a formula.

    Attributes
    ----------
    symbol : str
    value : float
    unit : str
    parameter : str
        Name of the parameter whose value it is; empty if it is computed from one.
    """

    symbol: str
    value: float
    unit: str
    parameter: str = ""


@dataclass(frozen=True, slots=True)
class Formula:
    """Formula of an effect.

    Programs and simulations compute ``equation`` and ``form`` of an effect. They contain smoothed steps and
    values relative to a peak, and the formula contains what these mean: ``F*sign(v)``, ``clip(x, -L, L)``.

    Attributes
    ----------
    text : str
        Signal after a map as an expression of the signal ``x`` before it; force as one of the coordinate
        ``x`` and its rate ``v``. ``t`` is the time, and ``at(x, t - tau)`` the signal at another time.
        Functions may have any name. Empty if the equations of the simulation contain the term, or if the
        effect limits a state.
    symbols : tuple of str
        Names of the values, without those that are initial states; by default the names of the parameters.
    quantities : callable or None
        ``(values, context) -> quantities``: the numbers of the formula if they are not the values.
    states : tuple of (str, str)
        States of the effect with their derivatives.
    conditions : tuple of str
        Limits of the state ``x`` that the effect is named after.
    names : tuple of str
        Further signals and functions in ``text``, which the note explains.
    note : str
        Sentence on the formula without a period, as a format string with the names in braces.
    """

    text: str = ""
    symbols: tuple[str, ...] = ()
    quantities: Callable[[Signal, SimulationContext], Sequence[FormulaQuantity]] | None = None
    states: tuple[tuple[str, str], ...] = ()
    conditions: tuple[str, ...] = ()
    names: tuple[str, ...] = ()
    note: str = ""

    def list_quantities(
        self, parameters: Sequence[Parameter], values: Signal, context: SimulationContext
    ) -> tuple[FormulaQuantity, ...]:
        """Return the numbers of the formula, given the parameters of the effect and their values."""
        if self.quantities is not None:
            return tuple(self.quantities(values, context))
        given = [
            (each, float(value))
            for each, value in zip(parameters, values, strict=False)  # copies of initial states follow
            if not each.initial
        ]
        symbols = self.symbols or tuple(each.name for each, _ in given)
        return tuple(
            FormulaQuantity(symbol, value, each.unit, each.name)
            for symbol, (each, value) in zip(symbols, given, strict=True)
        )


def write_curve_formula(text: str, what: str) -> Formula:
    """Return the formula of a free form, whose function ``f`` is drawn, and is not given by a few numbers."""
    return Formula(
        text,
        quantities=lambda _values, _context: (),
        names=("f",),
        note=f"{{f}} is {what}, whose values are in the figure of the free forms",
    )
