"""Generated reference of the Python interfaces: the public names of ``islands`` and of ``islands_api``."""

from types import ModuleType

from tables import page, section

import islands
import islands_api


def python() -> str:
    """Return the page of the package ``islands``."""
    return page(
        "Python API",
        "The public names of the package `islands`.",
        *_groups(islands),
    )


def client() -> str:
    """Return the page of the package ``islands_api``."""
    return page(
        "Python client",
        "The public names of the package `islands_api`: clients of a running service.",
        *_groups(islands_api),
    )


def _groups(package: ModuleType) -> list[str]:
    groups: dict[str, list[str]] = {"Functions": [], "Classes": [], "Errors": [], "Tables": []}
    for name in package.__all__:
        groups[_kind(getattr(package, name))].append(f"::: {package.__name__}.{name}")
    return [section(title, *found) for title, found in groups.items() if found]


def _kind(entry: object) -> str:
    if isinstance(entry, type):
        return "Errors" if issubclass(entry, Exception) else "Classes"
    return "Functions" if callable(entry) else "Tables"
