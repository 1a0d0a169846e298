"""Help of the command line: it describes every command without importing it."""

import subprocess
import sys
import tomllib
from importlib.metadata import packages_distributions

import pytest

from islands.cli.app import EXTRAS
from support.repository import ROOT


def test_the_help_imports_no_command():
    program = (
        "import sys; from typer.testing import CliRunner; from islands_api.cli.app import app;"
        "print('examples' in CliRunner().invoke(app, ['--help']).output);"
        "print([name for name in sys.modules if '.cli.commands.' in name]);"
        "print([name for name in sys.modules if name.partition('.')[0] == 'lab']);"
        "print({'numpy', 'numba', 'ray', 'pydantic'} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines() == ["True", "[]", "[]", "set()"]


@pytest.mark.ci
def test_every_package_of_an_extra_is_known():
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    modules = {}
    for module, distributions in packages_distributions().items():
        for each in distributions:
            modules.setdefault(each.lower().replace("_", "-"), set()).add(module)
    for extra in ("ray", "service"):
        for requirement in extras[extra]:
            name = requirement.partition(">=")[0].lower()
            assert modules[name] & set(EXTRAS), requirement
