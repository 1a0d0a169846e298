"""Machine code of the kernels: part of the package, or compiled before a search starts and stored.

Numba compiles a kernel at its first call, which takes seconds, and can store the machine code in files. The
package has those for processors with the features of `TARGET` in `ARCHIVE`, which ``make kernels`` writes.
They are used with the versions of Python and Numba that made them, as long as the module of a kernel, and all
that it imports from `COMPILED`, are what was compiled.

All other kernels are compiled on this machine. Their files are in the user's cache folder and not next to the
sources, because an installed package is often read-only. The folder is
``<user's cache>/islands/kernels/<islands>-<numba>-<processor>-<hash>``. The hash is
of the content of the sources, so all checkouts and installations with equal kernels share one folder. It may
be deleted at any time. A process that compiles the kernels deletes the folders of other versions that were
not used for `UNUSED_DAYS`.

The environment variable ``ISLANDS_CACHE_DIR`` replaces ``<user's cache>/islands``. This is an exception to
the rule that the core reads no environment variables: kernels are created while modules are imported, so
there is no call that could take a setting, and no result depends on it. The variable is read once, when the
first kernel is created. Numba's ``NUMBA_CACHE_DIR`` keeps its meaning for all other functions; kernels ignore
it.
"""

import json
import os
import pickle
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache, partial
from hashlib import sha256
from pathlib import Path
from threading import Lock
from typing import Any, ClassVar, NamedTuple
from zipfile import BadZipFile, ZipFile

import numba
from llvmlite.binding import get_host_cpu_features as get_features
from llvmlite.binding import get_host_cpu_name, get_process_triple
from numba.core import config
from numba.core.caching import CompileResultCacheImpl, FunctionCache, UserProvidedCacheLocator
from numba.core.ccallback import CFunc
from numba.core.codegen import get_host_cpu_features
from numba.core.runtime import rtsys
from numba.core.sigutils import normalize_signature
from platformdirs import user_cache_path

from islands.distribution import read_version
from islands.kernels.callee import Callee

#: File in the cache folder that marks it as complete: every kernel has been compiled.
STAMP = "complete"

#: Days after which the folder of another version is deleted if no process has used it.
UNUSED_DAYS = 30

#: Folders of the package that contain compiled functions.
COMPILED = ("kernels", "effects", "expressions", "program", "simulators/fmu", "simulators/ode", "systems")

_PACKAGE = Path(__file__).absolute().parents[1]

#: Numba's cache of the kernels, compiled for `TARGET`.
ARCHIVE = _PACKAGE / "kernels" / "machine_code.zip"

#: Member of the archive that describes it.
MANIFEST = "manifest.json"

#: Processors of the archive, and their features: those of 2013 and later.
TARGET = "x86-64-v3"
FEATURES = (
    *("cx16", "popcnt", "sahf", "sse3", "sse4.1", "sse4.2", "ssse3"),
    *("avx", "avx2", "bmi", "bmi2", "f16c", "fma", "lzcnt", "movbe", "xsave"),
)


class Manifest(NamedTuple):
    """Description of the archive.

    Attributes
    ----------
    made_for : list of str
        Processor, system, Python and Numba; see `describe_target`.
    digests : dict
        Digest of each source by its path in the package.
    imports : dict
        For each module with kernels: the sources that it consists of, itself and those that it imports.
    """

    made_for: list[str]
    digests: dict[str, str]
    imports: dict[str, list[str]]


