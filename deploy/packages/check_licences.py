"""Check that every locked package has a licence of `licences.toml`; print each that has not.

    python deploy/packages/check_licences.py [--policy FILE] [--lock LOCK]

Reads the metadata of the installed packages only; nothing leaves the machine.
"""

import argparse
import sys
import tomllib
from pathlib import Path
from typing import Any

from locked_packages import LOCK, normalise, read_image, read_licences, read_lock


def find_faults(licences: dict[str, str], image: set[str], policy: dict[str, Any]) -> list[str]:
    """Return a sentence for each package without an accepted licence and for each superfluous exception.

    Parameters
    ----------
    licences : dict
        Licences by normalised name of the package.
    image : set of str
        Names of the packages that the image contains.
    policy : dict
        Content of `licences.toml`.
    """
    allowed = set(policy["allowed"])
    exceptions = {
        group: {normalise(name): each["licence"] for name, each in policy.get(group, {}).items()}
        for group in ("image", "elsewhere")
    }
    faults = []
    for name, licence in sorted(licences.items()):
        group = "image" if name in image else "elsewhere"
        if licence not in allowed and exceptions[group].get(name) != licence:
            place = "is in the image" if name in image else "is not in the image"
            faults.append(f"{name} ({place}): {licence} is not an accepted licence")
    for group, names in exceptions.items():
        for name, licence in names.items():
            if licences.get(name) != licence or (name in image) != (group == "image"):
                faults.append(
                    f"{group}.{name}: no such package has the licence {licence}; remove the exception"
                )
    return faults


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--policy", type=Path, default=Path(__file__).with_name("licences.toml"))
    parser.add_argument("--lock", type=Path, default=LOCK)
    arguments = parser.parse_args()
    packages = read_lock(arguments.lock)
    image = read_image(packages)
    faults = find_faults(
        read_licences(packages), set(image), tomllib.loads(arguments.policy.read_text("utf-8"))
    )
    if faults:
        print(
            *faults, f"accepted licences and exceptions: {arguments.policy.name}", sep="\n", file=sys.stderr
        )
        sys.exit(1)
    print(f"licences accepted: {len(packages)} packages, {len(image)} of them in the image")


if __name__ == "__main__":
    main()
