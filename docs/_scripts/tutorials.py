"""Tutorials: executed examples as Markdown pages.

An example is a Python script in ``examples/``. Its docstring is the title and the introduction of the page. A
line ``# %%`` begins a cell: the comment lines that follow are Markdown, the rest is code. The code of a cell
``# %% checks`` runs and is not shown. Each page shows the text, the code, the printed output and the SVG
figures that the script writes to its output folder. ``hooks.py`` adds the pages to the site.
"""

import ast
import hashlib
import io
import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import redirect_stdout
from itertools import takewhile
from pathlib import Path
from typing import Any, NamedTuple

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("src", "services", "api")

#: Results of executed examples, by a hash of the example and of the packages. Git ignores ``build/``.
CACHE = ROOT / "build" / "tutorials"


class Cell(NamedTuple):
    """Text and code of a cell; ``line`` is the line number at which the code begins."""

    text: str
    code: str
    line: int
    shown: bool


class Example(NamedTuple):
    """A parsed example."""

    name: str
    title: str
    introduction: str
    cells: tuple[Cell, ...]


def list_examples() -> list[Path]:
    """Return the paths of all examples in the order of their numbers."""
    return sorted((ROOT / "examples").glob("[0-9][0-9]_*.py"))


def parse(path: Path) -> Example:
    """Read an example; raise a ``ValueError`` if it has no docstring or no cells."""
    source = path.read_text(encoding="utf-8")
    docstring = ast.get_docstring(ast.parse(source))
    head, *blocks = re.split(r"^# %%(.*)\n", source, flags=re.MULTILINE)
    if not docstring or not blocks:
        raise ValueError(f"{path.name} needs a docstring and cells that begin with '# %%'")
    title, _, introduction = docstring.partition("\n")
    line, cells = head.count("\n") + 2, []
    for marker, block in zip(blocks[::2], blocks[1::2], strict=True):
        comments = "".join(takewhile(lambda row: row.startswith("#"), block.splitlines(keepends=True)))
        text = re.sub(r"^# ?", "", comments, flags=re.MULTILINE).strip()
        code = block[len(comments) :]
        cells.append(Cell(text, code, line + comments.count("\n"), "checks" not in marker))
        line += block.count("\n") + 1
    return Example(path.stem, title.rstrip("."), introduction.strip(), tuple(cells))


def run(path: Path, folder: Path) -> None:
    """Execute the cells of an example in this process; write ``cells.json`` and figures into a folder."""
    import matplotlib as mpl  # noqa: PLC0415 - only the process that executes an example needs it

    mpl.rcParams["svg.hashsalt"] = "islands"
    out = folder / "out"
    sys.argv = [str(path), "--out", str(out)]
    namespace = {"__name__": "__main__", "__file__": str(path)}
    results, seen = [], set()
    for cell in parse(path).cells:
        printed = io.StringIO()
        with redirect_stdout(printed):
            # Empty lines in front keep the line numbers of error messages.
            exec(compile("\n" * (cell.line - 1) + cell.code, str(path), "exec"), namespace)
        figures = sorted({file.name for file in out.glob("*.svg")} - seen)
        seen.update(figures)
        results.append({"output": printed.getvalue().replace(str(out), "out"), "figures": figures})
    (folder / "cells.json").write_text(json.dumps(results), encoding="utf-8")


def execute(path: Path) -> Path:
    """Execute an example in a process unless the cache has its results; return the folder of the results."""
    sources = (file for name in PACKAGES for file in sorted((ROOT / name).rglob("*.py")))
    content = b"".join(file.read_bytes() for file in (path, Path(__file__), *sources))
    folder = CACHE / f"{path.stem}-{hashlib.sha256(content).hexdigest()[:16]}"
    if not (folder / "cells.json").exists():
        for stale in CACHE.glob(f"{path.stem}-*"):
            shutil.rmtree(stale)
        (folder / "out").mkdir(parents=True)
        command = [sys.executable, __file__, str(path), str(folder)]
        environment = {**os.environ, "MPLBACKEND": "agg", "SOURCE_DATE_EPOCH": "0"}
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
        if done.returncode:
            raise RuntimeError(f"{path.name} ended with exit code {done.returncode}:\n{done.stderr}")
    return folder


def render(example: Example, results: list[dict[str, Any]]) -> str:
    """Return the Markdown of a page."""
    script = (
        f"This page is [`{example.name}.py`]({example.name}.py) and its output; `out` is its output folder."
    )
    parts = [f"# {example.title}", example.introduction, script]
    for cell, result in zip(example.cells, results, strict=True):
        parts.append(cell.text)
        if cell.shown and cell.code.strip():
            parts.append(f"```python\n{cell.code.strip()}\n```")
            if output := result["output"].rstrip():
                parts.append(f'```text title="Output"\n{output}\n```')
        parts += [f"![{name.removesuffix('.svg')}]({example.name}/{name})" for name in result["figures"]]
    return "\n\n".join(part for part in parts if part) + "\n"


def make_pages() -> Iterator[tuple[str, bytes]]:
    """Execute the examples; yield the path in the site and the content of each page, script and figure."""
    index = "# Tutorials\n\nEach tutorial is a script that you can run, and its output.\n\n"
    for path in list_examples():
        example, folder = parse(path), execute(path)
        results = json.loads((folder / "cells.json").read_text(encoding="utf-8"))
        yield f"tutorials/{example.name}.md", render(example, results).encode()
        yield f"tutorials/{path.name}", path.read_bytes()
        for name in (name for result in results for name in result["figures"]):
            yield f"tutorials/{example.name}/{name}", (folder / "out" / name).read_bytes()
        index += f"* [{example.title}]({example.name}.md)\n"
    yield "tutorials/index.md", index.encode()


def build(output: Path) -> list[Path]:
    """Write all pages below a folder; return their paths."""
    written = []
    for name, content in make_pages():
        (output / name).parent.mkdir(parents=True, exist_ok=True)
        (output / name).write_bytes(content)
        written.append(output / name)
    return written


if __name__ == "__main__":
    run(Path(sys.argv[1]), Path(sys.argv[2]))
