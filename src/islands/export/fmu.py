"""Export of a model as a co-simulation FMU (Functional Mock-up Unit) of FMI 2.0 or 3.0.

The C files of the folder `fmi` are the interface, around the functions of `islands.models.block`.
"""

import hashlib
import io
import platform
import re
import shutil
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from types import MappingProxyType
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from islands.errors import ModelError
from islands.export.languages.c import c_block
from islands.models.block import Block
from islands.records.channel_names import parse_unit

#: Attributes of an FMU of either version.
_CAPABILITIES = {
    "canHandleVariableCommunicationStepSize": "false",
    "canBeInstantiatedOnlyOncePerProcess": "false",
}

#: The first flag keeps the roundings of the kernels.
_FLAGS = ("-ffp-contract=off", "-O2", "-std=c99", "-fvisibility=hidden")

#: Date of all files of an FMU, so that equal models give equal files; the first that ZIP can write.
_DATE = (1980, 1, 1, 0, 0, 0)

_MODEL = """\
/*
{heading}
 */

{block}
/* Identity of the FMU, also in modelDescription.xml. */
static const char TOKEN[] = "{token}";
"""


def find_compiler() -> str | None:
    """Return the path of the C compiler, or None."""
    return shutil.which("cc")


def compile_library(source: Path, library: Path, flags: Sequence[str]) -> None:
    """Compile a C file to a shared library.

    Raises
    ------
    ModelError
        If there is no compiler, or if it rejects the source or a flag; the message is the compiler's.
    """
    command = find_compiler()
    if command is None:
        raise ModelError("there is no C compiler named cc: install one")
    done = subprocess.run(
        [command, *flags, "-shared", "-fPIC", "-o", str(library), str(source), "-lm"],
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode != 0:
        raise ModelError(f"{command} {' '.join(flags)} does not compile {source.name}: {done.stderr.strip()}")


@dataclass(frozen=True, slots=True)
class FmuVariable:
    """A variable of the model description, in the order of the value references.

    Attributes
    ----------
    name, causality, variability, description, unit : str
    initial : str
        Empty for inputs and for the time.
    start : float or None
        Start value; None for a variable without one.
    """

    name: str
    causality: str
    variability: str
    description: str
    unit: str = ""
    initial: str = ""
    start: float | None = None

    @property
    def start_text(self) -> str:
        """Start value as text; empty without one."""
        return "" if self.start is None else repr(self.start)


def fmu_variables(block: Block) -> tuple[FmuVariable, ...]:
    """Return the variables: time, outputs, inputs, and one start value for each past sample of the state."""
    found = [FmuVariable("time", "independent", "continuous", "Time in seconds", "s")]
    late = ", one sampling time late" if any(block.feedthrough) else ""
    for channel, (column, signal) in enumerate(zip(block.columns, block.signals, strict=True)):
        is_input = channel >= block.computed
        causality, variability = ("input", "continuous") if is_input else ("output", "discrete")
        found.append(
            FmuVariable(
                column,
                causality,
                variability,
                f"{signal}(k)" if is_input else f"{signal}(k){late}",
                parse_unit(column),
                "" if is_input else "calculated",
                0.0 if is_input else None,
            )
        )
    for (channel, lag), start in zip(block.samples, block.start_values(), strict=True):
        column = block.columns[channel]
        text = f"{block.signals[channel]}(k-{lag}) at the first sample"
        found.append(
            FmuVariable(
                f"start.{column}[{lag}]", "parameter", "fixed", text, parse_unit(column), "exact", start
            )
        )
    return tuple(found)


def model_identifier(block: Block) -> str:
    """Return the name of the library of an FMU, a C identifier: ``narx_y_um``."""
    return f"narx_{re.sub('[^A-Za-z0-9]+', '_', block.title).strip('_')}"[:60].rstrip("_")


def describe_fmi3(block: Block, token: str) -> str:
    """Return ``modelDescription.xml`` of FMI 3.0."""
    root = _make_root(block, "3.0", {"instantiationToken": token})
    SubElement(
        root,
        "CoSimulation",
        {
            "modelIdentifier": model_identifier(block),
            "canGetAndSetFMUState": "true",
            "canSerializeFMUState": "true",
            "fixedInternalStepSize": repr(block.dt),
            **_CAPABILITIES,
        },
    )
    _add_units(root, block)
    SubElement(root, "DefaultExperiment", startTime="0.0", stepSize=repr(block.dt))
    listed = SubElement(root, "ModelVariables")
    for reference, each in enumerate(fmu_variables(block)):
        SubElement(
            listed,
            "Float64",
            _describe(each, reference)
            | _optional(unit=each.unit, initial=each.initial, start=each.start_text),
        )
    structure = SubElement(root, "ModelStructure")
    # Value references of the outputs: those behind the time. No output depends on present inputs.
    references = [str(place) for place in range(1, 1 + block.computed)]
    for output in references:
        SubElement(structure, "Output", valueReference=output, dependencies="")
    for output in references:
        SubElement(structure, "InitialUnknown", valueReference=output)
    return _to_text(root)


def describe_fmi2(block: Block, token: str) -> str:
    """Return ``modelDescription.xml`` of FMI 2.0."""
    root = _make_root(block, "2.0", {"guid": token})
    simulation = SubElement(
        root,
        "CoSimulation",
        {
            "modelIdentifier": model_identifier(block),
            "canGetAndSetFMUstate": "true",
            "canSerializeFMUstate": "true",
            **_CAPABILITIES,
        },
    )
    SubElement(SubElement(simulation, "SourceFiles"), "File", name="fmi2.c")
    _add_units(root, block)
    SubElement(root, "DefaultExperiment", startTime="0.0", stepSize=repr(block.dt))
    listed = SubElement(root, "ModelVariables")
    for reference, each in enumerate(fmu_variables(block)):
        variable = SubElement(
            listed,
            "ScalarVariable",
            _describe(each, reference) | _optional(initial=each.initial),
        )
        SubElement(variable, "Real", _optional(unit=each.unit, start=each.start_text))
    structure = SubElement(root, "ModelStructure")
    outputs, unknowns = SubElement(structure, "Outputs"), SubElement(structure, "InitialUnknowns")
    # FMI 2.0 counts variables from 1: the time is the first one.
    for index in range(2, 2 + block.computed):
        SubElement(outputs, "Unknown", index=str(index), dependencies="")
        SubElement(unknowns, "Unknown", index=str(index))
    return _to_text(root)


def describe_build(block: Block) -> str:
    """Return ``sources/buildDescription.xml`` of FMI 3.0."""
    root = Element("fmiBuildDescription", fmiVersion="3.0")
    build = SubElement(root, "BuildConfiguration", modelIdentifier=model_identifier(block))
    files = SubElement(build, "SourceFileSet", language="C99")
    SubElement(files, "SourceFile", name="fmi3.c")
    return _to_text(root)


def _make_root(block: Block, version: str, identity: dict[str, str]) -> Element:
    return Element(
        "fmiModelDescription",
        {
            "fmiVersion": version,
            "modelName": f"NARX model of {block.title}",
            **identity,
            "description": "; ".join(filter(None, [*block.texts, block.values])),
            "generationTool": "islands",
            "variableNamingConvention": "flat",
        },
    )


def _add_units(root: Element, block: Block) -> None:
    names = {each.unit for each in fmu_variables(block)} - {""}
    listed = SubElement(root, "UnitDefinitions")
    for name in sorted(names):
        SubElement(listed, "Unit", name=name)


def _describe(variable: FmuVariable, reference: int) -> dict[str, str]:
    """Return the attributes of a variable that both standards have."""
    return {
        "name": variable.name,
        "valueReference": str(reference),
        "causality": variable.causality,
        "variability": variable.variability,
        "description": variable.description,
    }


def _optional(**attributes: str) -> dict[str, str]:
    return {name: value for name, value in attributes.items() if value}


def _to_text(root: Element) -> str:
    ElementTree.indent(root)
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{ElementTree.tostring(root, "unicode")}\n'


@dataclass(frozen=True, slots=True)
class FmiVersion:
    """What differs between the versions of FMI.

    Attributes
    ----------
    source : str
        File of the interface.
    describe : callable
        Returns the model description of a block with a token.
    platforms : mapping
        Folder of the libraries of a system, by (system, processor).
    """

    source: str
    describe: Callable[[Block, str], str]
    platforms: Mapping[tuple[str, str], str]


#: Versions of FMI by the name of the export format.
FMI_VERSIONS: Mapping[str, FmiVersion] = MappingProxyType(
    {
        "fmu": FmiVersion(
            "fmi3.c",
            describe_fmi3,
            {
                ("linux", "x86_64"): "x86_64-linux",
                ("linux", "aarch64"): "aarch64-linux",
                ("darwin", "x86_64"): "x86_64-darwin",
                ("darwin", "arm64"): "aarch64-darwin",
            },
        ),
        "fmu2": FmiVersion(
            "fmi2.c",
            describe_fmi2,
            {
                ("linux", "x86_64"): "linux64",
                ("darwin", "x86_64"): "darwin64",
                ("darwin", "arm64"): "darwin64",
            },
        ),
    }
)


def fmu3(block: Block) -> bytes:
    """Return a model as an FMU of FMI 3.0; see `make_fmu`."""
    return make_fmu(block, FMI_VERSIONS["fmu"])


def fmu2(block: Block) -> bytes:
    """Return a model as an FMU of FMI 2.0; see `make_fmu`."""
    return make_fmu(block, FMI_VERSIONS["fmu2"])


def make_fmu(block: Block, version: FmiVersion) -> bytes:
    """Return a model of one or several outputs as an FMU for co-simulation, with its sources.

    A library for this machine is included if there is a C compiler. The communication step is a multiple of
    the sampling time of the model. Start values are the samples before the first one.

    Raises
    ------
    ModelError
        The model has no finite parameters or no sampling time, a user-defined primitive has no C body, a
        column cannot name a variable, or the compiler fails.
    """
    block.check_names()
    program = c_block(block)
    token = hashlib.sha256(f"{version.source}{block.columns}{program}".encode()).hexdigest()
    sources = {name: _read(name) for name in ("instance.h", version.source)}
    sources["model.h"] = _MODEL.format(heading=block.heading(" *"), block=program, token=token)
    files = {"modelDescription.xml": version.describe(block, token).encode()}
    files |= {f"sources/{name}": text.encode() for name, text in sources.items()}
    if version.source == "fmi3.c":
        files["sources/buildDescription.xml"] = describe_build(block).encode()
    folder = version.platforms.get((sys.platform, platform.machine()))
    if folder and find_compiler():
        suffix = "dylib" if sys.platform == "darwin" else "so"
        files[f"binaries/{folder}/{model_identifier(block)}.{suffix}"] = _compile(sources, version.source)
    return _pack(files)


def _read(name: str) -> str:
    return resources.files(__package__).joinpath("fmi", name).read_text(encoding="ascii")


def _compile(sources: Mapping[str, str], main: str) -> bytes:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for file, text in sources.items():
            (folder / file).write_text(text, encoding="ascii")
        compile_library(folder / main, folder / "library", _FLAGS)
        return (folder / "library").read_bytes()


def _pack(files: Mapping[str, bytes]) -> bytes:
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files.items():
            entry = zipfile.ZipInfo(name, _DATE)
            entry.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(entry, content)
    return packed.getvalue()
