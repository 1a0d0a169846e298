"""Measurements of the project, which are in a checkout of its repository and not in the package."""

import sys
from importlib import import_module
from pathlib import Path
from types import ModuleType

from islands.errors import SettingsError

#: Folder of the measurements.
LABORATORY = Path(__file__).parents[3] / "lab"


def import_laboratory(name: str, feature: str) -> ModuleType:
    """Import a module of the laboratory.

    Parameters
    ----------
    name : str
    feature : str
        Command or option that needs the module.

    Raises
    ------
    SettingsError
        The package was not installed from a checkout.
    """
    if not (LABORATORY / "__init__.py").is_file():
        raise SettingsError(
            f"{feature} is part of the laboratory, which the installed package does not contain: run it in a "
            "checkout of the repository, after 'make setup'"
        )
    root = str(LABORATORY.parent)
    if root not in sys.path:
        sys.path.append(root)
    return import_module(name)