def kernel(
    function: Callable[..., Any] | None = None, constants: tuple[str, ...] = (), **options: Any
) -> Any:
    """Compile a function as a kernel, which releases the GIL; 1/0 is inf and not an exception.

    Use it as ``@kernel``, or with more Numba options as ``@kernel(forceinline=True)``. ``constants`` are the
    parameters whose value the compiler must know if another kernel calls this one.

    Machine code is generated and stored for calls from Python; see `islands.kernels.callee` for calls from
    other kernels.

    The cache distinguishes functions of one factory by the numbers that they enclose. They must not enclose a
    kernel: its representation differs in every process, so the cache would never find the function.
    """
    if function is None:
        return partial(kernel, constants=constants, **options)
    options |= {"nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True}
    dispatcher = numba.njit(**options)(function)
    callee = dispatcher.callee = Callee(function, dispatcher.targetoptions, constants)
    # Numba calls these two where a kernel calls this one.
    dispatcher.get_call_template, dispatcher.get_overload = callee.get_call_template, callee.get_overload
    folder = cache_folder()
    if folder is not None:
        with _numba_caches_in(folder):
            dispatcher._cache = _Cache(function)
    return dispatcher


def compile_callback(function: Callable[..., Any], signature: Any) -> CFunc:
    """Compile a function for calls through its ``address``; 1/0 is inf and not an exception.

    Functions of `COMPILED` that enclose nothing but such functions are stored. All others are compiled in
    every process, since the name of the folder does not depend on their sources.

    Parameters
    ----------
    function : callable
    signature : numba signature
    """
    types, returned = normalize_signature(signature)
    compiled = CFunc(function, (types, returned), {}, {"error_model": "numpy"})
    folder = cache_folder()
    if folder is not None and _is_of_sources(function):
        with _numba_caches_in(folder):
            compiled._cache = _Cache(function)
    compiled.compile()
    return compiled


def _is_of_sources(function: Any) -> bool:
    """Return whether a function, and all that it encloses, are functions of `COMPILED`."""
    folders = tuple(f"{folder}/" for folder in COMPILED)
    return all(module.startswith(folders) for module in list_modules(function))


def list_modules(function: Any) -> list[str]:
    """Return the paths in the package of the modules of a function, and of the functions that it encloses."""
    package, _, module = (getattr(function, "__module__", None) or "").partition(".")
    path = f"{module.replace('.', '/')}.py" if package == __name__.partition(".")[0] else ""
    enclosed = [cell.cell_contents for cell in getattr(function, "__closure__", None) or ()]
    return [path, *(each for value in enclosed if callable(value) for each in list_modules(value))]


@cache
def cache_folder() -> Path | None:
    """Return the folder of the compiled kernels; None if they cannot be stored, so that every start compiles.

    A complete folder is used even if it is read-only, for example in a container.
    """
    folder = None
    try:
        chosen = os.environ.get("ISLANDS_CACHE_DIR")
        base = Path(chosen).expanduser().absolute() if chosen else user_cache_path("islands", appauthor=False)
        folder = base / "kernels" / _key()
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder) as probe:
            probe.write(bytes(4096))  # on a full disk an empty file can still be created
        os.utime(folder)  # the time of its last use
    except (OSError, RuntimeError):  # RuntimeError: the user has no home folder
        return folder if folder is not None and (folder / STAMP).exists() else None
    return folder


def are_stored() -> bool:
    """Return whether all kernels are in the archive, or in the cache."""
    manifest = read_manifest()
    if manifest is not None and all(map(is_current, manifest.imports)):
        return True
    folder = cache_folder()
    return folder is not None and (folder / STAMP).exists()


def describe_target() -> list[str]:
    """Return what the code of the archive depends on besides the sources."""
    return [TARGET, get_process_triple(), str(sys.implementation.cache_tag), numba.__version__]


@cache
def read_manifest() -> Manifest | None:
    """Return the manifest of the archive; None if this processor, or this process, needs other code."""
    # A user may choose another processor by the environment, as images of the service do.
    if (config.CPU_NAME, config.CPU_FEATURES) not in ((None, None), (TARGET, "")):
        return None
    host = get_features()
    if not all(host.get(feature) for feature in FEATURES):
        return None
    try:
        manifest = Manifest(**json.loads(_open_archive(os.getpid()).read(MANIFEST)))
    except (OSError, BadZipFile):
        return None
    return manifest if manifest.made_for == describe_target() else None


@cache
def _open_archive(_process: int) -> ZipFile:
    """Open the archive, once in each process: those that share an open file share the place of reading."""
    return ZipFile(ARCHIVE)


@cache
def is_current(module: str) -> bool:
    """Return whether the archive has the code of a module's kernels, given its path in the package."""
    manifest = read_manifest()
    if manifest is None or module not in manifest.imports:
        return False
    return all(digest_source(each) == manifest.digests[each] for each in manifest.imports[module])


@cache
def digest_source(path: str) -> str:
    """Return the digest of a source, given its path in the package; empty if there is no such file."""
    try:
        return sha256((_PACKAGE / path).read_bytes()).hexdigest()
    except OSError:
        return ""


def ready(compile_all: Callable[[], None], tell: Callable[[str], None]) -> bool:
    """Ensure that all kernels are compiled, by one process if several start at the same time.

    Parameters
    ----------
    compile_all : callable
        Calls every kernel once with each combination of argument types.
    tell : callable
        Receives a line for the user before each long step.

    Returns
    -------
    bool
        Whether this process compiled the kernels. If not, it loads each kernel from the folder at its first
        call.
    """
    if are_stored():
        return False
    folder = cache_folder()
    if folder is None:
        tell(
            "compiling the kernels for this processor at every start, because they cannot be stored;"
            " set ISLANDS_CACHE_DIR to a writable folder"
        )
        compile_all()
        return True
    with _lock(folder / "compiling.lock", lambda: tell("waiting for another process to compile the kernels")):
        if (folder / STAMP).exists():
            return False
        _delete_unused_folders(folder)
        tell(f"compiling the kernels for this processor once; they are stored in {folder}")
        compile_all()
        _stamp(folder)
    return True


