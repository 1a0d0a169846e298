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
    from islands_service.domain.uploaded_fmu import VARIABLES, describe_fmu  # noqa: PLC0415

    description = read_description(path)
    with zipfile.ZipFile(path) as archive:
        files = archive.infolist()
    if len(files) > _MAX_FILES or sum(each.file_size for each in files) > most_bytes:
        raise ModelError(
            f"{path} unpacks to more than {most_bytes / 1e6:.0f} MB or {_MAX_FILES} files, the most of this "
            "service: export it without sources and documentation"
        )
    count = sum(len(getattr(description, kind)) for kind in VARIABLES)
    if count > _MAX_VARIABLES:
        raise ModelError(
            f"{path} has {count} variables of type real that are inputs, outputs, parameters or states, and "
            f"{_MAX_VARIABLES} is the most of this service: export it with fewer parameters"
        )
    return describe_fmu(description)
