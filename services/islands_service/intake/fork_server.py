"""Fork server: ``python -m islands_service.intake.fork_server`` forks a process for each untrusted file.

To start an interpreter and to import the readers takes most of the time of a small file. This process does it
once. It has one thread, no secret, and nothing of a file or of a request: a forked process reads its message
and its file itself, after it has restricted itself.
"""

import os
import resource
import selectors
import signal
import sys
import traceback
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from importlib import import_module
from socket import recv_fds, socket
from typing import NoReturn

from islands.processes import freeze_garbage_collector
from islands_service.intake import file_inspection, fmu_inspection, record_reading
from islands_service.intake.reader_process import STARTED
from islands_service.liveness import EVERY, send_heartbeat, set_parent_death_signal
from islands_service.settings import service_settings

#: Programs of the forked processes.
PROGRAMS: Mapping[str, Callable[[], None]] = {
    "file_inspection": file_inspection.main,
    "fmu_inspection": fmu_inspection.main,
    "record_reading": record_reading.write_record,
    "column_reading": record_reading.write_columns,
}

#: Modules that the programs import when they run, so that the API does not import them. Those of single
#: formats are left out: they would double the memory of this process.
_PRELOADED = (
    "islands.facade.inspect_table",
    "islands.records.inspection.record_facts",
    "islands.records.reading.column_names",
    "islands.records.reading.preview",
    "islands.records.reading.reader",
    "islands.records.reading.options",
    "islands.records.reading.row_range",
    "islands.records.reading.open_table",
    "numpy.fft",
    "numpy.random",
)

#: Largest number of open files of this process; each forked process takes one.
_MAX_FILES = 1024

#: Number of file descriptors of a request: the control socket, standard input, output and error.
_DESCRIPTORS = 4

#: Largest number of bytes of the name of a program.
_MAX_NAME = 64


def main() -> None:
    """Fork readers of files until every client has ended."""
    serve(PROGRAMS, _PRELOADED)


def serve(
    programs: Mapping[str, Callable[[], None]],
    preloaded: Sequence[str],
    prepare: Callable[[], None] = lambda: None,
) -> None:
    """Fork processes that run one of the programs each, until every client has ended.

    Parameters
    ----------
    preloaded : sequence of str
        Modules that are imported before.
    prepare : callable
        Called after it.
    """
    settings = service_settings()
    assert settings.readers is not None, "only a service starts this process"
    resource.setrlimit(resource.RLIMIT_NOFILE, (_MAX_FILES, _MAX_FILES))
    for module in preloaded:
        import_module(module)
    prepare()
    # A collection in a forked process would copy the pages that it shares with this one.
    freeze_garbage_collector()
    _ForkServer(programs, socket(fileno=settings.readers), settings.lifeline).run()


class _ForkServer:
    """Loop that forks, ends and reaps processes."""

    def __init__(
        self, programs: Mapping[str, Callable[[], None]], requests: socket, lifeline: int | None
    ) -> None:
        self._programs = programs
        self._requests, self._lifeline = requests, lifeline
        self._selector = selectors.DefaultSelector()
        #: Control sockets of the running processes.
        self._controls: dict[int, socket] = {}

    def run(self) -> None:
        ended, signals = os.pipe()
        for descriptor in (ended, signals):
            os.set_blocking(descriptor, False)
        signal.signal(signal.SIGCHLD, lambda *_: None)
        signal.set_wakeup_fd(signals)
        self._selector.register(ended, selectors.EVENT_READ)
        self._selector.register(self._requests, selectors.EVENT_READ)
        while True:
            send_heartbeat(self._lifeline)
            for key, _ in self._selector.select(None if self._lifeline is None else EVERY):
                if key.fileobj == ended:
                    with suppress(BlockingIOError):
                        os.read(ended, 4096)
                    self._reap()
                elif isinstance(key.data, int):
                    self._end(key.data, key.fileobj)
                elif not self._answer():
                    return

    def _answer(self) -> bool:
        """Fork a process for a request; return whether there was one: all clients may have ended."""
        name, descriptors, _, _ = recv_fds(self._requests, _MAX_NAME, _DESCRIPTORS)
        if not name:
            return False
        control, *standard = descriptors
        own = os.getpid()
        try:
            pid = os.fork()
        except OSError as error:
            # The client reads the end of the control socket.
            print(f"no process can be started: {error}", file=sys.stderr, flush=True)
            os.close(control)
        else:
            if pid == 0:
                _run_program(self._programs[name.decode()], standard, own)
            self._controls[pid] = socket(fileno=control)
            with suppress(BrokenPipeError):
                self._controls[pid].send(STARTED)
            self._selector.register(self._controls[pid], selectors.EVENT_READ, pid)
        for descriptor in standard:
            os.close(descriptor)
        return True

    def _end(self, pid: int, control: object) -> None:
        """Kill a process whose client has closed its end of the control socket."""
        # Otherwise the process has been reaped in the same turn of the loop.
        if self._controls.get(pid) is control:
            self._selector.unregister(self._controls[pid])
            os.kill(pid, signal.SIGKILL)

    def _reap(self) -> None:
        """Send the exit statuses of processes that have ended."""
        with suppress(ChildProcessError):
            while (found := os.waitpid(-1, os.WNOHANG))[0]:
                pid, status = found
                with self._controls.pop(pid) as control:
                    if control in self._selector.get_map():
                        self._selector.unregister(control)
                    with suppress(BrokenPipeError):
                        control.send(str(os.waitstatus_to_exitcode(status)).encode())


def _run_program(program: Callable[[], None], standard: list[int], parent: int) -> NoReturn:
    """Run a program in this forked process with the given standard input, output and error, and end."""
    status = 1
    try:
        signal.set_wakeup_fd(-1)
        signal.signal(signal.SIGCHLD, signal.SIG_DFL)
        for target, descriptor in enumerate(standard):
            os.dup2(descriptor, target)
        os.closerange(len(standard), _MAX_FILES)
        set_parent_death_signal(signal.SIGKILL)
        if os.getppid() == parent:
            program()
            status = 0
    except SystemExit as ended:
        status = int(ended.code or 0)
    except BaseException:
        traceback.print_exc()
    finally:
        # Nothing of the server runs in this process.
        with suppress(BaseException):
            sys.stderr.flush()
        os._exit(status)


if __name__ == "__main__":
    main()
