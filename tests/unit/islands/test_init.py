"""Public names of the package and its docstring."""

import inspect
from collections import defaultdict

import islands
from islands.facade.evolution_run import SearchCallback
from islands.facade.fit import fit
from islands.facade.identify import identify
from islands.progress import ProgressCallback
from support.repository import ROOT


def test_public_names_are_documented():
    reference = "".join(page.read_text() for page in (ROOT / "docs").rglob("*.md"))
    assert islands.__all__ == sorted(islands.__all__, key=lambda name: (not name.isupper(), name))
    for name in islands.__all__:
        entry = getattr(islands, name)
        if callable(entry):
            # The default docstring of a dataclass is its signature.
            assert entry.__doc__, name
            assert not entry.__doc__.startswith(f"{name}("), name
        else:
            assert name in reference, name


def test_stub_file_lists_the_public_names():
    stub = (ROOT / "src" / "islands" / "__init__.pyi").read_text()
    assert stub == islands._make_stub()


def test_package_docstring_shows_an_example():
    assert "islands.read_record(" in islands.__doc__
    assert "islands.fit(" in islands.__doc__


def test_facade_functions_are_public():
    assert islands.identify is identify
    assert islands.fit is fit


def test_callbacks_mean_the_same_in_every_function():
    """``progress`` gets a message and a fraction, ``on_epoch`` the state of a search and its settings."""
    found = defaultdict(set)
    for name in islands.__all__:
        value = getattr(islands, name)
        if inspect.isfunction(value):
            for parameter in inspect.signature(value).parameters.values():
                # A class that is imported late is annotated by its name.
                named = str(parameter.annotation).replace("SearchCallback", str(SearchCallback))
                found[parameter.name].add(named)
    assert found["progress"] == {str(ProgressCallback)}
    assert found["on_epoch"] == {str(SearchCallback | None)}
    assert "stage" not in found
