"""Supervisor: starts the roles as child processes and restarts them if they end or hang.

It uses only the standard library. It locks the data folder, so that a second supervisor on the same folder is
refused. Its children end with it, even if it is killed.
"""

import fcntl
import os
import secrets
import signal
import stat
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from math import inf
from pathlib import Path
from time import monotonic
from typing import IO

from islands.errors import IslandsError
from islands_service.liveness import (
    FAILED,
    IN_NEED,
    MISCONFIGURED,
    STARTING,
    UNAVAILABLE,
    StopRequest,
    set_parent_death_signal,
    stop_on_signals,
)

#: Seconds between two checks of the children, and while one of them is starting. The exit of a child is
#: noticed at once.
_POLL_SECONDS, _STARTUP_POLL_SECONDS = 0.25, 0.05

#: Seconds before a child is started again after its first exit; doubled with every further one.
_FIRST_BACKOFF = 0.2

#: Longest wait before a child is started again, in seconds.
_MAX_BACKOFF = 2.5

#: Seconds of run time after which an exit is followed by an immediate restart.
_STABLE_AFTER = 10.0

#: Longest time in seconds for which the other roles wait for the first heartbeat of the API. On two cores a
#: concurrent start of Ray doubles the start-up time of the API.
_API_HEAD_START = 2.0

#: Seconds until the first heartbeat of a child: Ray may be read from a slow disk, a database may be locked.
#: Also the longest time without a heartbeat of a child that reads pages of its memory from a disk.
_STARTUP_TIMEOUT = 120.0

#: Seconds that the children have to end by themselves.
_SHUTDOWN_GRACE = 15.0

#: Seconds for which a role on demand runs after the last heartbeat of a role that needs it. Ray takes five
#: seconds of a core to start, and 260 MB while it runs.
_LINGER_SECONDS = 300.0

#: Number of exits with the same error at the start, without any longer run, that end the supervisor.
_MOST_FAILURES = 5

#: Letter of Linux for a process that waits for a disk and cannot be interrupted.
_WAITS_FOR_DISK = "D"


class DataDirLockedError(IslandsError):
    """Another ``islands serve`` has locked the data folder."""


class DataDirSharedError(IslandsError):
    """Other users may enter the data folder, and this process cannot change that."""


@dataclass(slots=True, eq=False)
class Role:
    """Child process of the supervisor.

    Attributes
    ----------
    name : str
    command : sequence of str
    patience : float
        Seconds without a heartbeat after which the process counts as hanging. It may take longer while it is
        starting, before the first heartbeat, or reads pages of its memory from a disk.
    orphaned : signal
        Signal that the process receives if the supervisor ends.
    needs : tuple of str
        Roles that it may need. After a heartbeat `IN_NEED` it cannot run without them: if one of them ends,
        this one is restarted, too.
    on_demand : bool
        Whether it runs only while another role needs it, and for a while after that.
    address : Path, optional
        File in which the process stores its address. It is deleted when the process has ended.
    descriptors : mapping of str to int
        File descriptors that the process inherits, by the environment variables that name them.
    environment : mapping, optional
        Environment of the process, if it is not that of the other roles.
    process : Popen, optional
        The running process; None while it waits for its next start.
    pipe : int
        File descriptor from which heartbeats are read; -1 if the process does not run.
    last_heartbeat : float, optional
        Time of the last heartbeat; None before the first one of the program.
    last_active : float
        Time of the last heartbeat, or of a later check that has found it reading pages from a disk.
    is_in_need : bool
        Whether the last heartbeat was `IN_NEED`.
    needed_at : float
        Time of the last such heartbeat.
    page_faults : str
        Number of pages that it had read then.
    is_killed : bool
        Whether the process is killed because it hangs. One that waits for a disk ends after that.
    is_dismissed : bool
        Whether the process is asked to end because no other role needs it.
    started_at, start_at : float
        Time of the last start, and the earliest time of the next one.
    backoff : float
        Seconds before the start that follows the next exit.
    has_run : bool
        Whether an earlier process of this role has sent a heartbeat.
    is_stable : bool
        Whether an earlier process of this role has run for a while.
    failure : int
        Exit status of the last process if it ended at its start with an error, otherwise 0.
    failures : int
        Number of consecutive processes that ended with this status.
    """

    name: str
    command: Sequence[str]
    patience: float
    orphaned: signal.Signals = signal.SIGTERM
    needs: tuple[str, ...] = ()
    on_demand: bool = False
    address: Path | None = None
    descriptors: Mapping[str, int] = field(default_factory=dict)
    environment: Mapping[str, str] | None = None
    process: "subprocess.Popen[bytes] | None" = None
    pipe: int = -1
    last_heartbeat: float | None = None
    last_active: float = 0.0
    is_in_need: bool = False
    needed_at: float = -inf
    page_faults: str = ""
    is_killed: bool = False
    is_dismissed: bool = False
    started_at: float = 0.0
    start_at: float = 0.0
    backoff: float = _FIRST_BACKOFF
    has_run: bool = False
    is_stable: bool = False
    failure: int = 0
    failures: int = 0


