"""Install locked packages into a virtual environment, with verified hashes.

    python3 deploy/packages/install.py .venv --extra service --group build --project

Extras and groups are those of `pyproject.toml`. `requirements.lock` has the version and the hashes of each
package, also of those that others require; a package that it does not name is refused. The environment is
created if it does not exist. uv installs the packages; pip installs uv in its locked version, unless it is
installed beside the running Python. With ``--pip``, pip installs all packages of the lock file instead.
``--project`` adds the packages of this checkout, and the bytecode of the modules that their commands load.

This program needs nothing but Python, since it runs before anything is installed.
"""

import argparse
import os
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).parents[2]
LOCK = ROOT / "requirements.lock"
PROJECT = ROOT / "pyproject.toml"

#: Oldest Python that the project supports.
PYTHON = (3, 11)


def create_environment(environment: Path) -> Path:
    """Create the virtual environment if it does not exist; return the path of its Python."""
    python = environment / "bin" / "python"
    if not python.exists():
        run([sys.executable, "-m", "venv", environment], f"creating {environment}")
    return python


def install_uv(python: Path) -> Path:
    """Return the path of uv in its locked version; install it into the environment if it is absent."""
    entry = re.search(r"^uv==(\S+)(?:.*\\\n)+.*\n", LOCK.read_text("utf-8"), re.MULTILINE)
    if entry is None:
        sys.exit(f"{LOCK} does not lock uv: run make lock")
    for program in (Path(sys.executable).with_name("uv"), python.with_name("uv")):
        if program.exists() and installed_version(program) == entry[1]:
            return program
    with tempfile.NamedTemporaryFile("w", suffix=".txt") as requirement:
        requirement.write(entry[0])
        requirement.flush()
        options = ["--require-hashes", "--no-deps", "--disable-pip-version-check"]
        command = [python, "-m", "pip", "install", *options, "--requirement", requirement.name]
        run(command, f"installing uv {entry[1]}")
    return python.with_name("uv")


def installed_version(program: Path) -> str:
    """Return the version of an installed uv."""
    done = subprocess.run([program, "--version"], capture_output=True, text=True, check=False)
    return done.stdout.split()[1] if done.returncode == 0 else ""


def run(command: list[str | Path], title: str) -> None:
    """Run a command, with one line of progress: the title, and on a terminal the last line of the command.

    Raises
    ------
    SystemExit
        The command failed; its whole output is printed.
    """
    began, lines = time.monotonic(), []
    show(title)
    # uv reads its settings from the project of the working folder.
    with subprocess.Popen(
        command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    ) as process:
        for line in process.stdout or ():
            lines.append(line)
            if not line.startswith(" + "):
                show(f"{title}: {line.strip()}")
    if process.returncode != 0:
        show("")
        print(*lines, sep="", file=sys.stderr)
        sys.exit(f"{title} failed")
    if sys.stdout.isatty():
        show("")
    print(f"{title}: {time.monotonic() - began:.0f} s", flush=True)


def show(text: str) -> None:
    """Replace the line of the terminal; without a terminal nothing is shown."""
    if sys.stdout.isatty():
        print(f"\r\033[K{text[:100]}", end="", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("environment", type=Path)
    parser.add_argument("--extra", action="append", default=[], help="extra of pyproject.toml")
    parser.add_argument("--group", action="append", default=[], help="group of pyproject.toml")
    parser.add_argument("--tools", action="store_true", help="install the groups only")
    parser.add_argument("--pip", action="store_true", help="install all packages, by pip")
    parser.add_argument("--project", action="store_true", help="install the sources, editable")
    arguments = parser.parse_args()
    if sys.version_info < PYTHON:
        sys.exit(f"islands needs Python 3.11 or newer, not {sys.version.split()[0]}: make PYTHON=python3.11")
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)  # of set-up, and not of each start
    python = create_environment(arguments.environment.absolute())
    if arguments.pip:
        install = [python, "-m", "pip", "install", "--disable-pip-version-check"]
        # The lock file is complete. Without --no-deps pip refuses what [tool.uv] overrides.
        options = ["--require-hashes", "--no-deps", "--no-compile", "--requirement", LOCK]
        run([*install, *options], "installing all packages")
    else:
        install = [install_uv(python), "pip", "install", "--python", python]
        chosen = [f"--group={PROJECT}:{name}" for name in arguments.group]
        if not arguments.tools:
            chosen += [f"--requirement={PROJECT}", *(f"--extra={name}" for name in arguments.extra)]
        title = f"installing packages ({', '.join(arguments.extra + arguments.group) or 'core'})"
        run([*install, "--require-hashes", "--constraint", LOCK, *chosen], title)
    if arguments.project:
        run([*install, "--no-build-isolation", "--no-deps", "--editable", ROOT], "installing islands")
        run([python, Path(__file__).with_name("compile_modules.py")], "compiling modules")


if __name__ == "__main__":
    main()
