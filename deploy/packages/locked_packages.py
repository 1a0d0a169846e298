"""Packages of a lock file of pip-compile, and the licences that their installed metadata states."""

import json
import re
import subprocess
import sys
import sysconfig
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[2]

#: Lock file of everything: the packages of the service, of all extras, and of the development tools.
ALL = ROOT / "requirements.lock"

#: Lock file of what the image contains.
IMAGE = ROOT / "deploy/requirements.lock"

_ENTRY = re.compile(r"^([\w.-]+)==(\S+)[^\n]*\n((?:[ #][^\n]*\n?)*)", re.MULTILINE)


class LockedPackage(NamedTuple):
    """Package of a lock file.

    Attributes
    ----------
    name, version : str
        The name is normalised: lower case, with hyphens.
    needed_by : tuple of str
        Names of the packages that require it; "islands" for a direct requirement.
    hashes : tuple of str
        SHA-256 of the files that may be installed.
    """

    name: str
    version: str
    needed_by: tuple[str, ...]
    hashes: tuple[str, ...]


def normalise(name: str) -> str:
    """Return the normalised name of a package."""
    return re.sub(r"[-_.]+", "-", name).lower()


def read_lock(path: Path) -> dict[str, LockedPackage]:
    """Return the packages of a lock file by name."""
    packages = {}
    for name, version, rest in _ENTRY.findall(path.read_text("utf-8")):
        comments = re.findall(r"^\s+#(?: via)?\s+([\w.-]+)", rest, re.MULTILINE)
        needed_by = tuple(sorted({normalise(each) for each in comments if each not in ("via", "-c", "-r")}))
        hashes = tuple(re.findall(r"--hash=sha256:([0-9a-f]+)", rest))
        packages[normalise(name)] = LockedPackage(normalise(name), version, needed_by, hashes)
    return packages


def find_program(name: str) -> str:
    """Return the path of a program of this environment."""
    return str(Path(sysconfig.get_path("scripts")) / name)


def read_licences(packages: dict[str, LockedPackage]) -> dict[str, str]:
    """Return the licence of each package, as the installed package states it.

    Raises
    ------
    SystemExit
        A package is not installed in the locked version, so that its licence is unknown.
    """
    command = [find_program("pip-licenses"), "--from=mixed", "--format=json", "--with-system"]
    done = subprocess.run(
        [*command, "--packages", *packages], capture_output=True, text=True, encoding="utf-8", check=True
    )
    found = {normalise(each["Name"]): each for each in json.loads(done.stdout)}
    absent = [
        f"{name} {package.version}"
        for name, package in packages.items()
        if found.get(name, {}).get("Version") != package.version
    ]
    if absent:
        sys.exit(f"not installed in the locked version: {', '.join(absent)}; run: make setup")
    return {name: found[name]["License"] for name in packages}
