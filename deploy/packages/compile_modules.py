"""Write the bytecode of the modules that commands load, which every start would compile otherwise.

    .venv/bin/python deploy/packages/compile_modules.py

Python writes bytecode when it imports a module, unless ``PYTHONDONTWRITEBYTECODE`` is set, as usual in
images, or the environment is read-only. This program compiles the sources of this project, and imports the
modules that they name: a tenth of those that are installed. Bytecode is valid as long as the time and the
size of its source are those that it was compiled from, so that an edited module is compiled again.
"""

import ast
import compileall
import sys
import warnings
from collections.abc import Iterator
from contextlib import suppress
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from py_compile import PycInvalidationMode

PACKAGES = ("islands", "islands_service", "islands_api")

#: Modules that libraries load while they work, and no source names.
WHILE_WORKING = (
    "matplotlib.backends.backend_agg",
    "matplotlib.backends.backend_svg",
    "ray._private.workers.default_worker",
)


def read_names(source: str) -> Iterator[str]:
    """Yield the names of the modules, and of what may be modules, that a source imports."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            yield from (each.name for each in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield node.module
            yield from (f"{node.module}.{each.name}" for each in node.names)


def main() -> None:
    sys.dont_write_bytecode = False
    names = set(WHILE_WORKING)
    for package in PACKAGES:
        (folder,) = find_spec(package).submodule_search_locations
        compileall.compile_dir(folder, quiet=2, invalidation_mode=PycInvalidationMode.TIMESTAMP)
        for source in Path(folder).rglob("*.py"):
            names.update(read_names(source.read_text("utf-8")))
    warnings.simplefilter("ignore")
    for name in sorted(names):
        # A package of an extra that is not installed, a name that is no module, a module of another system.
        if not name.startswith(PACKAGES):
            with suppress(Exception):
                import_module(name)
    # The compiler imports what it knows at its first function.
    import_module("numba").njit(lambda: None)()
    print(f"{len(sys.modules)} modules")


if __name__ == "__main__":
    main()
