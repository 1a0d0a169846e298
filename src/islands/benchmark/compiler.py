"""The C compiler of the machine, where there is one: the practical floor of a time is what it makes."""

import ctypes
import hashlib
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path

from islands.errors import ModelError


def compiler() -> str | None:
    """Return the C compiler's path, None where there is none."""
    return shutil.which("cc")


def compiled(source: str, flags: Sequence[str], folder: Path) -> ctypes.CDLL:
    """Compile C and load it.

    Parameters
    ----------
    folder : Path
        Where source and library are written, under a name that their content gives them.

    Raises
    ------
    ModelError
        There is no compiler, or it refuses the source or a flag: the message is the compiler's.
    """
    command = compiler()
    if command is None:
        raise ModelError("no C compiler is called cc: install one, or leave C out of the comparison")
    name = hashlib.sha256("\n".join((source, *flags)).encode()).hexdigest()
    written, library = folder / f"{name}.c", folder / f"{name}.so"
    written.write_text(source, encoding="ascii")
    done = subprocess.run(
        [command, *flags, "-shared", "-fPIC", "-o", str(library), str(written), "-lm"],
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode != 0:
        raise ModelError(f"{command} {' '.join(flags)} does not compile the benchmark: {done.stderr.strip()}")
    return ctypes.CDLL(str(library))
