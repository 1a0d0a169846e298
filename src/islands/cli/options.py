"""Options that several commands share, and parsing of their values."""

from pathlib import Path
from typing import Annotated

import typer

from islands.errors import SettingsError
from islands.simulators.specification.table import SIMULATORS

Record = Annotated[
    Path, typer.Argument(help="The record: text, XLSX, NPZ, MAT, HDF5, Parquet, MDF or TDMS; also .gz, .zip.")
]
HeldOut = Annotated[
    Path | None,
    typer.Option("--validation", help="Recording that is held out as a whole, not the last quarter."),
]

Records = Annotated[
    list[Path],
    typer.Argument(
        metavar="RECORD...",
        help="Recordings of one system: text, XLSX, NPZ, MAT, HDF5, Parquet, MDF or TDMS; also .gz, .zip.",
    ),
]
RecordsOrNone = Annotated[
    list[Path] | None,
    typer.Argument(metavar="RECORD...", help="Recordings of one system, as for fit; not with --resume."),
]
Inputs = Annotated[
    list[str], typer.Option("--input", help="Input column; repeat it, or separate by commas, for several.")
]
Output = Annotated[str, typer.Option("--output", help="Output column.")]
Outputs = Annotated[
    list[str],
    typer.Option("--output", help="Output column; several, as inputs, for a model that couples them."),
]
SamplingTime = Annotated[
    float | None, typer.Option("--dt", help="Sampling time in seconds, if the record has no time column.")
]
Rows = Annotated[
    str | None, typer.Option("--rows", help="START:STOP, the samples of the record to use; all by default.")
]

ModelFile = Annotated[
    str,
    typer.Argument(
        help="A model file, a result folder, an extended.json, ode:FILE.toml, fmu:FILE.fmu, or published:12, "
        ":13, :14."
    ),
]
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


def columns(texts: list[str]) -> list[str]:
    """Return the column names of a repeated option whose values may be lists, such as ``--input a,b``."""
    return [name for text in texts for name in text.split(",") if name]


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
