"""Options of records and models that several commands share, and parsing of their values."""

import re
from pathlib import Path
from typing import Annotated

import typer

from islands.errors import SettingsError
from islands.evolution.presets import PRESET_NAMES
from islands.report.figures.names import ALL_FIGURES

Record = Annotated[
    Path, typer.Argument(help="The record: text, XLSX, NPZ, MAT, HDF5, Parquet, MDF or TDMS; also .gz, .zip.")
]
HeldOut = Annotated[
    Path | None,
    typer.Option("--validation", help="Recording that is held out as a whole, not the last quarter."),
]
Validation = Annotated[
    str | None,
    typer.Option(
        "--validation", help="FILE, FRACTION of the end of each record (default 0.25), or START:STOP."
    ),
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


def require_inputs(names: list[str] | None) -> list[str]:
    """Return the names of inputs.

    Raises
    ------
    SettingsError
        There is none.
    """
    if not names:
        raise SettingsError(
            "name the inputs as --input NAME: a model computes the output from its inputs. A record without "
            "an input, as of a free decay or of noise, cannot be modelled; record the force, voltage or set "
            "point that moves the system, too. islands inspect RECORD lists the columns"
        )
    return names


Inputs = Annotated[
    list[str],
    typer.Option(
        "--input",
        help="Input column; repeat it, or separate by commas, for several. Required.",
        default_factory=list,
        show_default=False,
        callback=require_inputs,
    ),
]
InputsOrNone = Annotated[
    list[str] | None,
    typer.Option("--input", help="Input column; by default that of the model or simulation, or chosen."),
]
Output = Annotated[str, typer.Option("--output", help="Output column.")]
OutputOrNone = Annotated[
    str | None, typer.Option("--output", help="Output column; by default that of the simulation, or chosen.")
]
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

Out = Annotated[Path, typer.Option("--out", help="Folder for the result.")]
Force = Annotated[bool, typer.Option("--force", help="Replace a result that is in the folder.")]
Preset = Annotated[str, typer.Option("--preset", help=", ".join(PRESET_NAMES))]
Seed = Annotated[int, typer.Option("--seed", min=0, help="Seed of the random generator.")]

Figures = Annotated[
    str,
    typer.Option(
        "--figures", help=f"Figures to draw, separated by commas: {', '.join(ALL_FIGURES)}; all; none."
    ),
]


def columns(texts: list[str]) -> list[str]:
    """Return the column names of a repeated option whose values may be lists, such as ``--input a,b``.

    A comma before a blank is part of a name (``Voltage, V``), and so is any in a text in double quotes.
    """
    return [name for text in texts for name in _split_names(text) if name]


def _split_names(text: str) -> list[str]:
    is_quoted = len(text) > 1 and text.startswith('"') and text.endswith('"')
    return [text[1:-1]] if is_quoted else re.split(r",(?!\s)", text)
