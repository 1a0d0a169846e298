"""Where compiled kernels are kept, and how they get there before a search starts.

Numba compiles a kernel when it is first called, which takes seconds, and can keep the machine code in files.
They lie in the user's cache folder and not beside the sources, because an installed package is often
read-only. The folder is ``<user's cache>/islands/kernels/<islands>-<numba>-<processor>-<hash>``; all of it
may be deleted at any time.

The environment variable ``ISLANDS_CACHE_DIR`` takes the place of ``<user's cache>/islands``. This is an
exception to the rule that the core knows no environment: kernels are made while modules are imported, so
there is no call that a setting could come in by, and no result depends on it. It is read once, when the first
kernel is made. Numba's own ``NUMBA_CACHE_DIR`` keeps its meaning for everybody else's functions; kernels do
not follow it.
"""

import os
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache, partial
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numba
from llvmlite.binding import get_host_cpu_name
from numba.core import config
from numba.core.caching import FunctionCache
from numba.core.codegen import get_host_cpu_features
from platformdirs import user_cache_path

#: Its presence in the folder says that every kernel has been compiled into it.
STAMP = "complete"

#: Folders of the package that hold compiled functions.
COMPILED = ("kernels", "systems")


def kernel(function: Callable[..., Any] | None = None, **options: Any) -> Any:
    """Compile a function as a kernel: without the interpreter's lock, and 1/0 is inf, not an exception.

    Use it bare, ``@kernel``, or with more of Numba's options, ``@kernel(forceinline=True)``.

    Functions of one factory are told apart in the cache by the numbers that they enclose. They may not
    enclose a kernel: it looks different in every process, and nothing would be found again.
    """
    if function is None:
        return partial(kernel, **options)
    dispatcher = numba.njit(nogil=True, error_model="numpy", **options)(function)
    folder = cache_folder()
    if folder is not None:
        with _numba_caches_in(folder):
            dispatcher._cache = _Cache(function)
    return dispatcher


@cache
def cache_folder() -> Path | None:
    """Return the folder of the compiled kernels, or None: it cannot be written, every start compiles anew."""
    try:
        chosen = os.environ.get("ISLANDS_CACHE_DIR")
        base = Path(chosen).expanduser().absolute() if chosen else user_cache_path("islands", appauthor=False)
        folder = base / "kernels" / _key()
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder) as probe:
            probe.write(bytes(4096))  # on a full disk an empty file can still be made
    except (OSError, RuntimeError):  # RuntimeError: this user has no home
        return None
    return folder


def ready(compile_all: Callable[[], None], tell: Callable[[str], None]) -> bool:
    """Make sure that all kernels are compiled, by one process if several start at once.

    Parameters
    ----------
    compile_all : callable
        Calls every kernel once with each combination of types that is used.
    tell : callable
        Takes a line for the user before anything that takes long.

    Returns
    -------
    bool
        Whether this process compiled. If not, it loads each kernel from the folder at its first call.
    """
    folder = cache_folder()
    if folder is None:
        tell(
            "compiling the kernels for this processor, as at every start: they cannot be kept;"
            " set ISLANDS_CACHE_DIR to a folder that can be written"
        )
        compile_all()
        return True
    if (folder / STAMP).exists():
        return False
    with _lock(folder / "compiling.lock", lambda: tell("waiting for another process to compile the kernels")):
        if (folder / STAMP).exists():
            return False
        tell(f"compiling the kernels for this processor, once: they are kept in {folder}")
        compile_all()
        _stamp(folder)
    return True


class _Cache(FunctionCache):
    """Numba's cache of one function, safe against other processes and against a folder that goes away.

    A kernel that cannot be loaded or saved (deleted folder, full disk) is compiled and serves this process.
    """

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        with suppress(OSError):
            return super().load_overload(sig, target_context)
        return None

    def save_overload(self, sig: Any, data: Any) -> None:
        # Numba reads the function's index, picks a free file name and writes both. Two processes that do so
        # at once can pick one name for two signatures, and the next one to load gets the wrong code.
        with suppress(OSError), _lock(Path(self.cache_path).parent / "saving.lock"):
            super().save_overload(sig, data)


@contextmanager
def _numba_caches_in(folder: Path) -> Iterator[None]:
    """Let the caches made meanwhile lie in a folder: Numba asks its setting once, when it makes one."""
    before = config.CACHE_DIR
    config.CACHE_DIR = str(folder)
    try:
        yield
    finally:
        config.CACHE_DIR = before


@contextmanager
def _lock(path: Path, when_taken: Callable[[], None] | None = None) -> Iterator[None]:
    """Hold a lock that the operating system frees when the process dies."""
    from filelock import FileLock, Timeout  # noqa: PLC0415 - takes 20 ms, and only whoever compiles needs it

    lock = FileLock(path)  # makes the folder if it is gone
    try:
        lock.acquire(blocking=False)
    except Timeout:
        if when_taken is not None:
            when_taken()
        lock.acquire()
    try:
        yield
    finally:
        lock.release()


def _stamp(folder: Path) -> None:
    with suppress(OSError):  # without a stamp the next start looks again
        # Whoever deleted the folder meanwhile deleted the lock file and the first kernels with it.
        if (folder / "compiling.lock").exists():
            draft = folder / f"{STAMP}.part"
            draft.write_text("All kernels are compiled. This folder may be deleted.\n", encoding="utf-8")
            draft.replace(folder / STAMP)


def _key() -> str:
    processor = get_host_cpu_name() if config.CPU_NAME is None else config.CPU_NAME
    return f"{version('islands')}-{numba.__version__}-{processor}-{_hash(processor)}"


def _hash(processor: str) -> str:
    """Hash what the names do not say, so that a stamp holds for the very kernels that its reader will load.

    Numba looks at a function's own file alone and misses a change in what it inlines from another one. It
    does tell apart the Python, the processor's features and the place of the sources.
    """
    features = get_host_cpu_features() if config.CPU_FEATURES is None else config.CPU_FEATURES
    hashed = sha256(repr((sys.implementation.cache_tag, processor, features)).encode())
    package = Path(__file__).parents[1]
    for source in sorted(source for folder in COMPILED for source in (package / folder).glob("*.py")):
        hashed.update(repr((str(source), source.read_bytes())).encode())
    return hashed.hexdigest()[:12]
