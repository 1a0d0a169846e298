"""MkDocs hook: generated files, the links to them, and ``folder/*`` in the navigation.

A module of this folder generates files if it has a function ``make_pages()`` that yields the path below
``docs/`` and the content of each file.
"""

import sys
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from mkdocs.config.defaults import MkDocsConfig
    from mkdocs.structure.files import Files
    from mkdocs.structure.pages import Page

SCRIPTS = Path(__file__).parent
DOCS = SCRIPTS.parent


def generated_files() -> dict[str, str | bytes]:
    """Return the content of every generated file by its path below ``docs/``."""
    # MkDocs restores the path after it has loaded a hook.
    if str(SCRIPTS) not in sys.path:
        sys.path.insert(0, str(SCRIPTS))
    found: dict[str, str | bytes] = {}
    for file in sorted(SCRIPTS.glob("*.py")):
        if file != Path(__file__) and hasattr(module := import_module(file.stem), "make_pages"):
            found |= dict(module.make_pages())
    return found


def written_pages() -> set[str]:
    """Return the paths of the pages that are files in ``docs/``."""
    return {path.relative_to(DOCS).as_posix() for path in DOCS.rglob("*.md") if SCRIPTS not in path.parents}


def expand_nav(entry: Any, pages: set[str]) -> Any:
    """Replace ``folder/*`` by the pages of that folder in the order of their names, the index first."""
    match entry:
        case dict():
            return {title: expand_nav(inner, pages) for title, inner in entry.items()}
        case list():
            return [expand_nav(inner, pages) for inner in entry]
        case str() if entry.endswith("/*"):
            inside = (page for page in pages if page.rpartition("/")[0] == entry[:-2])
            return sorted(inside, key=lambda page: (not page.endswith("/index.md"), page))
    return entry


def nav_pages(entry: Any) -> Iterator[str]:
    """Yield the pages of a navigation."""
    match entry:
        case dict():
            yield from nav_pages(list(entry.values()))
        case list():
            for inner in entry:
                yield from nav_pages(inner)
        case str():
            yield entry


def on_config(config: "MkDocsConfig") -> None:
    """Generate the files and complete the navigation."""
    config.extra["generated"] = generated = generated_files()
    pages = {path for path in generated if path.endswith(".md")} | written_pages()
    config.nav = expand_nav(config.nav, pages)


def on_files(files: "Files", config: "MkDocsConfig") -> None:
    """Add the generated files."""
    from mkdocs.structure.files import File  # noqa: PLC0415

    for path, content in config.extra.pop("generated").items():
        files.append(File.generated(config, path, content=content))


def on_page_markdown(markdown: str, page: "Page", **_: object) -> str:
    """Let the links of a written page to the source of a generated page lead to that page."""
    if page.file.generated_by is not None:
        return markdown
    adapted: str = import_module("project_pages").adapt_links(markdown, f"docs/{page.file.src_uri}")
    return adapted
