"""The files of the page: all of them served, none of them large, nothing inline, nothing from elsewhere."""

import re

import pytest

from islands_api.web.middleware import SECURITY_HEADERS
from islands_api.web.routes.page import DASHBOARD_DIR, FILES

TEXTS = {path.name: path.read_text(encoding="utf-8") for path in sorted(DASHBOARD_DIR.iterdir())}
SCRIPTS = {name: text for name, text in TEXTS.items() if name.endswith(".js")}

#: Names of formats, which nobody asks for.
_NAMESPACES = ("http://www.w3.org/2000/svg", "http://www.w3.org/1998/Math/MathML")


def test_every_file_of_the_folder_is_served() -> None:
    assert set(TEXTS) == set(FILES)


def test_every_module_is_fetched_at_once_with_the_page() -> None:
    preloaded = set(re.findall(r'rel="modulepreload" href="dashboard/([\w.]+)"', TEXTS["index.html"]))
    assert preloaded == set(SCRIPTS) - {"islands.js"}


@pytest.mark.parametrize("name", SCRIPTS)
def test_a_module_imports_what_is_served(name: str) -> None:
    imported = re.findall(r'^(?:import|export)[^;]*?"(\./[^"]+)";', SCRIPTS[name], re.MULTILINE)
    assert {path.removeprefix("./") for path in imported} <= set(FILES)


@pytest.mark.parametrize("name", SCRIPTS)
def test_a_module_says_why_it_exists(name: str) -> None:
    assert re.match(r"/\*\*\s", SCRIPTS[name])


@pytest.mark.parametrize("name", TEXTS)
def test_a_file_stays_small_enough_to_read(name: str) -> None:
    lines = TEXTS[name].splitlines()
    assert len(lines) < 300
    assert name.endswith(".svg") or max(map(len, lines)) <= 110


def test_nothing_is_inline() -> None:
    """The policy would block it, and is not to be weakened for it."""
    page = TEXTS["index.html"]
    assert not re.search(r"<style|\sstyle=|\son\w+=|<script(?![^>]*\ssrc=)|javascript:", page)
    assert "unsafe" not in SECURITY_HEADERS["Content-Security-Policy"]
    assert "default-src 'self'" in SECURITY_HEADERS["Content-Security-Policy"]


@pytest.mark.parametrize("name", SCRIPTS)
def test_no_text_becomes_markup_or_code(name: str) -> None:
    forbidden = (
        r"innerHTML|outerHTML|insertAdjacentHTML|document\.write|\beval\(|new Function|srcdoc|text/html"
    )
    assert not re.search(forbidden, SCRIPTS[name])


@pytest.mark.parametrize("name", TEXTS)
def test_a_file_names_no_other_site(name: str) -> None:
    addresses = re.findall(r"(?:https?:)?//[\w.-]+\.\w+[\w./-]*", TEXTS[name])
    assert set(addresses) <= set(_NAMESPACES)
