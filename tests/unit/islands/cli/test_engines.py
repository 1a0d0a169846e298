"""Choice of the engine of a search for which none is given."""

import sys

import pytest

from islands.cli.engines import default_engine


@pytest.mark.parametrize(
    ("islands", "address", "is_installed", "expected"),
    [
        (1, None, True, "serial"),
        (2, None, True, "ray"),
        (2, None, False, "serial"),
        (1, "head:6379", True, "ray"),
        # The address was given for a reason: the error names the missing package.
        (2, "head:6379", False, "ray"),
    ],
)
def test_several_islands_run_on_ray_if_it_is_installed(islands, address, is_installed, expected, monkeypatch):
    if not is_installed:
        monkeypatch.setitem(sys.modules, "ray", None)
    assert default_engine(islands, address) == expected
