"""The public names of the package, and what its docstring says."""

from importlib.metadata import version

import islands
from islands.facade.fit import fit
from islands.facade.identify import identify
from support.repository import ROOT


def test_every_public_name_is_there_and_says_what_it_is():
    reference = (ROOT / "docs" / "reference.md").read_text() + (ROOT / "README.md").read_text()
    assert islands.__all__ == sorted(islands.__all__, key=lambda name: (not name.isupper(), name))
    for name in islands.__all__:
        entry = getattr(islands, name)
        if callable(entry):
            # A dataclass without a docstring gets its signature for one.
            assert entry.__doc__, name
            assert not entry.__doc__.startswith(f"{name}("), name
        else:
            assert name in reference, name


def test_the_package_says_how_it_is_used():
    assert "islands.read_record(" in islands.__doc__
    assert "islands.fit(" in islands.__doc__


def test_the_facades_are_among_the_public_names():
    assert islands.identify is identify
    assert islands.fit is fit


def test_the_version_is_that_of_the_distribution():
    assert islands.__version__ == version("islands")
