"""Databases for tests: SQLite files, and databases on a PostgreSQL server of our own where one is installed.

The server stands in a folder of its own under the system's temporary folder, listens on a socket there and
nowhere else, and is ended by its process id. It does not wait for the disk: what it has acknowledged outlives
its own death, not the machine's.
"""

import os
import pwd
import shutil
import signal
import subprocess
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from importlib.util import find_spec
from pathlib import Path
from typing import Any
from uuid import uuid4

import pytest
from sqlalchemy import Engine, create_engine, text
from sqlalchemy.exc import OperationalError

from islands_service.store.tables import metadata

#: A database whose user may make others: ``postgresql+psycopg://user:password@host/database``.
VARIABLE = "ISLANDS_TEST_POSTGRES"

NONE = (
    "no PostgreSQL: install it (Debian: apt install postgresql) and psycopg (the extra 'cluster'), "
    f"or name in {VARIABLE} a database whose user may make others"
)

#: Root may not run a PostgreSQL: one of these does it.
ACCOUNTS = ("postgres", "nobody")

#: Seconds after which a server that does not answer never will.
PATIENCE = 30.0

_INITDB = ("--no-sync", "--no-locale", "--encoding=UTF8", "--auth=trust", "--username=islands")

_SETTINGS = {"listen_addresses": "", "fsync": "off", "full_page_writes": "off", "max_connections": 200}


class Server:
    """A PostgreSQL of our own.

    Parameters
    ----------
    binaries : Path
        Where ``initdb`` and ``postgres`` are.
    settings : str
        Of the server, besides those of every one.
    """

    def __init__(self, binaries: Path, **settings: str) -> None:
        self._binaries = binaries
        self._settings = _SETTINGS | settings
        # Not in pytest's own folder: nobody but root may enter that one. And a socket's path has to be short.
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
        """The database that is there from the start."""
        return f"postgresql+psycopg://islands@/postgres?host={self.folder}"

    def start(self) -> None:
        settings = self._settings | {"unix_socket_directories": self.folder}
        options = [word for name, value in settings.items() for word in ("-c", f"{name}={value}")]
        # Should this process be killed, its server ends too.
        mortal = [setpriv, "--pdeathsig", "INT"] if (setpriv := shutil.which("setpriv")) else []
        command = [*mortal, self._binaries / "postgres", "-D", self.folder / "data", *options]
        log = self.folder / "log"
        with log.open("ab") as stream:
            self._process = subprocess.Popen(command, stdout=stream, stderr=stream, **self._rights)
        deadline = time.monotonic() + PATIENCE
        while not answers(self.url):
            assert self._process.poll() is None, log.read_text()
            assert time.monotonic() < deadline, log.read_text()
            time.sleep(0.02)

    def stop(self, how: signal.Signals = signal.SIGINT) -> None:
        """End the server: SIGINT in good order, SIGQUIT as in a crash."""
        assert self._process is not None
        self._process.send_signal(how)
        self._process.wait(PATIENCE)
        self._process = None

    def remove(self) -> None:
        if self._process is not None:
            self.stop()
        shutil.rmtree(self.folder)


def answers(url: str) -> bool:
    """Tell whether a database can be connected to."""
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
    """Start a PostgreSQL of our own; where there is none the test skips."""
    binaries = _binaries()
    if binaries is None or find_spec("psycopg") is None:
        pytest.skip(NONE)
    made = Server(binaries, **settings)
    try:
        made.start()
        yield made
    finally:
        made.remove()


@contextmanager
def databases() -> Iterator[Engine]:
    """Yield what makes databases: a connection to the one that is named, or to a server of our own."""
    named = os.environ.get(VARIABLE)
    with nullcontext(named) if named else _own() as url:
        engine = create_engine(url, isolation_level="AUTOCOMMIT")
        try:
            yield engine
        finally:
            engine.dispose()


@contextmanager
def database(maker: Engine) -> Iterator[str]:
    """Make a database, and drop it in the end."""
    name = f"islands_{uuid4().hex}"
    with maker.connect() as connection:
        connection.execute(text(f"CREATE DATABASE {name}"))
    try:
        yield maker.url.set(database=name).render_as_string(hide_password=False)
    finally:
        with maker.connect() as connection:
            connection.execute(text(f"DROP DATABASE {name} WITH (FORCE)"))


def emptied(url: str) -> str:
    """Empty a database that has our tables, and end whatever a test before has left connected to it."""
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
def _own() -> Iterator[str]:
    with server() as own:
        yield own.url


def _binaries() -> Path | None:
    """Return where PostgreSQL is: on the path, or where Debian puts it, the newest."""
    found = [Path(path)] if (path := shutil.which("postgres")) else []
    debian = sorted(Path("/usr/lib/postgresql").glob("*/bin/postgres"), key=lambda each: int(each.parts[4]))
    places = [each.resolve().parent for each in (*found, *reversed(debian))]
    return next((place for place in places if (place / "initdb").exists()), None)
