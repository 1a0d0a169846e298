"""Compiled kernels are kept in one folder, found again, and compiled by one process at a time.

Each test starts processes with a small module of kernels. They import a copy of the file under test, since
the whole package takes a second to import. Most are forks of one process that has loaded Numba.
"""

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import pytest

import islands
from support.forks import Fork, fork_server

Start = Callable[..., "subprocess.Popen[str] | Fork"]

SOURCE = Path(islands.__file__).parent / "kernels" / "jit_cache.py"

KERNELS = """
import numba
from islands.kernels.jit_cache import cache_folder, kernel

set_before = numba.config.CACHE_DIR


@kernel(inline="always")
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

#: Makes itself ready, then uses a kernel. While it compiles it waits for the files that it is given.
READY = """
import json, sys, time
from pathlib import Path
from islands.kernels.jit_cache import cache_folder, ready
from toys import hits, misses, ratio

awaited = sys.argv[1:]
told = []


def tell(line):
    told.append(line)
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
    "compiled": compiled, "value": value, "hits": hits(ratio), "misses": misses(ratio), "told": told,
    "folder": folder and str(folder), "locked": "filelock" in sys.modules,
}))
"""

#: Says where its kernels are kept.
FOLDER = "import json; from toys import cache_folder; print(json.dumps(str(cache_folder())))"


@pytest.fixture(scope="module")
def forks() -> Iterator[Callable[..., Fork]]:
    with fork_server() as fork:
        yield fork


@pytest.fixture
def sources(tmp_path: Path) -> None:
    """Put the file under test and a module of kernels into the test's folder."""
    package = tmp_path / "islands" / "kernels"
    package.mkdir(parents=True)
    (package.parent / "__init__.py").touch()
    (package / "jit_cache.py").write_bytes(SOURCE.read_bytes())
    (tmp_path / "toys.py").write_text(KERNELS)


@contextmanager
def starting(folder: Path, begin: Callable[..., "subprocess.Popen[str] | Fork"]) -> Iterator[Start]:
    """Give what starts a process in a folder; those still running at the end are killed."""
    running = []

    def start(code: str, *arguments: str, **variables: str) -> "subprocess.Popen[str] | Fork":
        environment = {name: text for name, text in os.environ.items() if not name.startswith("NUMBA_")}
        environment |= {"PYTHONPATH": str(folder), "ISLANDS_CACHE_DIR": str(folder / "cache")} | variables
        running.append(begin(code, arguments, environment, folder))
        return running[-1]

    yield start
    for process in running:
        process.kill()
        process.communicate()


def anew(code: str, arguments: Sequence[str], variables: dict[str, str], folder: Path):
    command, pipe = [sys.executable, "-W", "error", "-c", code, *arguments], subprocess.PIPE
    return subprocess.Popen(command, cwd=folder, env=variables, stdout=pipe, stderr=pipe, text=True)


@pytest.fixture
def start(tmp_path: Path, sources: None, forks: Callable[..., Fork]) -> Iterator[Start]:
    """Start a process in the test's folder, a fork of one that has loaded Numba."""
    with starting(tmp_path, forks) as start:
        yield start


@pytest.fixture
def start_anew(tmp_path: Path, sources: None) -> Iterator[Start]:
    """Start a process in the test's folder that loads everything itself."""
    with starting(tmp_path, anew) as start:
        yield start


def said(process):
    """What a process printed, as JSON; it must have ended well and without a word of complaint."""
    out, complaint = process.communicate(timeout=120)
    assert process.returncode == 0, complaint
    assert not complaint
    return json.loads(out)


def appears(path: Path, process) -> None:
    """Wait for a file that a process will write."""
    while not path.exists():
        assert process.poll() is None, process.communicate()
        time.sleep(0.005)


def kept(folder: Path) -> set[str]:
    return {path.name.split("-")[0] for path in folder.rglob("*.nbc")}


def test_kernels_are_kept_in_the_chosen_folder_and_nowhere_else(start, tmp_path):
    found = said(start(READY))
    folder = Path(found["folder"])
    assert folder.parent == tmp_path / "cache" / "kernels"
    assert kept(folder) == kept(tmp_path) == {"toys.ratio"}  # what is inlined is compiled in its caller
    assert [path.parent.parent for path in tmp_path.rglob("*.nbi")] == [folder]


