"""Compile the kernels of all commands into the archive of the package: ``make kernels``.

Equal sources give equal bytes: one process compiles the kernels in one order, since Numba counts the
functions of a process and writes their numbers into the code.
"""

import ast
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from zipfile import ZIP_STORED, ZipFile, ZipInfo

#: Variables that are read when Python starts and Numba is imported.
ENVIRONMENT = {
    "NUMBA_CPU_NAME": "x86-64-v3",
    "NUMBA_CPU_FEATURES": "",
    "PYTHONHASHSEED": "0",
    "PYTHONPATH": str(Path(__file__).parents[2] / "tests"),
}


def compile_archive() -> None:
    """Compile the kernels of all commands in this process, and write the archive."""
    import numba
    from numba.core import ir
    from numba.np.ufunc import array_exprs

    from islands.facade.warm_up import use_other_kernels, warm_up
    from islands.kernels import jit_cache
    from islands_service.intake.simulation_server import compile_kernels
    from support.kernels import compile_further_kernels

    # Numba writes the paths of sources into messages, and addresses into the names of array expressions.
    roots = [str(Path(each).parents[1]) for each in (numba.__file__, jit_cache._PACKAGE / "__init__.py")]
    initialise = ir.Loc.__init__

    def shorten_path(loc, filename, *others, **named):
        root = next((each for each in roots if filename.startswith(each)), "")
        initialise(loc, filename.removeprefix(root).lstrip("/"), *others, **named)

    ir.Loc.__init__, ir.Loc._get_path = shorten_path, lambda loc: loc.filename
    array_exprs.hash = lambda each: each.loc.line if isinstance(each, ir.Expr) else hash(each.__name__)

    modules: set[str] = set()
    save = jit_cache._Cache.save_overload

    def note_modules(cache, sig, data):
        modules.update(jit_cache.list_modules(cache._py_func))
        save(cache, sig, data)

    jit_cache._Cache.save_overload = note_modules
    jit_cache.ARCHIVE.unlink(missing_ok=True)
    os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    warm_up()
    use_other_kernels()  # as its second process does
    compile_further_kernels()
    compile_kernels()
    folder = jit_cache.cache_folder()
    files = {
        f"{path.parent.name}/{path.name}": path.read_bytes() for path in sorted(folder.rglob("*.nb[ci]"))
    }
    imports = {module: sorted(find_imports(module, jit_cache)) for module in sorted(modules)}
    digests = {each: jit_cache.digest_source(each) for each in sorted(set().union(*imports.values()))}
    manifest = jit_cache.Manifest(jit_cache.describe_target(), digests, imports)
    # Without compression: Git and the wheel compress it, and Git stores of a new version what has changed.
    with ZipFile(jit_cache.ARCHIVE, "w", ZIP_STORED) as archive:
        archive.writestr(ZipInfo(jit_cache.MANIFEST), json.dumps(manifest._asdict(), indent=1))
        for name, content in files.items():
            archive.writestr(ZipInfo(name), content)
    print(f"{jit_cache.ARCHIVE}: {len(files)} files, {jit_cache.ARCHIVE.stat().st_size} bytes")


def find_imports(module: str, jit_cache, found: frozenset[str] = frozenset()) -> frozenset[str]:
    """Return the paths of a module and of all modules of the compiled folders that it imports."""
    if module in found or not module.startswith(tuple(f"{each}/" for each in jit_cache.COMPILED)):
        return found
    found |= {module}
    for each in read_imports(jit_cache.ARCHIVE.parents[1], module):
        found = find_imports(each, jit_cache, found)
    return found


def read_imports(package: Path, module: str) -> Iterator[str]:
    """Yield the paths of the modules of the package that a module imports."""
    for node in ast.walk(ast.parse((package / module).read_text("utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module:
            names = [node.module, *(f"{node.module}.{each.name}" for each in node.names)]
        elif isinstance(node, ast.Import):
            names = [each.name for each in node.names]
        else:
            continue
        for name in names:
            path = Path(*name.split(".")[1:]) if name.startswith(f"{package.name}.") else Path("no")
            for file in (path.with_suffix(".py"), path / "__init__.py"):
                if (package / file).is_file():
                    yield file.as_posix()


if __name__ == "__main__":
    if ENVIRONMENT.items() <= os.environ.items():
        compile_archive()
    else:
        with tempfile.TemporaryDirectory() as folder:
            environment = os.environ | ENVIRONMENT | {"ISLANDS_CACHE_DIR": folder}
            sys.exit(subprocess.run([sys.executable, __file__], env=environment, check=False).returncode)
