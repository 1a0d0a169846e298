"""Options of a simulation, and parsing of their values.

They are apart from the other options because the table of the simulators imports their specifications.
"""

from typing import Annotated

import typer

from islands.errors import SettingsError
from islands.simulators.specification.table import SIMULATORS

Channels = Annotated[
    list[str] | None, typer.Option("--channel", help="Column that may couple in, for example a temperature.")
]
Simulated = Annotated[
    str, typer.Option("--simulation", help=f"{', '.join(SIMULATORS)}; a colon separates its argument.")
]


def single_input(inputs: list[str]) -> str:
    """Return the single input that drives a simulation.

    Raises
    ------
    SettingsError
        The number of inputs is not one.
    """
    if len(inputs) != 1:
        raise SettingsError(
            f"a simulation is driven by one input, got {', '.join(inputs)}: give the others as --channel"
        )
    return inputs[0]
