"""The supervisor: starts the roles as its children, and again when they end or hang. Standard library alone.

It owns the data folder: a second one on the same folder is refused. Children that it started end with it,
however it ends.
"""

import ctypes
import fcntl
import os
import secrets
import signal
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from time import monotonic
from typing import IO

from islands.errors import IslandsError
from islands_service.liveness import StopRequest, stop_on_signals

#: Seconds between two looks at the children.
_LOOK = 0.05

#: Seconds that a child waits for its next start after an end: at first, and at the most. One that has lived
#: for `_PROVEN` seconds is started again at once.
_BACKOFF, _MOST_BACKOFF, _PROVEN = 0.2, 2.5, 10.0

#: Seconds that everything else waits for the API: on two cores Ray's start would double its own.
_API_FIRST = 2.0

#: Seconds that a child has until its first sign of life: Ray is read from a slow disk, a database is locked.
_STARTING = 120.0

#: Seconds that a child has to end by itself.
_GRACE = 15.0

#: Exit status of a child that cannot run with these settings: starting it again would not help, unless it has
#: run with them before.
MISCONFIGURED = 2

#: Linux: a process is sent this signal when its parent ends.
_PR_SET_PDEATHSIG = 1


class DataDirLockedError(IslandsError):
    """Another ``islands serve`` has the data folder."""


@dataclass(slots=True, eq=False)
class Role:
    """What runs as a child.

    Attributes
    ----------
    name : str
    command : sequence of str
    patience : float
        Seconds without a sign of life after which it is taken for hanging, once it has given one; until then
        it is starting, and may take longer.
    orphaned : signal
        What it is sent when the supervisor is lost.
    needs : tuple of str
        Roles that it cannot go on without: it is started again with them.
    address : Path, optional
        The file in which it says how it is reached: that holds no more when it has ended.
    worked : bool
        It has given signs of life, and ended, before.
    """

    name: str
    command: Sequence[str]
    patience: float
    orphaned: signal.Signals = signal.SIGTERM
    needs: tuple[str, ...] = ()
    address: Path | None = None
    process: "subprocess.Popen[bytes] | None" = None
    signs: int = -1
    heard: float | None = None
    started: float = 0.0
    start_at: float = 0.0
    backoff: float = _BACKOFF
    worked: bool = False


@contextmanager
def folder_lock(folder: Path) -> Iterator[None]:
    """Own a data folder: the lock ends with the process, however that ends.

    Raises
    ------
    DataDirLockedError
    """
    folder.mkdir(parents=True, exist_ok=True, mode=0o700)
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
    """Run roles until SIGTERM or Ctrl-C, then end them in the order in which they were given.

    Parameters
    ----------
    roles : sequence of Role
        The first one is started first, and the others when it has given a sign of life.
    environment : mapping
        The children's.

    Returns
    -------
    int
        0, or `MISCONFIGURED` where a child says that it cannot run so, and never has.
    """
    stopping = StopRequest()
    stop_on_signals(stopping)
    # Ray asks whoever talks to it for a token.
    environment = {"RAY_AUTH_TOKEN": secrets.token_hex(16), **environment}
    began = monotonic()
    status = 0
    try:
        while not stopping.wait(_LOOK) and status == 0:
            now = monotonic()
            waiting = roles[0].heard is None and now - began < _API_FIRST
            for role in roles[:1] if waiting else roles:
                status = _tend(role, roles, environment, now, log) or status
    finally:
        _end(roles, log)
    return status


def _tend(role: Role, roles: Sequence[Role], environment: Mapping[str, str], now: float, log: IO[str]) -> int:
    """Start a role that is to run, end it where it hangs, and take note of its end."""
    if role.process is None:
        if now >= role.start_at:
            _start(role, environment)
        return 0
    _listen(role, now)
    if role.process.poll() is None:
        since, patience = (role.started, _STARTING) if role.heard is None else (role.heard, role.patience)
        if now - since > patience:
            _say(log, f"{role.name} has said nothing for {now - since:.1f} s: it is started again")
            role.process.kill()
        return 0
    code, worked = role.process.returncode, role.worked
    _ended(role, now)
    # Where it has worked with these settings, a key has expired, or a port was taken meanwhile: that can be
    # mended while the jobs go on.
    if code == MISCONFIGURED and not worked:
        return MISCONFIGURED
    _say(log, f"{role.name} ended ({code}): it is started again")
    for other in roles:
        if role.name in other.needs and other.process is not None:
            other.process.kill()
    return 0


def _start(role: Role, environment: Mapping[str, str]) -> None:
    signs, says = os.pipe()
    os.set_blocking(signs, False)
    os.set_blocking(says, False)
    role.process = subprocess.Popen(
        role.command,
        env={**environment, "ISLANDS_LIFELINE": str(says)},
        stdin=subprocess.DEVNULL,
        pass_fds=(says,),
        # A Ctrl-C in the terminal is for us: we tell the children, each in its turn.
        start_new_session=True,
        preexec_fn=lambda: _follow(role.orphaned),  # noqa: PLW1509 - this process has one thread
    )
    os.close(says)
    role.signs, role.heard, role.started = signs, None, monotonic()


def _follow(orphaned: signal.Signals) -> None:
    with suppress(AttributeError, OSError):
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, orphaned)


def _listen(role: Role, now: float) -> None:
    with suppress(BlockingIOError):
        if os.read(role.signs, 4096):
            role.heard = now


def _ended(role: Role, now: float) -> None:
    assert role.process is not None
    # Whom it has left behind: Ray's processes look only once a minute whether they are still wanted.
    with suppress(ProcessLookupError):
        os.killpg(role.process.pid, signal.SIGKILL)
    os.close(role.signs)
    if role.address is not None:
        role.address.unlink(missing_ok=True)
    proven = now - role.started > _PROVEN
    role.start_at = now if proven else now + role.backoff
    role.backoff = _BACKOFF if proven else min(2.0 * role.backoff, _MOST_BACKOFF)
    role.worked = role.worked or role.heard is not None
    role.process, role.signs = None, -1


def _end(roles: Sequence[Role], log: IO[str]) -> None:
    """End all children: they drain and keep what they have; who takes too long is ended."""
    until = monotonic() + _GRACE
    for role in roles:
        if role.process is None:
            continue
        role.process.terminate()
        try:
            role.process.wait(max(0.1, until - monotonic()))
        except subprocess.TimeoutExpired:
            _say(log, f"{role.name} does not end: it is ended")
            role.process.kill()
            role.process.wait()
        _ended(role, monotonic())


def _say(log: IO[str], line: str) -> None:
    print(f"islands serve: {line}", file=log, flush=True)