class _Locator(UserProvidedCacheLocator):
    """Numba's locator of the chosen folder, which may be read-only.

    Kernels of the package are found by their path in the package, wherever it is installed.
    """

    @classmethod
    def get_suitable_cache_subpath(cls, py_file: str) -> str:
        """Return the name of the folder for the kernels of a source file."""
        source = Path(py_file).absolute()
        if source.is_relative_to(_PACKAGE):
            return "_".join(source.relative_to(_PACKAGE).parent.parts)
        return str(super().get_suitable_cache_subpath(py_file))

    def ensure_cache_path(self) -> None:
        """Create the folder of a source file, without Numba's test that it can be written."""
        with suppress(OSError):
            Path(self.get_cache_path()).mkdir(parents=True, exist_ok=True)


class _CacheFiles(CompileResultCacheImpl):
    _locator_classes: ClassVar = [_Locator]

    def reduce(self, cres: Any) -> Any:
        """Leave out the types of the lines of source, which contain paths."""
        return super().reduce(cres._replace(type_annotation=""))


class _Cache(FunctionCache):
    """Numba's cache of one function, safe against concurrent processes and a deleted folder.

    A kernel that cannot be loaded or saved (deleted folder, full disk) is compiled for this process only.
    """

    _impl_class = _CacheFiles

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        # Numba's method refreshes the context: it imports all that the compiler knows, which takes 0.2 s.
        # Machine code needs the allocation of arrays only, and the compiler refreshes the context itself.
        with suppress(OSError):
            rtsys.initialize(target_context)
            archived = self._read_archived(sig, target_context)
            if archived is not None:
                return self._impl.rebuild(target_context, archived)
            return self._load_overload(sig, target_context)
        return None

    def _read_archived(self, sig: Any, target_context: Any) -> Any:
        if not all(map(is_current, list_modules(self._py_func))):
            return None
        archive, folder = _open_archive(os.getpid()), Path(self.cache_path).name
        name = f"{folder}/{self._impl.filename_base}.nbi"
        if name not in archive.NameToInfo:
            return None
        with archive.open(name) as index:
            pickle.load(index)  # the version of Numba
            _, files = pickle.load(index)
        signature, (triple, *_), function = self._index_key(sig, target_context.codegen())
        file = files.get((signature, (triple, TARGET, ""), function))
        return None if file is None else pickle.loads(archive.read(f"{folder}/{file}"))

    def save_overload(self, sig: Any, data: Any) -> None:
        # Numba reads the function's index, chooses a free file name and writes both. Two processes that do
        # so at the same time can choose one name for two signatures; a later process then loads wrong code.
        with suppress(OSError), _lock(Path(self.cache_path).parent / "saving.lock"):
            super().save_overload(sig, data)


#: Held while Numba's folder of caches is set.
_setting = Lock()


@contextmanager
def _numba_caches_in(folder: Path) -> Iterator[None]:
    """Set the folder of the caches created in this context; Numba reads its setting at their creation.

    The setting is that of the process, so that threads wait for each other.
    """
    with _setting:
        before = config.CACHE_DIR
        config.CACHE_DIR = str(folder)
        try:
            yield
        finally:
            config.CACHE_DIR = before


@contextmanager
def _lock(path: Path, when_taken: Callable[[], None] | None = None) -> Iterator[None]:
    """Hold a lock that the operating system releases when the process dies."""
    from filelock import FileLock, Timeout  # noqa: PLC0415 - takes 20 ms, needed for compilation only

    lock = FileLock(path)  # creates the folder if it was deleted
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
    with suppress(OSError):  # without a stamp the next start compiles again
        # If the folder was deleted meanwhile, the lock file and the first kernels are gone too.
        if (folder / "compiling.lock").exists():
            draft = folder / f"{STAMP}.part"
            draft.write_text("All kernels are compiled. This folder may be deleted.\n", encoding="utf-8")
            draft.replace(folder / STAMP)


def _delete_unused_folders(used: Path) -> None:
    """Delete the folders of other versions whose last use was `UNUSED_DAYS` before that of the given one."""
    with suppress(OSError):
        oldest = used.stat().st_mtime - UNUSED_DAYS * 86400
        for folder in used.parent.iterdir():
            if folder.stat().st_mtime < oldest:
                shutil.rmtree(folder, ignore_errors=True)


def _key() -> str:
    processor = get_host_cpu_name() if config.CPU_NAME is None else config.CPU_NAME
    return f"{read_version()}-{numba.__version__}-{processor}-{_hash(processor)}"


def _hash(processor: str) -> str:
    """Hash everything else that the compiled kernels depend on, so that the stamp is valid for them.

    Numba checks only the file of a function itself and misses a change of a function that is inlined from
    another file. The hash also contains the Python version and the processor's features.
    """
    features = get_host_cpu_features() if config.CPU_FEATURES is None else config.CPU_FEATURES
    hashed = sha256(repr((sys.implementation.cache_tag, processor, features)).encode())
    for source in sorted(source for folder in COMPILED for source in (_PACKAGE / folder).rglob("*.py")):
        hashed.update(repr((source.relative_to(_PACKAGE).as_posix(), source.read_bytes())).encode())
    return hashed.hexdigest()[:12]
