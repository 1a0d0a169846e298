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
Tolerances = Annotated[
    list[str] | None,
    typer.Option("--tolerance", help="PARAM=REL: relative standard deviation of a parameter, 0.02 for 2 %."),
]

NoiseLevel = Annotated[
    float | None,
    typer.Option(
        "--noise-level",
        help="Standard deviation of the noise of the output, in its unit; a far larger residual is no noise.",
    ),
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


def tolerances(texts: list[str]) -> dict[str, float]:
    """Read ``--tolerance PARAM=REL``.

    Raises
    ------
    SettingsError
        A text is not a name and a number.
    """
    found = {}
    for text in texts:
        name, _, value = text.partition("=")
        try:
            found[name] = float(value)
        except ValueError:
            raise SettingsError(f"--tolerance {text}: write PARAM=REL, for example dp=0.01") from None
    return found
