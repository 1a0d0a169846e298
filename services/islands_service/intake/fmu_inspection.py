"""Inspection of an uploaded FMU in a confined subprocess: it reads the description and runs no code."""

import zipfile
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from islands.errors import ModelError, SettingsError
from islands_service.intake.confined_answer import ask_confined
from islands_service.intake.confined_process import enter, refuse, send_document

#: Largest numbers of files in an FMU, and of variables of type real, whose descriptions are stored.
_MAX_FILES, _MAX_VARIABLES = 5000, 5000

#: Largest size of a model description: a hundred thousand local variables take some ten megabytes.
_MAX_DESCRIPTION_BYTES = 100_000_000


async def inspect_fmu(path: Path, most_bytes: int, memory: int, seconds: float) -> Mapping[str, Any]:
    """Return the description of an FMU as JSON, see `islands_service.domain.uploaded_fmu.describe_fmu`.

    Parameters
    ----------
    most_bytes : int
        Largest size that the FMU may unpack to.
    memory, seconds
        Limits of the subprocess: bytes of address space, and time.

    Raises
    ------
    ModelError
        The file is not an FMU that this machine can simulate, or is too large.
    SettingsError
        The package that reads FMUs is not installed.
    """
    return await ask_confined("fmu_inspection", path, {"most_bytes": most_bytes}, memory, seconds)


def main() -> None:
    """Inspect the FMU named on standard input, and write its description to standard output."""
    # Only the process that reads FMUs imports their reader, which starts processes when it is imported.
    from islands.simulators.fmu.fmi_description import import_fmpy  # noqa: PLC0415

    with suppress(SettingsError):
        import_fmpy()
    path, asked, answer = enter()
    try:
        document = _describe(path, asked["most_bytes"])
    except (ModelError, SettingsError) as error:
        refuse(type(error)(str(error).replace(f"{Path(path).parent}/", "")), answer)
    send_document(document, answer)


def _describe(path: str, most_bytes: int) -> dict[str, Any]:
    from islands.simulators.fmu.fmi_description import read_description  # noqa: PLC0415
    from islands_service.domain.uploaded_fmu import describe_fmu  # noqa: PLC0415

    with suppress(zipfile.BadZipFile):  # whose reader says what is wrong with it
        _check_sizes(path, most_bytes)
    return describe_fmu(read_description(path, most=_MAX_VARIABLES))


def _check_sizes(path: str, most_bytes: int) -> None:
    from islands.simulators.fmu.fmi_description import DESCRIPTION  # noqa: PLC0415

    with zipfile.ZipFile(path) as archive:
        files = archive.infolist()  # a name can appear twice
    if len(files) > _MAX_FILES or sum(file.file_size for file in files) > most_bytes:
        raise ModelError(
            f"{path} unpacks to more than {most_bytes / 1e6:.0f} MB or {_MAX_FILES} files, the most of this "
            "service: export it without sources and documentation"
        )
    if any(file.filename == DESCRIPTION and file.file_size > _MAX_DESCRIPTION_BYTES for file in files):
        raise ModelError(
            f"the {DESCRIPTION} of {path} has more than {_MAX_DESCRIPTION_BYTES / 1e6:.0f} MB, the most of "
            "this service: export it with fewer variables"
        )
