"""Public names of the package and its docstring."""

import inspect
from collections import defaultdict
from contextlib import suppress

import islands
import islands_api
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


def list_callables():
    """Yield the names and values of the public functions, classes and methods of the packages."""
    for package in (islands, islands_api):
        for name in package.__all__:
            entry = getattr(package, name)
            yield name, entry
            if isinstance(entry, type):
                yield from ((f"{name}.{each}", getattr(entry, each)) for each in dir(entry) if each[0] != "_")


def test_signatures_are_for_readers():
    """A signature names tables and types, and does not spell out what is in them."""
    found = {}
    for name, entry in list_callables():
        if callable(entry):
            with suppress(TypeError, ValueError):  # exceptions have no signature
                found[name] = inspect.signature(entry)
    assert len(found) > 200
    assert {name: len(str(each)) for name, each in found.items() if len(str(each)) > 2000} == {}
    parameters = [(name, str(each)) for name in found for each in found[name].parameters.values()]
    # The type of arrays of NumPy takes 300 characters.
    assert [each for each in parameters if len(each[1]) > 400] == []
    assert "effects: collections.abc.Sequence" in str(found["diagnose"])
    assert "= islands.EFFECTS" in str(found["diagnose"])
