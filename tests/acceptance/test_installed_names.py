"""No deployment guide installs the project by a name, which another project could register in an index."""

import re

import pytest

from support.repository import DOCS, ROOT

#: Guides and files with which servers are set up.
DEPLOYMENT = sorted(
    [
        *(DOCS / "how-to").glob("deploy-*.md"),
        ROOT / "deploy/Containerfile",
        *(ROOT / "deploy").rglob("*.service"),
    ]
)

#: Installation of a requirement that begins with the name of the project, and is no file.
BY_NAME = re.compile(r"\bpip install\b[^\n]*?[\s'\"](islands(?:\[[\w,]+\])?)(?=['\"\s]|$)", re.MULTILINE)


@pytest.mark.parametrize("path", DEPLOYMENT, ids=lambda path: path.name)
def test_a_server_is_not_installed_by_name(path):
    assert not BY_NAME.findall(path.read_text())


@pytest.mark.parametrize("command", ["pip install 'islands[service]'", "pip install --upgrade islands"])
def test_an_installation_by_name_is_found(command):
    assert BY_NAME.findall(command)
