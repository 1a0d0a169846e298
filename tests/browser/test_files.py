"""Files of the dashboard: all are served, without inline code or other origins."""

import posixpath
import re

import pytest

from islands_api.web.middleware import SECURITY_HEADERS
from islands_api.web.routes.page import DASHBOARD_DIR, FILES

PATHS = sorted(path for path in DASHBOARD_DIR.rglob("*") if path.is_file())
TEXTS = {path.relative_to(DASHBOARD_DIR).as_posix(): path.read_text(encoding="utf-8") for path in PATHS}
SCRIPTS = {name: text for name, text in TEXTS.items() if name.endswith(".js")}

#: Namespaces, which are never requested.
_NAMESPACES = ("http://www.w3.org/2000/svg", "http://www.w3.org/1998/Math/MathML")


def test_every_file_of_the_dashboard_is_served() -> None:
    assert set(TEXTS) == set(FILES)


def list_imports(name: str) -> set[str]:
    """Return the modules that a module imports before it runs."""
    imported = re.findall(r'^(?:import|export)[^;]*?"(\.[^"]+)";', SCRIPTS[name], re.MULTILINE)
    return {posixpath.normpath(posixpath.join(posixpath.dirname(name), path)) for path in imported}


def list_required(names: set[str]) -> set[str]:
    """Return all modules that some modules import, directly and through others."""
    found: set[str] = set()
    added = names
    while added := {each for name in added for each in list_imports(name)} - found:
        found |= added
    return found


def test_every_module_of_the_lists_of_jobs_and_data_is_preloaded() -> None:
    """Those of other pages are loaded when a page is first shown."""
    lists = {"pages/jobs.js", "pages/data.js"}
    preloaded = re.findall(r'rel="modulepreload" href="dashboard/([\w./]+)"', TEXTS["index.html"])
    assert preloaded == sorted(lists | list_required(lists | {"islands.js"}))


@pytest.mark.parametrize("name", SCRIPTS)
def test_modules_import_each_other_in_one_direction(name: str) -> None:
    assert name not in list_required({name})


def test_a_module_imports_only_served_files() -> None:
    for name, text in SCRIPTS.items():
        loaded = re.findall(r'\bimport\("\./([^"]+)"\)', text)
        assert list_imports(name) | set(loaded) <= set(FILES), name


@pytest.mark.parametrize("name", ["docs.html", "index.html"])
def test_the_page_has_no_inline_scripts_or_styles(name: str) -> None:
    """The content security policy forbids both."""
    page = TEXTS[name]
    assert not re.search(r"<style|\sstyle=|\son\w+=|<script(?![^>]*\ssrc=)|javascript:", page)
    assert "unsafe" not in SECURITY_HEADERS["Content-Security-Policy"]
    assert "default-src 'self'" in SECURITY_HEADERS["Content-Security-Policy"]


def test_a_module_never_turns_text_into_markup_or_code() -> None:
    forbidden = (
        r"innerHTML|outerHTML|insertAdjacentHTML|document\.write|\beval\(|new Function|srcdoc|text/html"
    )
    assert not [name for name, text in SCRIPTS.items() if re.search(forbidden, text)]


def test_a_file_refers_to_no_other_site() -> None:
    for name, text in TEXTS.items():
        addresses = re.findall(r"(?:https?:)?//[\w.-]+\.\w+[\w./-]*", text)
        assert set(addresses) <= set(_NAMESPACES), name
