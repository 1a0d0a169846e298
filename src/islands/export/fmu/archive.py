"""File of an FMU: sources, description, and a library for this machine."""

import hashlib
import io
import platform
import sys
import tempfile
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from types import MappingProxyType

from islands.export.fmu.compiler import compile_library, find_compiler
from islands.export.fmu.description import (
    describe_build,
    describe_fmi2,
    describe_fmi3,
    model_identifier,
)
from islands.export.languages.c import c_block
from islands.models.block import Block

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
    return resources.files(__package__).joinpath(name).read_text(encoding="ascii")


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
