"""Compiled kernels are stored in one folder, loaded again, and compiled by one process at a time.

Each test starts processes with a small module of kernels. They import a copy of the files under test, since
the whole package takes a second to import. Most are forks of one process that has loaded Numba.
"""

import os
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

import islands
from support.forks import Fork, fork_server
from support.kernel_processes import Start, get_output, process_starter, start_interpreter, wait_for_file

pytestmark = pytest.mark.ci

SOURCES = Path(islands.__file__).parent

KERNELS = """
import numba
from islands.kernels.jit_cache import cache_folder, kernel

set_before = numba.config.CACHE_DIR


@kernel
def half(x):
    return x / 2.0


@kernel
def ratio(x, y):
    return half(x) / half(y)


def adder(amount):
    @kernel
    def add(x):
        return x + amount

    return add


def hits(dispatcher):
    return sum(dispatcher.stats.cache_hits.values())


def misses(dispatcher):
    return sum(dispatcher.stats.cache_misses.values())
"""

#: Script that calls `ready` and uses a kernel. While it compiles, it waits for the files in its arguments.
READY = """
import json, sys, time
from pathlib import Path
from islands.kernels.jit_cache import cache_folder, ready
from toys import hits, misses, ratio

awaited = sys.argv[1:]
messages = []


def tell(line):
    messages.append(line)
    if "waiting" in line:
        Path("waiting").touch()


def compile_all():
    Path("compiling").touch()
    while not all(Path(each).exists() for each in awaited):
        time.sleep(0.01)
    ratio(3.0, 2.0)


compiled = ready(compile_all, tell)
value = ratio(3.0, 2.0)
folder = cache_folder()
print(json.dumps({
    "compiled": compiled, "value": value, "hits": hits(ratio), "misses": misses(ratio), "messages": messages,
    "folder": folder and str(folder), "locked": "filelock" in sys.modules,
}))
"""

#: Script that prints its cache folder.
FOLDER = "import json; from toys import cache_folder; print(json.dumps(str(cache_folder())))"


@pytest.fixture(scope="module")
def forks() -> Iterator[Callable[..., Fork]]:
    with fork_server() as fork:
        yield fork


@pytest.fixture
def sources(tmp_path: Path) -> None:
    """Copy the files under test, their imports, and a module of kernels to the folder of the test."""
    package = tmp_path / "islands"
    (package / "kernels").mkdir(parents=True)
    (package / "__init__.py").touch()
    for name in ("distribution.py", "kernels/callee.py", "kernels/jit_cache.py"):
        (package / name).write_bytes((SOURCES / name).read_bytes())
    (tmp_path / "toys.py").write_text(KERNELS)


@pytest.fixture
def start(tmp_path: Path, sources: None, forks: Callable[..., Fork]) -> Iterator[Start]:
    """Yield a function that starts a fork of a process that has loaded Numba."""
    with process_starter(tmp_path, forks) as start:
        yield start


@pytest.fixture
def start_new(tmp_path: Path, sources: None) -> Iterator[Start]:
    """Yield a function that starts a new interpreter."""
    with process_starter(tmp_path, start_interpreter) as start:
        yield start


def stored_kernels(folder: Path) -> set[str]:
    return {path.name.split("-")[0] for path in folder.rglob("*.nbc")}


@pytest.mark.parametrize("kind", ["start", "start_new"])
def test_second_process_loads_the_kernels_of_the_first_silently(request, kind):
    start = request.getfixturevalue(kind)
    first = get_output(start(READY))
    assert (first["compiled"], first["hits"], first["misses"]) == (True, 0, 1)
    assert "once" in first["messages"][0]
    second = get_output(start(READY, "never"))
    assert (second["compiled"], second["hits"], second["misses"]) == (False, 1, 0)
    assert second["messages"] == []
    assert not second["locked"]  # a warm start does not import filelock
    assert first["value"] == second["value"] == 1.5


def test_processors_with_different_features_do_not_share_a_folder(start):
    plain = get_output(start(FOLDER, NUMBA_CPU_NAME="haswell"))
    wider = get_output(start(FOLDER, NUMBA_CPU_NAME="haswell", NUMBA_CPU_FEATURES="+avx2"))
    assert plain != wider


def test_change_in_any_kernel_source_gives_another_folder(start, tmp_path):
    package = tmp_path / "islands" / "kernels"
    folders = []
    for text in ("X = 1\n", "X = 2\n", "X = 1\n"):
        (package / "inlined.py").write_text(text)
        folders.append(get_output(start(FOLDER)))
    assert folders[0] == folders[2] != folders[1]


def test_checkouts_with_equal_sources_share_their_kernels(start, tmp_path):
    # The toys are a module of the package here: other kernels are stored by the path of their source.
    code = READY.replace("from toys", "from islands.kernels.toys")
    (tmp_path / "toys.py").rename(tmp_path / "islands" / "kernels" / "toys.py")
    first = get_output(start(code))
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    (tmp_path / "islands").rename(elsewhere / "islands")
    second = get_output(start(code, "never", PYTHONPATH=str(elsewhere)))
    assert (first["hits"], first["misses"]) == (0, 1)
    assert (second["compiled"], second["hits"], second["misses"]) == (False, 1, 0)
    assert second["folder"] == first["folder"]


