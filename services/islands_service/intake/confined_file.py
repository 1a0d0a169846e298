"""Answers of confined processes as files in memory, for numbers that are too many for a document."""

import signal
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

from islands_service.intake.confined_process import ConfinedTask, check_status, make_message, timeout_error
from islands_service.intake.reader_process import FORK_SERVER, open_memory

#: Largest number of bytes of an error message.
_MAX_MESSAGE = 16_000_000


@contextmanager
def open_answer(
    program: str, path: Path, asked: Mapping[str, Any], memory: int, seconds: float
) -> Iterator[IO[bytes]]:
    """Open the answer of a process that reads a file; wait for its end.

    Parameters
    ----------
    program : str
        Key of `islands_service.intake.fork_server.PROGRAMS`.
    path : Path
    asked : mapping
        What the process is asked for, as JSON.
    memory, seconds
        Limits of the process: bytes of address space, and time.

    Raises
    ------
    RecordError
        The file cannot be read as asked, or not within the limits.
    MemoryError
        The process was killed, as the kernel does if the machine has too little memory.
    """
    message = make_message(path, memory, seconds, asked)
    with (
        open_memory("answer") as output,
        open_memory("errors") as errors,
        FORK_SERVER.start(program, message, output.fileno(), errors.fileno()) as process,
    ):
        try:
            status = process.wait(seconds)
        except TimeoutError:
            raise timeout_error(ConfinedTask(path.name), seconds) from None
        finally:
            process.kill()
            process.wait()
        output.seek(0)
        errors.seek(0)
        if status == -signal.SIGKILL:
            raise MemoryError(f"the process that reads {path.name} was killed: check the machine's memory")
        if status:
            answer, complaint = output.read(_MAX_MESSAGE), errors.read(_MAX_MESSAGE)
            check_status(status, answer, complaint, ConfinedTask(path.name), memory, seconds)
        yield output
