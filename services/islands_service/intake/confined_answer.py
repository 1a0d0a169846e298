"""Answers of confined processes: documents in an event loop, and files in memory for numbers."""

import asyncio
import json
import os
import signal
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import IO, Any

from islands_service.intake.confined_process import ConfinedTask, check_status, make_message, timeout_error
from islands_service.intake.reader_process import FORK_SERVER, ForkServer, ReaderProcess, open_memory

#: Largest number of bytes of an answer, which a harmful file may control, and of a part of it.
_MAX_OUTPUT, _CHUNK = 64_000_000, 65_536

#: Largest number of bytes of an error message.
_MAX_MESSAGE = 16_000_000


async def ask_confined(
    program: str,
    path: Path,
    asked: Mapping[str, Any],
    memory: int,
    seconds: float,
    server: ForkServer | None = None,
    fmu: Path | None = None,
    task: ConfinedTask | None = None,
) -> Mapping[str, Any]:
    """Return the answer of a process that reads a file.

    Parameters
    ----------
    program : str
        Key of the programs of the server.
    path : Path
    asked : mapping
        What the process is asked for, as JSON.
    memory, seconds
        Limits of the process: bytes of address space, and time.
    server : ForkServer, optional
        By default that of the readers.
    fmu : Path, optional
        FMU that the process extracts and runs.
    task : ConfinedTask, optional
        By default the reading of the file.

    Raises
    ------
    RecordError, ModelError, SettingsError
        The file cannot be read as asked, or not within the limits.
    """
    task = task or ConfinedTask(path.name)
    with ExitStack() as files:
        (answers, output), (complaints, errors) = _open_pipe(files), _open_pipe(files)
        folder = files.enter_context(TemporaryDirectory(prefix="islands-fmu-")) if fmu else None
        message = make_message(path, memory, seconds, asked, fmu, folder)
        process = files.enter_context(
            (server or FORK_SERVER).start(program, message, output.fileno(), errors.fileno())
        )
        output.close()
        errors.close()
        try:
            # A server that has to start first takes seconds, which are not those of the file.
            await process.wait_start_async()
            async with asyncio.timeout(seconds):
                answer, complaint = await asyncio.gather(
                    _read_output(process, answers), _read_output(process, complaints)
                )
                status = await process.wait_async()
        except TimeoutError:
            raise timeout_error(task, seconds) from None
        finally:
            process.kill()
            await process.wait_async()
    check_status(status, answer, complaint, task, memory, seconds)
    return dict(json.loads(answer))


def _open_pipe(files: ExitStack) -> tuple[IO[bytes], IO[bytes]]:
    """Return both ends of a pipe, which are closed with the stack."""
    reading, writing = os.pipe()
    return files.enter_context(os.fdopen(reading, "rb", 0)), files.enter_context(os.fdopen(writing, "wb", 0))


async def _read_output(process: ReaderProcess, pipe: IO[bytes]) -> bytes:
    """Read an answer to its end; end the process if it is too long."""
    stream = asyncio.StreamReader()
    protocol = asyncio.StreamReaderProtocol(stream)
    transport, _ = await asyncio.get_running_loop().connect_read_pipe(lambda: protocol, pipe)
    received = bytearray()
    try:
        while chunk := await stream.read(_CHUNK):
            if len(received) < _MAX_OUTPUT:
                received += chunk
            else:
                process.kill()
    finally:
        transport.close()
    return bytes(received)


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
