"""FMU in a confined process, which can read the FMU and the installed software only.

An FMU is native code. The process extracts it to an empty folder, loses the right to write, and only then
loads it. Requests and answers are numbers: the process that asks parses nothing that the FMU controls.
"""

import os
import pickle
import socket
import time
import zipfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from struct import Struct
from tempfile import TemporaryDirectory
from typing import IO, Any

import numpy as np

from islands.errors import ModelError
from islands.kernels.jit_cache import cache_folder
from islands.simulators.fmu.fmi_description import FmiDescription
from islands.simulators.fmu.instance import FmuInstance, FmuLane, FmuRun, FmuSource
from islands_service.domain.uploaded_fmu import check_interface, describe_fmu, read_fmu
from islands_service.intake.confined_process import end_writing, enter, make_message
from islands_service.intake.reader_process import SIMULATION_SERVER, ReaderProcess, open_memory

#: Length of a request; numbers of outputs, of samples, and of bytes of the failure in an answer.
_REQUEST, _ANSWER = Struct("<q"), Struct("<qqq")

#: Longest time of a simulation in seconds, and time between two calls of the check during it.
_MAX_SECONDS, _CHECK_SECONDS = 120.0, 0.5

#: Largest number of samples of the simulations of a request, unless one simulation has more.
_MAX_SAMPLES = 200_000

#: Largest number of bytes of a failure.
_MAX_FAILURE = 4000