@pytest.mark.parametrize("days", [29, 31])
def test_folder_of_another_version_is_deleted_after_a_month_without_use(start, tmp_path, days):
    old = tmp_path / "cache" / "kernels" / "0.0.1-other"
    old.mkdir(parents=True)
    (old / "complete").touch()
    used = time.time() - days * 86400
    os.utime(old, (used, used))
    get_output(start(FOLDER))
    assert old.exists()  # only a process that compiles deletes folders
    get_output(start(READY))
    assert old.exists() == (days < 30)


def test_concurrent_saves_lose_and_mix_nothing(start, tmp_path):
    # Each process pauses between reading and writing the index, as on a busy machine.
    save = """if True:
        import sys, time
        from pathlib import Path
        from numba.core.caching import IndexDataCacheFile as File
        from toys import adder
        read = File._load_index

        def read_slowly(file):
            found = read(file)
            time.sleep(0.4)
            return found

        mine, other = sys.argv[1:]
        add = adder(int(mine))
        add.py_func, Path(mine).touch()
        while not Path(other).exists():
            time.sleep(0.01)
        File._load_index = read_slowly
        add(10.0)
        print(0)
    """
    for process in (start(save, "1", "2"), start(save, "2", "1")):
        get_output(process)
    load = """if True:
        import json
        from toys import adder, hits
        one, two = adder(1), adder(2)
        print(json.dumps([one(10.0), two(10.0), hits(one), hits(two)]))
    """
    assert get_output(start(load)) == [11.0, 12.0, 1, 1]


def test_killed_process_releases_the_lock_and_leaves_no_stamp(start, tmp_path):
    killed = start(READY, "never")
    wait_for_file(tmp_path / "compiling", killed)
    heir = start(READY)
    wait_for_file(tmp_path / "waiting", heir)
    killed.kill()
    found = get_output(heir)
    assert killed.wait() != 0
    assert found["compiled"]
    assert len(found["messages"]) == 2
    assert get_output(start(READY, "never"))["compiled"] is False


def test_compilation_failure_is_raised_and_leaves_no_stamp(start):
    code = "from islands.kernels.jit_cache import ready; ready(lambda: 1 / 0, print)"
    failed = start(code)
    assert "ZeroDivisionError" in failed.communicate(timeout=120)[1]
    assert get_output(start(READY))["compiled"]


def test_kernels_stay_in_memory_if_the_folder_cannot_be_created(start, tmp_path):
    (tmp_path / "cache").write_text("a file, not a folder")
    for _ in range(2):
        found = get_output(start(READY))
        assert found["folder"] is None
        assert (found["compiled"], found["value"], found["hits"]) == (True, 1.5, 0)
        assert "ISLANDS_CACHE_DIR" in found["messages"][0]
    assert not stored_kernels(tmp_path)


@pytest.mark.skipif(sys.platform == "win32", reason="no limit of the file size")
def test_a_complete_folder_is_used_where_nothing_can_be_written(start, tmp_path):
    assert get_output(start(READY))["compiled"]
    code = "import resource; resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))\n" + READY
    found = get_output(start(code, "never"))
    assert (found["compiled"], found["hits"], found["value"]) == (False, 1, 1.5)


@pytest.mark.parametrize("moment", ["before", "while", "after"])
def test_cache_folder_may_be_deleted_at_any_time(start, moment):
    code = """if True:
        import json, shutil, sys, toys
        from islands.kernels.jit_cache import ready

        def delete(moment):
            if moment == sys.argv[1]:
                shutil.rmtree(toys.cache_folder())

        def compile_all():
            toys.adder(1)(1.0)
            delete("while")
            toys.ratio(3.0, 2.0)

        delete("before")
        compiled = ready(compile_all, lambda line: None)
        delete("after")
        print(json.dumps([compiled, toys.adder(2)(1.0), (toys.cache_folder() / "complete").exists()]))
    """
    # A stamp is valid for all kernels: it is not written if some of them were deleted.
    assert get_output(start(code, moment)) == [True, 3.0, moment == "before"]
    assert get_output(start(code, "never"))[0] is (moment != "before")
    assert get_output(start(code, "never")) == [False, 3.0, True]


def test_threads_create_their_caches_one_after_the_other(tmp_path):
    """A folder that another thread had reset was the current one: kernels were stored in it."""
    from islands.kernels import jit_cache  # Numba takes a second

    config = jit_cache.config
    before, folders = config.CACHE_DIR, [tmp_path / str(count) for count in range(8)]

    def read(folder):
        with jit_cache._numba_caches_in(folder):
            time.sleep(0.002)
            return config.CACHE_DIR

    with ThreadPoolExecutor(len(folders)) as threads:
        assert list(threads.map(read, folders)) == list(map(str, folders))
    assert before == config.CACHE_DIR