def make_private(folder: Path) -> None:
    """Make a data folder if it does not exist, and let no other user enter it.

    Raises
    ------
    DataDirSharedError
        The folder belongs to another user, or is one for the files of all users.
    """
    folder.mkdir(parents=True, exist_ok=True, mode=0o700)
    mode = stat.S_IMODE(folder.stat().st_mode)
    if not mode & 0o077:
        return
    shared = DataDirSharedError(
        f"{folder} is open to other users (mode {mode:04o}), and contains uploads, results and keys: give a "
        "folder of your own as --data-dir"
    )
    if mode & stat.S_ISVTX:
        raise shared
    try:
        folder.chmod(mode & 0o700)
    except PermissionError as error:
        raise shared from error


@contextmanager
def folder_lock(folder: Path) -> Iterator[None]:
    """Make a data folder private and lock it. The operating system releases the lock when the process ends.

    Raises
    ------
    DataDirSharedError, DataDirLockedError
    """
    make_private(folder)
    with (folder / "lock").open("a+") as stream:
        try:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            stream.seek(0)
            raise DataDirLockedError(
                f"{folder} belongs to another 'islands serve' (process {stream.read().strip() or '?'}): end "
                "that, or give another --data-dir"
            ) from None
        stream.truncate(0)
        stream.write(f"{os.getpid()}\n")
        stream.flush()
        yield


def supervise(roles: Sequence[Role], environment: Mapping[str, str], log: IO[str] = sys.stderr) -> int:
    """Run roles until SIGTERM or Ctrl-C, then end them in the given order.

    Parameters
    ----------
    roles : sequence of Role
        The first role starts first, the others after its first heartbeat, at the latest after two seconds.
    environment : mapping
        Environment of the children.

    Returns
    -------
    int
        0; `MISCONFIGURED` if a child exits with this status before it has ever run; `FAILED` if a child ends
        again and again at its start with the same error.
    """
    stopping = StopRequest()
    stop_on_signals(stopping)
    signal.signal(signal.SIGCHLD, lambda *_: stopping.wake())
    # Ray requires a token of every client.
    environment = {"RAY_AUTH_TOKEN": secrets.token_hex(16), **environment}
    began = monotonic()
    status = 0
    try:
        while not stopping.wait(_choose_pause(roles)) and status == 0:
            now = monotonic()
            waiting = roles[0].last_heartbeat is None and now - began < _API_HEAD_START
            for role in roles[:1] if waiting else roles:
                status = _check_role(role, roles, environment, now, log) or status
    finally:
        _shut_down(roles, log)
    return status


def _choose_pause(roles: Sequence[Role]) -> float:
    running = all(role.on_demand or (role.process and role.last_heartbeat is not None) for role in roles)
    return _POLL_SECONDS if running else _STARTUP_POLL_SECONDS


def _check_role(
    role: Role, roles: Sequence[Role], environment: Mapping[str, str], now: float, log: IO[str]
) -> int:
    """Start a role that is due, kill it if it hangs, handle its exit; return a final status or 0."""
    needed = not role.on_demand or _is_needed(role, roles, now)
    if role.process is None:
        if needed and now >= role.start_at:
            _start(role, environment)
        return 0
    _read_heartbeats(role, now)
    if role.process.poll() is None:
        if _is_hanging(role, now) and not role.is_killed:
            silent = now - (role.last_heartbeat or role.started_at)
            _print(log, f"{role.name} has sent no heartbeat for {silent:.1f} s: it is started again")
            role.process.kill()
            role.is_killed = True
        elif not (needed or role.is_dismissed):
            _print(log, f"{role.name} ends, since no job has needed it for {_LINGER_SECONDS:.0f} s")
            role.process.terminate()
            role.is_dismissed = True
        return 0
    code, has_run, dismissed = role.process.returncode, role.has_run, role.is_dismissed
    _handle_exit(role, now)
    # If it has run with these settings, the cause (an expired key, a port in use) can be repaired while the
    # jobs run.
    if code == MISCONFIGURED and not has_run:
        return MISCONFIGURED
    if role.failures == _MOST_FAILURES:
        _print(
            log,
            f"{role.name} has ended {_MOST_FAILURES} times at its start ({code}): correct the error that it "
            "has printed above, and start the service again",
        )
        return FAILED
    if not dismissed:
        _print(log, f"{role.name} ended ({code}): it is started again")
    for other in roles:
        if role.name in other.needs and other.is_in_need and other.process is not None:
            other.process.kill()
    return 0


