"""Inspection of a stranger's file: read in a process of its own that may take only so much.

A file that makes its reader take all memory, or turn in circles, ends that process and nothing else.
"""

import asyncio
import json
import resource
import sys
from asyncio.subprocess import PIPE
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from islands.errors import RecordError

if TYPE_CHECKING:
    from islands.io.records import Preview

#: What the process sees of the environment: nothing that could be worth stealing.
_ENVIRONMENT = {"PATH": "/usr/bin:/bin", "OPENBLAS_NUM_THREADS": "1", "PYTHONDONTWRITEBYTECODE": "1"}

#: The most columns of a record: what is said of them is kept, and shown in every list.
_COLUMNS = 1000

#: The longest name of a column: a job could not say a longer one (`islands_service.domain.job_spec.Name`).
_NAME = 200

#: Characters of such a name that are shown.
_SHOWN = 40

#: Files that it may have open at once.
_FILES = 64

#: Exit status of a process that has answered with what is wrong with the file.
_REFUSED = 3


@dataclass(frozen=True, slots=True)
class InspectionRequest:
    """What is asked about a file.

    Attributes
    ----------
    inputs, output : tuple of str, str or None
        Columns to read as a job would; without an output the file is only described.
    dt, rows : float, str or None
        As in a job of `islands_service.domain.job_spec`.
    """

    inputs: tuple[str, ...] = ()
    output: str | None = None
    dt: float | None = None
    rows: str | None = None


async def inspect_file(
    path: Path, asked: InspectionRequest, memory: int, seconds: float
) -> Mapping[str, Any]:
    """Describe a file, and read from it what is asked.

    Parameters
    ----------
    memory, seconds
        What the process that reads may take: bytes of address space, and time.

    Returns
    -------
    mapping
        A `islands.io.records.preview.Preview` as a document.

    Raises
    ------
    RecordError
        The file cannot be read, or not as asked.
    """
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, "-m", "islands_service.intake.file_inspection"),
        stdin=PIPE,
        stdout=PIPE,
        stderr=PIPE,
        env=_ENVIRONMENT,
    )
    request = {"path": str(path), "memory": memory, "seconds": seconds, "asked": asdict(asked)}
    try:
        async with asyncio.timeout(seconds):
            answer, complaint = await process.communicate(json.dumps(request).encode())
    except TimeoutError:
        raise RecordError(
            f"{path.name} takes longer than {seconds:.0f} s to read: give a shorter record, or NPZ "
            "instead of text"
        ) from None
    finally:
        if process.returncode is None:
            process.kill()
            await process.wait()
    if process.returncode == _REFUSED:
        raise RecordError(json.loads(answer)["error"])
    if process.returncode != 0:
        reason = (
            complaint.decode(errors="replace").strip().rpartition("\n")[2] or f"exit {process.returncode}"
        )
        raise RecordError(
            f"{path.name} cannot be read within {memory / 1e9:.1f} GB of memory and {seconds:.0f} s "
            f"({reason}): it is damaged, or unpacks to more than this service takes"
        )
    return dict(json.loads(answer))


def main() -> None:
    """Inspect the file that standard input names, and answer on standard output."""
    request = json.load(sys.stdin)
    _limit(request["memory"], request["seconds"])
    # After the limits: whatever these do, they do it within them.
    from islands.io.records import read_record  # noqa: PLC0415
    from islands.io.records.preview import preview  # noqa: PLC0415
    from islands.io.records.row_range import parse_rows  # noqa: PLC0415

    asked = InspectionRequest(**request["asked"])
    try:
        found = preview(request["path"])
        # First: what is said of the columns asked for lists those that there are.
        _refuse_unreadable(found, request["path"])
        if asked.inputs and asked.output is not None:
            read_record(request["path"], asked.inputs, asked.output, asked.dt, parse_rows(asked.rows))
        else:
            _refuse_unusable({column.name: column.problem for column in found.columns}, asked)
    except RecordError as error:
        json.dump({"error": str(error)}, sys.stdout)
        sys.exit(_REFUSED)
    json.dump(asdict(found), sys.stdout)


def _refuse_unreadable(found: "Preview", path: str) -> None:
    """Refuse a file that no job could ever read anything from, or that nobody could look through."""
    if len(found.columns) > _COLUMNS:
        raise RecordError(
            f"{Path(path).name} has {len(found.columns)} columns, and {_COLUMNS} is the most: leave out what "
            "is not needed"
        )
    for column in found.columns:
        if len(column.name) > _NAME:
            raise RecordError(
                f"{Path(path).name} has a column {column.name[:_SHOWN]}... whose name has {len(column.name)} "
                f"characters, and {_NAME} is the most: give it a shorter one"
            )
    if not found.samples:
        problems = [column.problem for column in found.columns if column.problem]
        raise RecordError(problems[0] if problems else f"{Path(path).name} holds no column: export it anew")


def _refuse_unusable(problems: Mapping[str, str], asked: InspectionRequest) -> None:
    """Refuse columns by what a preview says of each: a job that would read them is not known yet."""
    from islands.io.records.column_names import find_column  # noqa: PLC0415

    for name in (*asked.inputs, *([] if asked.output is None else [asked.output])):
        source = find_column(name, problems)
        if source not in problems:
            raise RecordError(f"the record has no column {name}; it has {', '.join(problems)}")
        if problems[source]:
            raise RecordError(problems[source])


def _limit(memory: int, seconds: float) -> None:
    whole = int(seconds) + 1
    for kind, most in (
        (resource.RLIMIT_AS, memory),
        (resource.RLIMIT_CPU, whole),
        (resource.RLIMIT_FSIZE, 0),
        (resource.RLIMIT_NOFILE, _FILES),
        (resource.RLIMIT_CORE, 0),
    ):
        resource.setrlimit(kind, (most, most))


if __name__ == "__main__":
    main()
