"""Pages of the documentation: headings, links and code blocks of Markdown files."""

import re
import textwrap
import unicodedata
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import yaml
from hooks import expand_nav, nav_pages, written_pages
from project_pages import SOURCES

from islands_api.cli.app import COMMANDS
from support.repository import DOCS, ROOT

#: Hand-written pages: those of the site and those of the repository's root.
PAGES = sorted(
    [*(ROOT / name for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md")), *DOCS.rglob("*.md")]
)

_FENCED = re.compile(r"^```(\w*)[^\n]*\n(.*?)^```", re.MULTILINE | re.DOTALL)
_INDENTED = re.compile(r"(?<=\n\n)(?:(?: {4}[^\n]*)?\n)+")


class Block(NamedTuple):
    """Code block of a page; the language of an indented block is empty."""

    language: str
    code: str


def page_name(page: Path) -> str:
    """Return the path of a page in the repository."""
    return page.relative_to(ROOT).as_posix()


def blocks(page: Path) -> list[Block]:
    """Return the code blocks of a page."""
    text = page.read_text("utf-8")
    fenced = [Block(*match.groups()) for match in _FENCED.finditer(text)]
    indented = [textwrap.dedent(match[0]) for match in _INDENTED.finditer(_FENCED.sub("", text))]
    return [*fenced, *(Block("", code) for code in indented if code.strip())]


def prose(page: Path) -> str:
    """Return the text of a page without its code blocks."""
    return _INDENTED.sub("\n", _FENCED.sub("", page.read_text("utf-8")))


def links(page: Path) -> list[str]:
    """Return the targets of links and pictures that are not addresses."""
    text = re.sub(r"`[^`\n]*`", "", prose(page))
    found = re.findall(r"\]\(\s*([^)\s]+)\s*\)", text) + re.findall(r"\bsrc=\"([^\"]+)\"", text)
    return [target for target in found if not re.match(r"[a-z]+:", target)]


def anchors(page: Path) -> set[str]:
    """Return the anchors of the headings of a page, as Python-Markdown makes them."""
    found: set[str] = set()
    for heading in re.findall(r"^#{1,6} (.+)$", prose(page), re.MULTILINE):
        text = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading)
        text = unicodedata.normalize("NFKD", text).encode("ascii", "ignore").decode()
        slug = anchor = re.sub(r"[-\s]+", "-", re.sub(r"[^\w\s-]", "", text).strip().lower())
        count = 1
        while anchor in found:
            anchor, count = f"{slug}_{count}", count + 1
        found.add(anchor)
    return found


def site_pages() -> set[str]:
    """Return the pages that the navigation of the site has."""
    nav = yaml.safe_load((ROOT / "mkdocs.yml").read_text("utf-8"))["nav"]
    return set(nav_pages(expand_nav(nav, written_pages())))


def is_generated(page: str) -> bool:
    """Return whether the site generates a page, given its path below ``docs/``."""
    return page in SOURCES or page.startswith(("reference/", "tutorials/"))


def commands(page: Path) -> Iterator[str]:
    """Yield the commands of a page that begin with ``islands`` or ``make``: in blocks and in inline code.

    In inline code ``islands`` may be left out before a command with an option: ``fit --library auto``.
    """
    shell = [code for language, code in blocks(page) if language in ("", "sh", "bash", "console")]
    inline = re.findall(r"`([^`\n]+)`", prose(page))
    short = rf"({'|'.join(COMMANDS)})( [a-z]+)* --"
    spans = [f"islands {span}" if re.match(short, span) else span for span in inline]
    for line in [*re.sub(r"\\\n\s*", "", "\n".join(shell)).splitlines(), *spans]:
        command = re.sub(r"^(\$ |\.venv/bin/)", "", line.strip())
        if re.match(r"(islands|make) [a-z]", command):
            yield re.split(r"\s+#\s| \| |[;&>]", command)[0]
