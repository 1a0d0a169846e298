"""Packages of the lock file, those of the image, and the licences that their installed metadata states."""

import json
import re
import subprocess
import sys
import sysconfig
import tomllib
from importlib import metadata
from pathlib import Path
from typing import NamedTuple

from packaging.requirements import Requirement

ROOT = Path(__file__).parents[2]

#: Lock file: the packages of the service, of all extras, and of the development tools.
LOCK = ROOT / "requirements.lock"

#: Extra of what the image contains.
IMAGE_EXTRA = "server"

_ENTRY = re.compile(r"^([\w.-]+)==(\S+)[^\n]*\n((?:[ #][^\n]*\n?)*)", re.MULTILINE)


class LockedPackage(NamedTuple):
    """Package of a lock file.

    Attributes
    ----------
    name, version : str
        The name is normalised: lower case, with hyphens.
    needed_by : tuple of str
        Names of the packages that require it; that of the project for a direct requirement.
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


def read_image(packages: dict[str, LockedPackage]) -> dict[str, LockedPackage]:
    """Return those of the locked packages that the image contains.

    They follow from the requirements that the installed packages state, since the lock file does not tell
    which extra of a package requires another one.
    """
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    extras = {extra: list(map(Requirement, each)) for extra, each in project["optional-dependencies"].items()}
    own = normalise(project["name"])
    left = [*map(Requirement, project["dependencies"]), Requirement(f"{own}[{IMAGE_EXTRA}]")]
    found: set[tuple[str, str]] = set()
    while left:
        requirement = left.pop()
        name = normalise(requirement.name)
        for extra in {"", *requirement.extras}:
            if (name, extra) not in found:
                found.add((name, extra))
                left += extras.get(extra, []) if name == own else _find_requirements(name, extra)
    names = {name for name, _ in found}
    return {name: package for name, package in packages.items() if name in names}


def _find_requirements(name: str, extra: str) -> list[Requirement]:
    """Return what an installed package requires for an extra, or without one."""
    requirements = map(Requirement, metadata.requires(name) or ())
    return [each for each in requirements if each.marker is None or each.marker.evaluate({"extra": extra})]


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
        sys.exit(f"not installed in the locked version: {', '.join(absent)}; run: make licences")
    return {name: found[name]["License"] for name in packages}