class ConfinedFmu:
    """FMU that another process simulates.

    Parameters
    ----------
    name : str
        Name of the FMU, for messages.
    connection : socket
        To the process.
    check : callable
        Called during a simulation; raises the reason if it must end.
    """

    def __init__(self, name: str, connection: socket.socket, check: Callable[[], None]) -> None:
        self._name, self._connection, self._check = name, connection, check
        connection.settimeout(_CHECK_SECONDS)

    def wait(self, process: ReaderProcess) -> None:
        """Wait until the process has loaded the FMU.

        Raises
        ------
        ModelError
            It cannot be loaded.
        """
        while True:
            self._check()
            with suppress(TimeoutError):
                process.wait_start(_CHECK_SECONDS)
                break
        if failure := self._receive(0, 0).failure:
            raise ModelError(failure)

    def simulate(self, lanes: Sequence[FmuLane], start_time: float, dt: float) -> list[FmuRun]:
        """Simulate as `islands.simulators.fmu.instance.FmuInstance.simulate` does.

        Raises
        ------
        ModelError
            The process has ended, or takes too long.
        """
        together = max(1, _MAX_SAMPLES // lanes[0].shape[1])
        runs = []
        for first in range(0, len(lanes), together):
            part = lanes[first : first + together]
            # Lanes have most signals in common, which a request contains once.
            request = pickle.dumps((part, start_time, dt))
            self._send(_REQUEST.pack(len(request)) + request)
            runs += [self._receive(*lane.shape) for lane in part]
        return runs

    def _send(self, data: bytes) -> None:
        rest = memoryview(data)
        until = time.monotonic() + _MAX_SECONDS
        while rest:
            rest = rest[self._retry(lambda: self._connection.send(rest), until) :]  # noqa: B023

    def _receive(self, outputs: int, samples: int) -> FmuRun:
        until = time.monotonic() + _MAX_SECONDS
        found = _ANSWER.unpack(self._read(_ANSWER.size, until))
        if found[:2] != (outputs, samples) or not 0 <= found[2] <= _MAX_FAILURE:
            raise ModelError(f"the process of {self._name} has answered nonsense: export the FMU again")
        failure = self._read(found[2], until).decode(errors="replace")
        y = np.frombuffer(self._read(8 * outputs * samples, until), "<f8").reshape(outputs, samples)
        return FmuRun(y.copy(), failure)

    def _read(self, size: int, until: float) -> bytes:
        received = bytearray()
        while len(received) < size:
            chunk = self._retry(lambda: self._connection.recv(size - len(received)), until)  # noqa: B023
            if not chunk:
                raise self._make_end_error()
            received += chunk
        return bytes(received)

    def _retry(self, action: Callable[[], Any], until: float) -> Any:
        """Repeat an action that may time out; check in between."""
        while True:
            self._check()
            try:
                return action()
            except TimeoutError:
                if time.monotonic() > until:
                    raise ModelError(
                        f"a simulation of {self._name} takes more than {_MAX_SECONDS:.0f} s: select fewer "
                        "samples, or export it with larger steps"
                    ) from None
            except (BrokenPipeError, ConnectionResetError):
                raise self._make_end_error() from None

    def _make_end_error(self) -> ModelError:
        return ModelError(
            f"the process of {self._name} has ended during a simulation: the FMU fails with these values, "
            "calls what a service forbids, or needs too much memory or time"
        )


@contextmanager
def open_confined(
    path: Path, description: FmiDescription, memory: int, seconds: float, check: Callable[[], None]
) -> Iterator[FmuSource]:
    """Provide an FMU in a confined process while the block runs.

    Parameters
    ----------
    path : Path
        File of the FMU.
    description : FmiDescription
        With the name of the file in place of a path.
    memory, seconds
        Limits of the process: bytes of address space, and time of the CPU.
    check : callable
        Called during simulations; raises the reason if they must end.

    Raises
    ------
    ModelError
        The FMU cannot be loaded.
    """
    with ExitStack() as stack:
        folder = stack.enter_context(TemporaryDirectory(prefix="islands-fmu-"))
        errors = stack.enter_context(open_memory("errors"))
        ours, theirs = socket.socketpair()
        stack.enter_context(ours)
        asked = {"description": describe_fmu(description)}
        message = make_message(path, memory, seconds, asked, path, folder)
        with theirs:
            process = SIMULATION_SERVER.start("confined_fmu", message, theirs.fileno(), errors.fileno())
        stack.enter_context(process)
        confined = ConfinedFmu(description.name, ours, check)
        confined.wait(process)
        yield FmuSource(lambda _, interface: check_interface(description, interface), lambda _: confined)


def load_extracted(asked: Mapping[str, Any], document: Mapping[str, Any], *readable: Path) -> FmuSource:
    """Extract and load the FMU of this confined process, which can write no file from then on.

    Parameters
    ----------
    asked : mapping
        What `islands_service.intake.confined_process.enter` returns.
    document : mapping
        Description of the FMU.
    readable : Path
        Further files and folders that can be read.

    Raises
    ------
    ModelError
        The FMU cannot be extracted or loaded.
    """
    name, parent = Path(document["path"]).name, Path(asked["folder"])
    folder = parent / name
    try:
        with zipfile.ZipFile(asked["fmu"]) as archive:
            archive.extractall(folder)
    except (OSError, ValueError, zipfile.BadZipFile, RuntimeError) as error:
        raise ModelError(f"{name} cannot be extracted ({error}): export it again") from error
    end_writing([parent, *readable])
    description = read_fmu(document, str(folder))
    instance = FmuInstance(description)
    return FmuSource(lambda _, interface: check_interface(description, interface), lambda _: instance)


def main() -> None:
    """Simulate the FMU named on standard input until the other end of standard output is closed."""
    kernels = [each for each in (cache_folder(),) if each is not None]
    _, asked, answer = enter(readable=kernels)
    try:
        source = load_extracted(asked, asked["description"], *kernels)
        fmu = source.load(read_fmu(asked["description"], ""))
    except ModelError as error:
        _answer(answer, FmuRun(np.empty((0, 0)), str(error).replace(f"{asked['folder']}/", "")))
        return
    _answer(answer, FmuRun(np.empty((0, 0))))
    with os.fdopen(os.dup(answer.fileno()), "rb") as requests:
        while header := requests.read(_REQUEST.size):
            lanes, start_time, dt = pickle.loads(requests.read(_REQUEST.unpack(header)[0]))
            for lane in lanes:
                _answer(answer, *fmu.simulate([lane], start_time, dt))


def _answer(stream: IO[bytes], run: FmuRun) -> None:
    failure = run.failure.encode()[:_MAX_FAILURE]
    stream.write(_ANSWER.pack(*run.y.shape, len(failure)) + failure + run.y.astype("<f8").tobytes())
    stream.flush()