@pytest.mark.parametrize("kind", ["start", pytest.param("start_anew", marks=pytest.mark.ci)])
def test_a_second_process_loads_what_the_first_compiled_and_says_nothing(request, kind):
    start = request.getfixturevalue(kind)
    first = said(start(READY))
    assert (first["compiled"], first["hits"], first["misses"]) == (True, 0, 1)
    assert "once" in first["told"][0]
    second = said(start(READY, "never"))
    assert (second["compiled"], second["hits"], second["misses"]) == (False, 1, 0)
    assert second["told"] == []
    assert not second["locked"]  # a warm start does not even load the library of locks
    assert first["value"] == second["value"] == 1.5


def test_a_kernel_divides_by_zero_without_an_exception_and_frees_the_interpreters_lock(start):
    code = """if True:
        import json, toys
        print(json.dumps([toys.ratio(1.0, 0.0) == float("inf"), toys.ratio.targetoptions["nogil"]]))
    """
    assert said(start(code)) == [True, True]


def test_without_a_choice_kernels_are_kept_in_the_users_cache_folder(start, tmp_path):
    home = {"HOME": str(tmp_path), "XDG_CACHE_HOME": str(tmp_path / "own"), "ISLANDS_CACHE_DIR": ""}
    code = "import json, platformdirs; print(json.dumps(platformdirs.user_cache_dir('islands', False)))"
    expected = Path(said(start(code, **home)))
    assert Path(said(start(READY, **home))["folder"]).parent == expected / "kernels"
    assert expected.is_relative_to(tmp_path)


@pytest.mark.ci
def test_each_processor_has_a_folder_of_its_own_named_after_it(start, start_anew):
    here, haswell = said(start(READY)), said(start_anew(READY, NUMBA_CPU_NAME="haswell"))
    assert here["compiled"]
    assert haswell["compiled"]
    assert here["folder"] != haswell["folder"]
    assert "-haswell-" in haswell["folder"]


def test_processors_of_one_name_and_other_features_do_not_share_a_folder(start):
    plain = said(start(FOLDER, NUMBA_CPU_NAME="haswell"))
    wider = said(start(FOLDER, NUMBA_CPU_NAME="haswell", NUMBA_CPU_FEATURES="+avx2"))
    assert plain != wider


def test_a_change_in_any_source_of_the_kernels_gives_another_folder(start, tmp_path):
    package = tmp_path / "islands" / "kernels"
    folders = []
    for text in ("X = 1\n", "X = 2\n", "X = 1\n"):
        (package / "inlined.py").write_text(text)
        folders.append(said(start(FOLDER)))
    assert folders[0] == folders[2] != folders[1]
    # The same sources in another place: Numba would not find there what it keeps for this place.
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    for name in ("islands", "toys.py"):
        (tmp_path / name).rename(elsewhere / name)
    assert said(start(FOLDER, PYTHONPATH=str(elsewhere))) not in folders


@pytest.mark.parametrize("users", ["", "theirs"])
def test_other_peoples_functions_are_kept_where_they_say(start, tmp_path, users):
    chosen = str(tmp_path / users) if users else ""
    (tmp_path / "other.py").write_text("import numba\n@numba.njit(cache=True)\ndef other(x):\n    return x\n")
    code = """if True:
        import json, numba, toys
        from other import other
        other(1.0), toys.ratio(1.0, 2.0)
        settings = [toys.set_before, numba.config.CACHE_DIR]
        print(json.dumps([*settings, other.stats.cache_path, str(toys.cache_folder())]))
    """
    before, after, theirs, ours = said(start(code, **({"NUMBA_CACHE_DIR": chosen} if users else {})))
    assert before == after == chosen
    assert Path(theirs).is_relative_to(chosen or tmp_path / "__pycache__")
    assert kept(Path(theirs)) == {"other.other"}
    assert kept(Path(ours)) == {"toys.ratio"}
    assert Path(ours).is_relative_to(tmp_path / "cache")


def test_functions_of_a_factory_are_told_apart_by_the_number_they_enclose(start):
    code = """if True:
        import json, toys
        adders = [toys.adder(amount) for amount in range(3)]
        print(json.dumps([[add(10.0) for add in adders], [toys.hits(add) for add in adders]]))
    """
    assert said(start(code)) == [[10.0, 11.0, 12.0], [0, 0, 0]]
    assert said(start(code)) == [[10.0, 11.0, 12.0], [1, 1, 1]]


