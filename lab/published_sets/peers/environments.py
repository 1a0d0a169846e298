"""Virtual environments of the peers, each with one package of the index and its dependencies."""

import shutil
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from islands.errors import SettingsError, name_option
from islands.progress import Stop, StoppedError, never_stop
from lab.published_sets.peers.catalogue import Peer
from lab.published_sets.peers.limited_command import EndedCommand, run_command

#: File in a complete environment: its packages with their versions.
_PACKAGES = "packages.txt"

#: Runs a command with a log file; see `run_command`.
Run = Callable[[list[str | Path], Path, Callable[[float], bool]], EndedCommand]


@dataclass(frozen=True, slots=True)
class PeerEnvironment:
    """Environment of a peer.

    Attributes
    ----------
    python : Path
        Its interpreter.
    packages : tuple of str
        Packages with their versions.
    """

    python: Path
    packages: tuple[str, ...]


def prepare_environment(
    peer: Peer, folder: Path, stop: Stop = never_stop, run: Run = run_command
) -> PeerEnvironment:
    """Return the environment of a peer, and install it if it is not complete.

    Parameters
    ----------
    peer : Peer
    folder : Path
        Folder of all environments.
    stop : callable
        Once it returns true, the installation ends.
    run : callable
        Runs a command.

    Raises
    ------
    SettingsError
        The package cannot be installed.
    StoppedError
        The installation was stopped.
    """
    version = f"{sys.version_info.major}.{sys.version_info.minor}"
    place = folder.absolute() / f"{peer.package}-{peer.version}-python{version}"
    python, listed = place / "bin" / "python", place / _PACKAGES
    requirement = f"{peer.package}=={peer.version}"
    if not listed.is_file():
        shutil.rmtree(place, ignore_errors=True)  # the rest of an interrupted installation
        place.mkdir(parents=True)
        log = place / "install.log"
        pip: list[str | Path] = [python, "-m", "pip", "--disable-pip-version-check", "--no-input"]
        commands: tuple[list[str | Path], ...] = (
            [sys.executable, "-m", "venv", place],
            [*pip, "install", requirement],
            [*pip, "freeze"],
        )
        for command in commands:
            ended = run(command, log, lambda _wall_s: stop())
            if ended.is_stopped:
                raise StoppedError(f"install {requirement}")
            if ended.code != 0:
                message = read_last_line(log).removeprefix("ERROR: ")
                raise SettingsError(
                    f"pip cannot install {requirement} into {place}: {message}. {log} has all lines; name "
                    f"the other packages with {name_option('peer', example='NAME')} to leave this one out"
                )
        log.rename(listed)
    return PeerEnvironment(python, tuple(listed.read_text(encoding="utf-8").split()))


def read_last_line(log: Path) -> str:
    """Return the last line of a file that is not empty, without the period at its end."""
    lines = [line.strip() for line in log.read_text(encoding="utf-8", errors="replace").splitlines()]
    return next((line.rstrip(".") for line in reversed(lines) if line), "no message")
