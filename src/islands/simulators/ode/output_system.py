"""Equation of the output of a simulation that has no equations: a system without states."""

from collections.abc import Mapping
from typing import Any

from islands.expressions.parsing import parse_expression
from islands.simulators.ode.system import OdeSystem, check_symbols
from islands.simulators.ode.system_document import make_parameter

#: Names in the equation: the input, and the output of the simulation.
INPUT, SIMULATED = "u", "y_sim"

#: Their meaning, for texts that contain the equation.
SYMBOL_MEANINGS = f"{SIMULATED} is the simulated output, {INPUT} the input"


def make_output_system(
    name: str, equation: str = SIMULATED, parameters: Mapping[str, Any] | None = None
) -> OdeSystem:
    """Make the equation of the output of a simulation.

    Parameters
    ----------
    name : str
        Name of the simulation.
    equation : str
        Output as an expression of that of the simulation ``y_sim``, its input ``u``, the time and parameters.
    parameters : mapping, optional
        Values or documents of the parameters by name.

    Raises
    ------
    ModelError
        The equation or a parameter is invalid.
    """
    system = OdeSystem(
        name=name,
        input=INPUT,
        derivatives=(),
        variables=(),
        output=parse_expression(equation),
        parameters=tuple(make_parameter(*each) for each in (parameters or {}).items()),
        states=(),
        simulated=(SIMULATED,),
    )
    check_symbols(system.output, system, f"output, {equation!r}")
    return system
