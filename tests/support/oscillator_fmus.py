"""Reference FMUs of an oscillator, which the tests compile."""

import re
import zipfile
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import fmpy
from fmpy.fmi2 import FMU2Model, FMU2Slave
from fmpy.fmi3 import FMU3Model, FMU3Slave

from islands.export.fmu import compile_library

SOURCE = Path(__file__).with_name("oscillator_fmu.c")

#: Types of the functions of FMI, in the package of fmpy.
HEADERS = Path(fmpy.__file__).parent / "c-code"

#: Nominal parameters of the FMU, with their units.
NOMINAL = {"m": (0.5, "kg"), "c": (4.0, "N.s/m"), "k": (200.0, "N/m")}

#: Further parameters, of the events.
EVENTS = {"stop": (1e9, "m"), "on": (1e9, "s")}

#: Value references of the variables, as in the source.
NAMES = ("time", "u", "x", "v", "dx", "dv", "m", "c", "k", "w", "stop", "on")
REFERENCES = {name: place for place, name in enumerate(NAMES)}


@cache
def compile_oscillator(version: int, *macros: str) -> bytes:
    """Return the library for this machine."""
    classes = (FMU2Model, FMU2Slave) if version == 2 else (FMU3Model, FMU3Slave)
    source = SOURCE.read_text()
    defined = {f"fmi{version}{name}" for name in re.findall(r"NAME\((\w+)\)", source)}
    defined |= set(re.findall(rf"fmi{version}[A-Z]\w+(?=\()", source))
    names = {name for each in classes for name in dir(each) if name.startswith(f"fmi{version}")} - defined
    with TemporaryDirectory() as folder:
        path = Path(folder)
        stubs = "".join(f"int {name}() {{ return 3; }}\n" for name in sorted(names))
        (path / "unused.h").write_text(stubs)
        (path / "mass.c").write_text(source)
        flags = [
            f"-DFMI={version}",
            *(f"-D{each}" for each in macros),
            f"-I{HEADERS}",
            f"-I{SOURCE.parent}",
            "-O1",
        ]
        compile_library(path / "mass.c", path / "library", ["-ffp-contract=off", *flags])
        return (path / "library").read_bytes()


def make_attacks(folder: Path) -> tuple[str, ...]:
    """Return macros of an FMU that tries to harm the service whose data is in a folder; see attacks.h."""
    return ("_GNU_SOURCE", f'ATTACK="{folder}"')


def write_oscillator(
    path: Path,
    version: int = 3,
    interfaces: str = "ModelExchange CoSimulation",
    macros: tuple[str, ...] = (),
    fixed_step: float | None = None,
    events: bool = False,
    disturbance: bool = False,
    platform: str | None = None,
    resources: bool = False,
) -> Path:
    """Write an FMU of ``m x'' + c x' + k x = u + w`` with the output x.

    Parameters
    ----------
    interfaces : str
        Names of the elements of the model description.
    macros : tuple of str
        Macros of the source.
    fixed_step : float, optional
        Step of which a communication step is a multiple.
    events : bool
        Whether the parameters of the events are described.
    disturbance : bool
        Whether the second input w is described.
    platform : str, optional
        Folder of the library; by default that of this machine.
    resources : bool
        Whether the FMU has a folder with resources.
    """
    folder = platform or (fmpy.platform if version == 2 else fmpy.platform_tuple)
    text = _describe(version, interfaces.split(), fixed_step, events, disturbance)
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", text)
        library = f"binaries/{folder}/mass{fmpy.sharedLibraryExtension}"
        if resources:
            archive.writestr("resources/table.txt", "1 2 3")
        archive.writestr(library, compile_oscillator(version, *macros))
    return path


def _describe(
    version: int, interfaces: list[str], fixed_step: float | None, events: bool, disturbance: bool
) -> str:
    def row(causality: str, variability: str = "continuous", **more: str) -> dict[str, str]:
        return {"causality": causality, "variability": variability, **more}

    rows = {
        "time": row("independent"),
        "u": row("input", start="0", unit="N"),
        "x": row("output", initial="exact", start="0", unit="m"),
        "v": row("local", initial="exact", start="0", unit="m/s"),
        "dx": row("local", initial="calculated", derivative="x"),
        "dv": row("local", initial="calculated", derivative="v"),
    }
    chosen: Mapping[str, tuple[float, str]] = {**NOMINAL, **(EVENTS if events else {})}
    for name, (value, unit) in chosen.items():
        rows[name] = row("parameter", "tunable", initial="exact", start=str(value), unit=unit)
    if disturbance:
        rows["w"] = row("input", start="0", unit="N")
    step = "" if fixed_step is None else f' fixedInternalStepSize="{fixed_step!r}"'
    identity = 'guid="mass"' if version == 2 else 'instantiationToken="mass"'
    count = ' numberOfEventIndicators="1"' if version == 2 else ""
    elements = {
        "ModelExchange": '<ModelExchange modelIdentifier="mass"/>',
        "CoSimulation": '<CoSimulation modelIdentifier="mass" '
        f'canHandleVariableCommunicationStepSize="{"true" if fixed_step is None else "false"}"{step}/>',
    }
    units = sorted({given["unit"] for given in rows.values() if "unit" in given})
    return "\n".join(
        [
            f'<fmiModelDescription fmiVersion="{version}.0" modelName="mass" {identity}{count}>',
            *(elements[each] for each in interfaces),
            "<UnitDefinitions>",
            *(f'<Unit name="{unit}"/>' for unit in units),
            "</UnitDefinitions>",
            "<ModelVariables>",
            *(_describe_variable(version, name, given, list(rows)) for name, given in rows.items()),
            "</ModelVariables>",
            *_describe_structure(version, list(rows)),
            "</fmiModelDescription>",
        ]
    )


def _describe_variable(version: int, name: str, given: dict[str, str], names: list[str]) -> str:
    common = {"name": name, "valueReference": str(REFERENCES[name])}
    if version == 3:
        if "derivative" in given:
            given = {**given, "derivative": str(REFERENCES[given["derivative"]])}
        return f"<Float64 {_join({**common, **given})}/>"
    real = {key: given[key] for key in ("start", "unit", "derivative") if key in given}
    if "derivative" in real:
        real["derivative"] = str(1 + names.index(real["derivative"]))
    rest = {key: value for key, value in given.items() if key not in real}
    return f"<ScalarVariable {_join({**common, **rest})}><Real {_join(real)}/></ScalarVariable>"


def _describe_structure(version: int, names: list[str]) -> list[str]:
    if version == 3:
        return [
            "<ModelStructure>",
            '<Output valueReference="2"/>',
            '<ContinuousStateDerivative valueReference="4"/>',
            '<ContinuousStateDerivative valueReference="5"/>',
            '<EventIndicator valueReference="2"/>',
            "</ModelStructure>",
        ]
    places = {name: 1 + place for place, name in enumerate(names)}
    return [
        "<ModelStructure>",
        f'<Outputs><Unknown index="{places["x"]}"/></Outputs>',
        f'<Derivatives><Unknown index="{places["dx"]}"/><Unknown index="{places["dv"]}"/></Derivatives>',
        "</ModelStructure>",
    ]


def _join(attributes: Mapping[str, str]) -> str:
    return " ".join(f'{name}="{value}"' for name, value in attributes.items())
