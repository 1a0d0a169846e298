"""C compiler of this machine."""

import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path

from islands.errors import ModelError


def find_compiler() -> str | None:
    """Return the path of the C compiler, or None."""
    return shutil.which("cc")


def compile_library(source: Path, library: Path, flags: Sequence[str]) -> None:
    """Compile a C file to a shared library.

    Raises
    ------
    ModelError
        If there is no compiler, or if it rejects the source or a flag; the message is the compiler's.
    """
    command = find_compiler()
    if command is None:
        raise ModelError("there is no C compiler named cc: install one")
    done = subprocess.run(
        [command, *flags, "-shared", "-fPIC", "-o", str(library), str(source), "-lm"],
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode != 0:
        raise ModelError(f"{command} {' '.join(flags)} does not compile {source.name}: {done.stderr.strip()}")
