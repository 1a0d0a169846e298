"""Store of machine code in the cache folder, from which later processes load it in two milliseconds."""

from contextlib import suppress
from hashlib import sha256
from pathlib import Path
from tempfile import NamedTemporaryFile

from islands.kernels.jit_cache import cache_folder
from islands.simulators.ode.native.generator import ProgramCode

#: Largest number of stored programs, about 20 kB each. If there are more, the older half is deleted.
MAX_STORED = 2000

_DIGEST = sha256().digest_size


def is_stored(program: ProgramCode) -> bool:
    """Return whether there is machine code of a program."""
    file = _find_file(program)
    return file is not None and file.exists()


def load_code(program: ProgramCode) -> bytes | None:
    """Load the machine code of a program, an object file; None if there is none, or if it is damaged."""
    file = _find_file(program)
    with suppress(OSError):
        content = file.read_bytes() if file is not None else b""
        if content and sha256(content[_DIGEST:]).digest() == content[:_DIGEST]:
            return content[_DIGEST:]
    return None


def store_code(program: ProgramCode, code: bytes) -> None:
    """Store the machine code of a program, if the folder can be written."""
    file = _find_file(program)
    if file is None:
        return
    with suppress(OSError):  # read-only folder, full disk: the next process compiles again
        file.parent.mkdir(exist_ok=True)
        with NamedTemporaryFile(dir=file.parent, delete=False) as draft:
            draft.write(sha256(code).digest() + code)
        Path(draft.name).replace(file)
        _delete_oldest(file.parent)


def _find_file(program: ProgramCode) -> Path | None:
    # The name of the cache folder depends on the processor and on the sources of the generator.
    folder = cache_folder()
    return None if folder is None else folder / "programs" / sha256(repr(program).encode()).hexdigest()


def _delete_oldest(folder: Path) -> None:
    files = list(folder.iterdir())
    if len(files) > MAX_STORED:
        for file in sorted(files, key=lambda each: each.stat().st_mtime)[: len(files) // 2]:
            file.unlink(missing_ok=True)