def _is_needed(role: Role, roles: Sequence[Role], now: float) -> bool:
    return any(role.name in other.needs and now - other.needed_at < _LINGER_SECONDS for other in roles)


def _start(role: Role, environment: Mapping[str, str]) -> None:
    reading, writing = os.pipe()
    os.set_blocking(reading, False)
    os.set_blocking(writing, False)
    inherited = {"ISLANDS_LIFELINE": writing, **role.descriptors}
    if role.environment is not None:
        environment = role.environment
    role.process = subprocess.Popen(
        role.command,
        env={**environment, **{name: str(descriptor) for name, descriptor in inherited.items()}},
        stdin=subprocess.DEVNULL,
        pass_fds=tuple(inherited.values()),
        # A Ctrl-C in the terminal must reach the supervisor alone, which ends the children in order.
        start_new_session=True,
        preexec_fn=lambda: set_parent_death_signal(role.orphaned),  # noqa: PLW1509 - this process has one thread
    )
    os.close(writing)
    role.pipe, role.last_heartbeat, role.started_at = reading, None, monotonic()
    role.is_killed = role.is_dismissed = role.is_in_need = False


def _read_heartbeats(role: Role, now: float) -> None:
    with suppress(BlockingIOError):
        if received := os.read(role.pipe, 4096):
            role.last_heartbeat = role.last_active = now
            role.is_in_need = received.endswith(IN_NEED)
            if role.is_in_need:
                role.needed_at = now
            role.page_faults, _ = _read_state(role)
            if received.endswith(STARTING):
                role.has_run = True
                role.is_stable = role.is_stable or now - role.started_at > _STABLE_AFTER
                role.last_heartbeat, role.started_at = None, now


def _is_hanging(role: Role, now: float) -> bool:
    """Return whether a process is silent for longer than it may be.

    A thread that waits for a page, for example of a library that is imported from a busy disk, holds the lock
    of the interpreter. No other thread sends a heartbeat meanwhile.
    """
    if role.last_heartbeat is None:
        return now - role.started_at > _STARTUP_TIMEOUT
    if now - role.last_active > role.patience:
        page_faults, state = _read_state(role)
        if page_faults != role.page_faults or state == _WAITS_FOR_DISK:
            role.last_active, role.page_faults = now, page_faults
    return now - role.last_active > role.patience or now - role.last_heartbeat > _STARTUP_TIMEOUT


def _read_state(role: Role) -> tuple[str, str]:
    """Return how many pages a process has read from a disk, and its state; both empty without /proc."""
    assert role.process is not None
    with suppress(OSError):
        fields = Path(f"/proc/{role.process.pid}/stat").read_text().rpartition(")")[2].split()
        return fields[9], fields[0]
    return "", ""


def _handle_exit(role: Role, now: float) -> None:
    assert role.process is not None
    # Kill the remaining processes of the group: those of Ray check only once a minute whether
    # their parent lives.
    with suppress(ProcessLookupError):
        os.killpg(role.process.pid, signal.SIGKILL)
    os.close(role.pipe)
    if role.address is not None:
        role.address.unlink(missing_ok=True)
    stable = now - role.started_at > _STABLE_AFTER
    role.start_at = now if stable else now + role.backoff
    role.backoff = _FIRST_BACKOFF if stable else min(2.0 * role.backoff, _MAX_BACKOFF)
    role.has_run = role.has_run or role.last_heartbeat is not None
    role.is_stable = role.is_stable or (stable and role.last_heartbeat is not None)
    _count_failures(role, role.process.returncode)
    role.process, role.pipe = None, -1


def _count_failures(role: Role, code: int) -> None:
    """Count an exit with the same error as the last one, unless a process of the role has run for a while.

    What has run can be repaired while the jobs run; `MISCONFIGURED` is then such a cause. A killed process
    may be free of errors: the supervisor kills those that hang, and those that need one that has ended.
    """
    if role.is_stable or code in (0, MISCONFIGURED, UNAVAILABLE, -signal.SIGKILL):
        role.failure = role.failures = 0
        return
    role.failures = role.failures + 1 if code == role.failure else 1
    role.failure = code


def _shut_down(roles: Sequence[Role], log: IO[str]) -> None:
    """End all children in order, so that they can store their state; kill those that take too long."""
    until = monotonic() + _SHUTDOWN_GRACE
    for role in roles:
        if role.process is None:
            continue
        role.process.terminate()
        try:
            role.process.wait(max(0.1, until - monotonic()))
        except subprocess.TimeoutExpired:
            _print(log, f"{role.name} does not end: it is killed")
            role.process.kill()
            role.process.wait()
        _handle_exit(role, monotonic())


def _print(log: IO[str], line: str) -> None:
    print(f"islands serve: {line}", file=log, flush=True)
