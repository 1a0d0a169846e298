"""Fixtures and settings of all tests: the hypothesis profile, compiled kernels, databases."""

import gc
import os
import shutil
import signal
from contextlib import ExitStack

# Before NumPy is imported: the workers have the cores, and threads of its linear algebra would wait for them.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import pytest
from hypothesis import HealthCheck, settings

pytest_plugins = ["support.cost_report"]

# A kernel compiles in its first example, and the machine may be busy: neither is a failure of a property.
_LENIENT = settings(deadline=None, suppress_health_check=[HealthCheck.too_slow])
# The fast examples depend on the test alone, so that a commit passes or fails; each night tries new ones.
settings.register_profile("fast", _LENIENT, max_examples=15, derandomize=True)
settings.register_profile("thorough", _LENIENT, max_examples=400)
settings.load_profile("fast")


#: Databases of the store tests. PostgreSQL needs a server, so its tests belong to the level ci.
DATABASES = ("sqlite", pytest.param("postgresql", marks=pytest.mark.ci))


@pytest.fixture
def toy_class(monkeypatch):
    """Add the toy class of models to the table."""
    from support.gain_scheduled import add_class

    add_class(monkeypatch)


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    """Mark the tests that start PostgreSQL as ci."""
    for item in items:
        if "postgres" in item.fixturenames and not item.get_closest_marker("nightly"):
            item.add_marker("ci")


def pytest_configure(config):
    # As Ctrl-C. By default SIGTERM ends no fixture: services and databases of the tests would run on.
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    # Before the workers start: each of them would compile all kernels for itself.
    if not hasattr(config, "workerinput"):
        from islands.facade.warm_up import warm_up
        from islands.kernels.jit_cache import is_current, read_manifest

        warm_up()
        archive = read_manifest()
        is_archived = archive is not None and all(map(is_current, archive.imports))
        if config.getoption("numprocesses", None) and not is_archived:
            from support.kernels import compile_further_kernels

            compile_further_kernels()


@pytest.hookimpl(wrapper=True)
def pytest_collection():
    """Collect without garbage collection, which would visit all tests for a fifth of a second."""
    from islands.processes import freeze_garbage_collector

    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()  # a collection does not visit what is frozen
        freeze_garbage_collector()
        gc.enable()


@pytest.fixture(scope="session")
def postgres():
    """Return a function that creates databases on the PostgreSQL server of this process."""
    from support.databases import databases

    with databases() as maker:
        yield maker


@pytest.fixture(scope="session")
def prepared_postgres(postgres):
    """Return the URL of a database with the tables of the store. Tests share it, since it takes 0.25 s."""
    from islands_service.store import Store
    from support.databases import database

    with database(postgres) as url:
        Store(url).close()
        yield url


@pytest.fixture(scope="session")
def prepared_sqlite(tmp_path_factory):
    """A file with our tables, to be copied."""
    from islands_service.store import Store

    path = tmp_path_factory.mktemp("store") / "prepared.db"
    Store(f"sqlite:///{path}").close()
    return path


@pytest.fixture(scope="session")
def serve(prepared_sqlite, tmp_path_factory):
    """Return a function that starts a service on a prepared database, by default in a new folder."""
    from support.service import served

    def serve(folder=None, /, **changes):
        folder = folder or tmp_path_factory.mktemp("service")
        shutil.copyfile(prepared_sqlite, folder / "islands.db")
        return served(folder, **changes)

    return serve


@pytest.fixture(scope="session")
def ray_address(tmp_path_factory):
    """The address of one Ray for all tests of a process. A test may kill actors there, but not Ray itself."""
    from support.ray_head import ray_head

    with ray_head(tmp_path_factory.mktemp("ray")) as address:
        yield address


def _sqlite(request):
    return f"sqlite:///{request.getfixturevalue('tmp_path') / 'islands.db'}"


def _prepared_sqlite(request):
    path = request.getfixturevalue("tmp_path") / "islands.db"
    shutil.copyfile(request.getfixturevalue("prepared_sqlite"), path)
    return f"sqlite:///{path}"


def _postgresql(request):
    from support.databases import database

    stack = ExitStack()
    request.addfinalizer(stack.close)
    return stack.enter_context(database(request.getfixturevalue("postgres")))


def _prepared_postgresql(request):
    from support.databases import emptied

    return emptied(request.getfixturevalue("prepared_postgres"))


@pytest.fixture
def sqlite_database(request):
    """The URL of an SQLite file with our tables and nothing in them."""
    return _prepared_sqlite(request)


@pytest.fixture
def small_disk(tmp_path):
    """Return a function that mounts a disk of a given size. The test skips if it cannot mount one."""
    from support.disks import mounted

    with ExitStack() as stack:
        yield lambda size, **options: stack.enter_context(mounted(tmp_path / "disk", size, **options))


@pytest.fixture(params=DATABASES)
def database(request):
    """The URL of a database with our tables and nothing in them: every law holds on both kinds."""
    return {"sqlite": _prepared_sqlite, "postgresql": _prepared_postgresql}[request.param](request)


@pytest.fixture(params=DATABASES)
def empty_database(request):
    """The URL of a new database, without tables."""
    return {"sqlite": _sqlite, "postgresql": _postgresql}[request.param](request)


@pytest.fixture
def store(database):
    """A store on a new database."""
    from islands_service.store import Store

    with Store(database) as opened:
        yield opened
