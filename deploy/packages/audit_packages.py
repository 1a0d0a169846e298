"""Look the locked packages up in a database of known vulnerabilities.

    python deploy/packages/audit_packages.py [--lock LOCK] [options of pip-audit]

Exit code 0: every package was checked, and none has a known vulnerability. 1: a vulnerability was found.
2: not checked, or not completely, for example because no service is reachable. This sends the names and
versions of the packages to the service; nothing else leaves the machine.
"""

import argparse
import json
import subprocess
import sys
from pathlib import Path

from locked_packages import LOCK, LockedPackage, find_program, normalise, read_image, read_lock


def query(lock: Path, options: list[str]) -> list[dict]:
    """Return the entry of each package of a lock file, as `pip-audit` reports it.

    Raises
    ------
    SystemExit
        No service answered.
    """
    command = [find_program("pip-audit"), "--disable-pip", "--format=json", "--progress-spinner=off"]
    done = subprocess.run(
        [*command, "--requirement", lock, *options],
        capture_output=True,
        text=True,
        encoding="utf-8",
        check=False,
    )
    try:
        entries: list[dict] = json.loads(done.stdout)["dependencies"]
    except ValueError:
        reason = (done.stderr.strip().splitlines() or ["pip-audit reported nothing"])[-1]
        print(f"not checked: no vulnerability service answered\n{reason}", file=sys.stderr)
        sys.exit(2)
    return entries


def report(packages: dict[str, LockedPackage], image: set[str], entries: list[dict]) -> int:
    """Print what is known of each package; return the exit code.

    Parameters
    ----------
    packages : dict
        Locked packages by name.
    image : set of str
        Names of the packages that the image contains.
    entries : list of dict
        Entries of `pip-audit`. A package that the service does not know has no field "vulns".
    """
    found = {normalise(each["name"]): each.get("vulns") for each in entries}
    for name, package in packages.items():
        for each in found.get(name) or ():
            place = "in the image" if name in image else "not in the image"
            repair = (
                f"repaired in {', '.join(each['fix_versions'])}" if each["fix_versions"] else "not repaired"
            )
            print(f"{name} {package.version} ({place}): {each['id']}, {repair}")
    unchecked = [name for name in packages if found.get(name) is None]
    if unchecked:
        names = ", ".join(unchecked[:5]) + ", ..." * (len(unchecked) > 5)
        share = f"{len(unchecked)} of {len(packages)} packages"
        print(f"not checked: {share}, which the service does not know: {names}", file=sys.stderr)
    if any(found.get(name) for name in packages):
        return 1
    if unchecked:
        return 2
    print(f"checked: {len(packages)} packages, none has a known vulnerability")
    return 0


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--lock", type=Path, default=LOCK)
    arguments, options = parser.parse_known_args()
    entries = query(arguments.lock, options)
    packages = read_lock(arguments.lock)
    sys.exit(report(packages, set(read_image(packages)), entries))


if __name__ == "__main__":
    main()
