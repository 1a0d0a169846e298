"""Processes that read an untrusted file with limited resources: how they are started, and how they answer."""

import json
import os
import resource
import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, NoReturn

from islands.errors import IslandsError, ModelError, RecordError, SettingsError
from islands_service.intake.confinement import confine

#: Environment of a process, without any secret. A confined process has one thread: numpy and pyarrow, and the
#: allocator of the latter, start no others.
ENVIRONMENT = {
    "PATH": "/usr/bin:/bin",
    "OMP_NUM_THREADS": "1",
    "JE_ARROW_MALLOC_CONF": "background_thread:false",
    "PYTHONDONTWRITEBYTECODE": "1",
}

#: Environment variable with the file descriptor of the socket between the service and its fork server.
REQUESTS = "ISLANDS_READERS"

#: Exit status if the file is unusable and the reason is the answer.
_REFUSED = 3

#: Errors that a process may refuse with; other ones are a `RecordError`.
_REFUSALS = {each.__name__: each for each in (ModelError, SettingsError)}

#: Largest number of open files.
_MAX_FILES = 64


def make_command(module: str) -> tuple[str, ...]:
    """Return the command that starts a module of this package, without the current folder in its path."""
    return sys.executable, "-P", "-m", f"islands_service.intake.{module}"


def make_message(
    path: Path,
    memory: int,
    seconds: float,
    asked: Mapping[str, Any],
    fmu: Path | None = None,
    folder: str | None = None,
) -> bytes:
    """Return the standard input of a process that reads a file.

    Parameters
    ----------
    fmu : Path, optional
        FMU that it reads as well.
    folder : str, optional
        Empty folder in which it may make files until it calls `end_writing`.
    """
    message = {"path": str(path), "memory": memory, "seconds": seconds, "asked": dict(asked)}
    return json.dumps({**message, "fmu": fmu and str(fmu), "folder": folder}).encode()


def enter(writes: bool = False, readable: Iterable[Path] = ()) -> tuple[str, dict[str, Any], IO[bytes]]:
    """Read the message on standard input, and restrict this process.

    Parameters
    ----------
    writes : bool
        Whether standard output is a file, which may have as many bytes as the process has memory.
    readable : iterable of Path
        Further files and folders that can be read.

    Returns
    -------
    path : str
    asked : dict
    answer : binary stream
        Standard output. What libraries print is on standard error instead.
    """
    answer = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    message = json.load(sys.stdin)
    memory, folder = message["memory"], message.get("folder")
    limit_resources(memory, message["seconds"], memory if writes or folder else 0)
    files = [Path(each).resolve() for each in (message["path"], message.get("fmu")) if each]
    gaps = confine([*files, *readable], [Path(folder)] if folder else [])
    asked = {**message["asked"], "fmu": message.get("fmu"), "folder": folder} if folder else message["asked"]
    if folder and gaps:
        refuse(SettingsError(explain_gaps(gaps)), answer)
    return message["path"], asked, answer


def explain_gaps(gaps: Sequence[str]) -> str:
    """Return why a service runs no FMUs on a machine that cannot confine them."""
    needs = " and ".join(gaps)
    return explain_no_fmus(f"ask its operator for a machine that can confine them, which needs {needs}")


def explain_no_fmus(remedy: str) -> str:
    """Return why a service runs no FMUs, and what to do; the remedy is that of its operator."""
    return (
        f"this service runs no FMUs, which are native code: {remedy}, run 'islands diagnose' locally, or "
        "send the simulated output as a column of the record"
    )


def end_writing(readable: Iterable[Path]) -> None:
    """End the right of this process to write; it can read the given files and folders, if it could."""
    resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))
    confine(readable)


def limit_resources(memory: int, seconds: float, output_bytes: int = 0) -> None:
    """Limit memory, time, open files and written bytes of this process."""
    whole = int(seconds) + 1
    for kind, most in (
        (resource.RLIMIT_AS, memory),
        (resource.RLIMIT_CPU, whole),
        (resource.RLIMIT_FSIZE, output_bytes),
        (resource.RLIMIT_NOFILE, _MAX_FILES),
        (resource.RLIMIT_CORE, 0),
    ):
        resource.setrlimit(kind, (most, most))


def refuse(error: IslandsError, answer: IO[bytes]) -> NoReturn:
    """End this process with the reason why the file is unusable."""
    send_document({"error": str(error), "kind": type(error).__name__}, answer)
    sys.exit(_REFUSED)


def send_document(document: Mapping[str, Any], answer: IO[bytes]) -> None:
    """Write a document as the answer of this process."""
    answer.write(json.dumps(document).encode())
    answer.flush()


@dataclass(frozen=True, slots=True)
class ConfinedTask:
    """What a process is started for, in the words of messages about it.

    Attributes
    ----------
    name : str
        Subject of the messages: the file that is read.
    verb, failure : str
        Behind a time that it takes, and before the limits within which it fails.
    cause, remedy : str
        Why it may fail, and what to do if it takes too long.
    """

    name: str
    verb: str = " to read"
    failure: str = "cannot be read"
    cause: str = "it is damaged, or unpacks to more than this service accepts"
    remedy: str = "give a shorter record, or NPZ instead of text"


def check_status(
    status: int | None, answer: bytes, complaint: bytes, task: ConfinedTask, memory: int, seconds: float
) -> None:
    """Raise the error of a process that has ended.

    Parameters
    ----------
    status : int or None
        Exit status.
    answer, complaint : bytes
        Standard output and standard error, or their beginnings.
    task : ConfinedTask

    Raises
    ------
    RecordError
        The file is unusable, or its reader has exceeded a limit.
    ModelError, SettingsError
        What is to be done with the file is not possible.
    """
    if status == _REFUSED:
        refusal = json.loads(answer)
        raise _REFUSALS.get(refusal.get("kind", ""), RecordError)(refusal["error"])
    if status:
        reason = complaint.decode(errors="replace").strip().rpartition("\n")[2] or f"exit {status}"
        if "/" in reason:  # a path of this machine, which is not for the owner of the file
            reason = reason.partition(":")[0]
        raise RecordError(
            f"{task.name} {task.failure} within {memory / 1e9:.1f} GB of memory and {seconds:.0f} s "
            f"({reason}): {task.cause}"
        )


def timeout_error(task: ConfinedTask, seconds: float) -> RecordError:
    """Return the error of a process that takes too long."""
    return RecordError(f"{task.name} takes longer than {seconds:.0f} s{task.verb}: {task.remedy}")
