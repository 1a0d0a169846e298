"""PostgreSQL databases for tests, on a given server or on a temporary one.

The temporary server has a separate folder below the system's temporary folder, listens only on a socket in it
and is stopped by its process id. It does not wait for the disk: acknowledged writes survive a crash of the
server, but not a crash of the machine.
"""

import os
import pwd
import shutil
import signal
import subprocess
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext, suppress
from importlib.util import find_spec
from pathlib import Path
from typing import Any
from uuid import uuid4

import pytest
from sqlalchemy import Engine, create_engine, text
from sqlalchemy.exc import OperationalError

from islands_service.store.tables import metadata
from support.processes import descendants

#: Environment variable with a database whose user may create others: ``postgresql+psycopg://user:password@host/database``.
VARIABLE = "ISLANDS_TEST_POSTGRES"

#: Reason for skipping a test without PostgreSQL.
NO_POSTGRES = (
    "no PostgreSQL: install it (Debian: apt install postgresql) and psycopg (the extra 'cluster'), "
    f"or name in {VARIABLE} a database whose user may create others"
)

#: Accounts that run the server if the tests run as root, which PostgreSQL does not allow.
ACCOUNTS = ("postgres", "nobody")

#: Time limit in seconds for the start and the stop of a server.
TIMEOUT = 30.0

_INITDB = ("--no-sync", "--no-locale", "--encoding=UTF8", "--auth=trust", "--username=islands")

_SETTINGS = {"listen_addresses": "", "fsync": "off", "full_page_writes": "off", "max_connections": 200}


class Server:
    """Temporary PostgreSQL server.

    Parameters
    ----------
    binaries : Path
        Folder of ``initdb`` and ``postgres``.
    settings : str
        Settings of the server in addition to the defaults.
    """

    def __init__(self, binaries: Path, **settings: str) -> None:
        self._binaries = binaries
        self._settings = _SETTINGS | settings
        # The folder of pytest may only be readable by root, and the path of a socket has to be short.
        self.folder = Path(tempfile.mkdtemp(prefix="islands-pg-"))
        self._process: subprocess.Popen[bytes] | None = None
        self._rights: dict[str, Any] = {"cwd": self.folder}
        if os.getuid() == 0:
            account = next(each for each in pwd.getpwall() if each.pw_name in ACCOUNTS)
            os.chown(self.folder, account.pw_uid, account.pw_gid)
            self._rights |= {"user": account.pw_uid, "group": account.pw_gid, "extra_groups": []}
        command = [binaries / "initdb", "-D", self.folder / "data", *_INITDB]
        done = subprocess.run(command, capture_output=True, text=True, check=False, **self._rights)
        assert done.returncode == 0, done.stderr

    @property
    def url(self) -> str:
        """URL of the initial database."""
        return f"postgresql+psycopg://islands@/postgres?host={self.folder}"

    @property
    def socket(self) -> Path:
        """Unix socket that the server listens on."""
        return self.folder / ".s.PGSQL.5432"

    @contextmanager
    def frozen(self) -> Iterator[None]:
        """Suspend all processes of the server while the block runs."""
        assert self._process is not None
        os.kill(self._process.pid, signal.SIGSTOP)  # first, so that no further process starts
        processes = [self._process.pid, *descendants(self._process.pid)]
        try:
            _send(signal.SIGSTOP, processes)
            yield
        finally:
            _send(signal.SIGCONT, processes)

    def start(self) -> None:
        settings = self._settings | {"unix_socket_directories": self.folder}
        options = [word for name, value in settings.items() for word in ("-c", f"{name}={value}")]
        # The server ends with this process, also if this process is killed.
        wrapper = [setpriv, "--pdeathsig", "INT"] if (setpriv := shutil.which("setpriv")) else []
        command = [*wrapper, self._binaries / "postgres", "-D", self.folder / "data", *options]
        log = self.folder / "log"
        with log.open("ab") as stream:
            self._process = subprocess.Popen(command, stdout=stream, stderr=stream, **self._rights)
        deadline = time.monotonic() + TIMEOUT
        while not is_available(self.url):
            assert self._process.poll() is None, log.read_text()
            assert time.monotonic() < deadline, log.read_text()
            time.sleep(0.02)

    def stop(self, how: signal.Signals = signal.SIGINT) -> None:
        """Stop the server: SIGINT shuts it down, SIGQUIT simulates a crash."""
        assert self._process is not None
        self._process.send_signal(how)
        self._process.wait(TIMEOUT)
        self._process = None

    def remove(self) -> None:
        if self._process is not None:
            self.stop()
        shutil.rmtree(self.folder)


def _send(number: signal.Signals, processes: list[int]) -> None:
    for pid in processes:
        with suppress(ProcessLookupError):
            os.kill(pid, number)


def is_available(url: str) -> bool:
    """Return whether a database accepts connections."""
    engine = create_engine(url)
    try:
        with engine.connect():
            return True
    except OperationalError:
        return False
    finally:
        engine.dispose()


@contextmanager
def server(**settings: str) -> Iterator[Server]:
    """Start a temporary PostgreSQL server; skip the test if PostgreSQL is not installed."""
    binaries = _find_binaries()
    if binaries is None or find_spec("psycopg") is None:
        pytest.skip(NO_POSTGRES)
    made = Server(binaries, **settings)
    try:
        made.start()
        yield made
    finally:
        made.remove()


@contextmanager
def databases() -> Iterator[Engine]:
    """Yield an engine that can create databases: of the given server, or of a temporary one."""
    named = os.environ.get(VARIABLE)
    with nullcontext(named) if named else _temporary_server() as url:
        engine = create_engine(url, isolation_level="AUTOCOMMIT")
        try:
            yield engine
        finally:
            engine.dispose()


@contextmanager
def database(maker: Engine) -> Iterator[str]:
    """Create a database and drop it at the end."""
    name = f"islands_{uuid4().hex}"
    with maker.connect() as connection:
        connection.execute(text(f"CREATE DATABASE {name}"))
    try:
        yield maker.url.set(database=name).render_as_string(hide_password=False)
    finally:
        with maker.connect() as connection:
            connection.execute(text(f"DROP DATABASE {name} WITH (FORCE)"))


def emptied(url: str) -> str:
    """Empty the tables of a database and close connections that an earlier test has left open."""
    engine = create_engine(url, isolation_level="AUTOCOMMIT")
    with engine.connect() as connection:
        connection.execute(
            text(
                "SELECT pg_terminate_backend(pid) FROM pg_stat_activity "
                "WHERE datname = current_database() AND pid <> pg_backend_pid()"
            )
        )
        connection.execute(text("TRUNCATE " + ", ".join(table.name for table in metadata.tables.values())))
    engine.dispose()
    return url


@contextmanager
def _temporary_server() -> Iterator[str]:
    with server() as started:
        yield started.url


def _find_binaries() -> Path | None:
    """Return the folder of PostgreSQL: on the path, or the newest one that Debian has installed."""
    found = [Path(path)] if (path := shutil.which("postgres")) else []
    debian = sorted(Path("/usr/lib/postgresql").glob("*/bin/postgres"), key=lambda each: int(each.parts[4]))
    places = [each.resolve().parent for each in (*found, *reversed(debian))]
    return next((place for place in places if (place / "initdb").exists()), None)