def test_processes_that_save_at_once_lose_and_mix_nothing(start, tmp_path):
    # Each process takes its time between reading the index and writing it, as a busy machine might.
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
        said(process)
    load = """if True:
        import json
        from toys import adder, hits
        one, two = adder(1), adder(2)
        print(json.dumps([one(10.0), two(10.0), hits(one), hits(two)]))
    """
    assert said(start(load)) == [11.0, 12.0, 1, 1]


def test_of_two_cold_processes_one_compiles_and_the_other_waits_and_loads(start, tmp_path):
    # Whoever compiles goes on only when the other one has said that it waits.
    both = [start(READY, "waiting"), start(READY, "waiting")]
    found = sorted(map(said, both), key=lambda it: it["compiled"])
    assert [each["compiled"] for each in found] == [False, True]
    waited, compiled = found
    assert ["waiting" in line for line in waited["told"]] == [True]
    assert ["compiling" in line for line in compiled["told"]] == [True]
    assert (waited["hits"], compiled["hits"]) == (1, 0)
    assert waited["value"] == compiled["value"] == 1.5


def test_a_killed_process_frees_the_lock_and_leaves_no_stamp(start, tmp_path):
    killed = start(READY, "never")
    appears(tmp_path / "compiling", killed)
    heir = start(READY)
    appears(tmp_path / "waiting", heir)
    killed.kill()
    found = said(heir)
    assert killed.wait() != 0
    assert found["compiled"]
    assert len(found["told"]) == 2
    assert said(start(READY, "never"))["compiled"] is False


def test_a_failure_while_compiling_is_raised_and_leaves_no_stamp(start):
    code = "from islands.kernels.jit_cache import ready; ready(lambda: 1 / 0, print)"
    failed = start(code)
    assert "ZeroDivisionError" in failed.communicate(timeout=120)[1]
    assert said(start(READY))["compiled"]


def test_a_folder_that_cannot_be_made_leaves_kernels_in_memory(start, tmp_path):
    (tmp_path / "cache").write_text("a file, not a folder")
    for _ in range(2):
        found = said(start(READY))
        assert found["folder"] is None
        assert (found["compiled"], found["value"], found["hits"]) == (True, 1.5, 0)
        assert "ISLANDS_CACHE_DIR" in found["told"][0]
    assert not kept(tmp_path)


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may write everywhere")
def test_a_read_only_folder_leaves_kernels_in_memory(start, tmp_path):
    (tmp_path / "cache").mkdir(mode=0o500)
    found = said(start(READY))
    assert found["folder"] is None
    assert (found["compiled"], found["value"]) == (True, 1.5)


@pytest.mark.skipif(sys.platform == "win32", reason="has no limit to the size of files")
@pytest.mark.parametrize("full", ["at first", "later"])
def test_a_full_disk_leaves_kernels_in_memory(start, full):
    # No file may grow beyond nothing: what a full disk or a used-up quota does, in one process.
    code = """if True:
        import json, resource, sys
        fill = lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))
        if sys.argv[1] == "at first":
            fill()
        import toys
        from islands.kernels.jit_cache import ready
        fill()
        compiled = ready(lambda: toys.ratio(3.0, 2.0), lambda line: None)
        folder = toys.cache_folder()
        print(json.dumps([compiled, folder is None, folder is not None and (folder / "complete").exists()]))
    """
    assert said(start(code, full)) == [True, full == "at first", False]
    assert said(start(READY))["compiled"]


def test_a_kernel_that_cannot_be_saved_is_used_all_the_same(start, tmp_path):
    code = """if True:
        import json, shutil, toys
        shutil.rmtree(toys.cache_folder())
        toys.cache_folder().write_text("in the way")
        print(json.dumps(toys.ratio(3.0, 2.0)))
    """
    assert said(start(code)) == 1.5


@pytest.mark.ci
@pytest.mark.parametrize("moment", ["before", "while", "after"])
def test_the_folder_may_be_deleted_at_any_time(start, moment):
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
    # A stamp holds for all kernels: it is not set when some of them were deleted.
    assert said(start(code, moment)) == [True, 3.0, moment == "before"]
    assert said(start(code, "never"))[0] is (moment != "before")
    assert said(start(code, "never")) == [False, 3.0, True]
