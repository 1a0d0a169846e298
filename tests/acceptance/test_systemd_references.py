"""Names in the unit of systemd and in its guide lead to programs, folders, files and settings that exist."""

import re
import shlex
import tomllib
from collections import defaultdict
from collections.abc import Iterator, Sequence
from itertools import chain
from typing import NamedTuple

import pytest
from pydantic import ValidationError
from typer.main import get_command

from islands_api.cli.app import app
from islands_service.settings import ServiceSettings
from support.repository import ROOT

pytestmark = pytest.mark.ci

UNIT = ROOT / "deploy/systemd/islands.service"
GUIDE = ROOT / "docs/how-to/deploy-with-systemd.md"

SCRIPTS = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["scripts"]

#: Units of systemd itself.
STANDARD = {"network-online.target", "multi-user.target"}


class Deployment(NamedTuple):
    """Unit and guide.

    Attributes
    ----------
    guide : str
    settings : dict
        Words of each setting of the unit.
    variables : dict
        Environment of the service.
    folders : dict
        Folders that the unit creates and the service may write to, by their names in the unit.
    commands : list
        Words of each command of the guide.
    calls : list
        Words of each call of the command line, that of the unit first.
    """

    guide: str
    settings: dict[str, list[str]]
    variables: dict[str, str]
    folders: dict[str, str]
    commands: list[list[str]]
    calls: list[list[str]]

    def expand(self, word: str) -> str:
        """Return a word of the unit with the paths of its folders."""
        for name, path in self.folders.items():
            word = word.replace(name, path)
        return word


def read_deployment(unit: str, guide: str) -> Deployment:
    settings = defaultdict(list)
    for name, value in re.findall(r"^(\w+)=(.*)$", unit, re.MULTILINE):
        settings[name] += value.split()
    code = "\n".join(re.findall(r"^```sh\n(.*?)^```", guide, re.DOTALL | re.MULTILINE)).replace("\\\n", "")
    commands = [words for line in code.splitlines() if (words := shlex.split(line, comments=True))]
    calls = [words[i:] for words in commands for i, word in enumerate(words) if word.endswith("/bin/islands")]
    (state,), (cache,) = settings["StateDirectory"], settings["CacheDirectory"]
    return Deployment(
        guide,
        settings,
        dict(word.split("=") for word in settings["Environment"]),
        {"${STATE_DIRECTORY}": f"/var/lib/{state}", f"%C/{cache}": f"/var/cache/{cache}"},
        commands,
        [settings["ExecStart"], *calls],
    )


def find_unknown_options(words: Sequence[str]) -> set[str]:
    """Return the options of a call of the command line that do not exist."""
    command, left = get_command(app), words[1:]
    while hasattr(command, "list_commands"):
        command, left = command.get_command(None, left[0]), left[1:]
    known = {name for parameter in command.params for name in parameter.opts}
    return {word for word in left if word.startswith("--")} - known


def find_wrong_calls(unit: Deployment) -> Iterator[str]:
    """Programs are scripts of the environment that the guide makes, and their options exist."""
    installer = ["python3", "deploy/packages/install.py"]
    (environment,) = {words[2] for words in unit.commands if words[:2] == installer}
    for words in unit.calls:
        if words[0] not in {f"{environment}/bin/{script}" for script in SCRIPTS}:
            yield f"program {words[0]}"
        yield from (f"option {each}" for each in find_unknown_options(words))


def find_wrong_folders(unit: Deployment) -> Iterator[str]:
    """The service and the commands of the guide write only to folders that the unit creates."""
    data = [words[words.index("--data-dir") + 1] for words in unit.calls if "--data-dir" in words]
    written = [unit.variables["ISLANDS_CACHE_DIR"], unit.variables["MPLCONFIGDIR"], *data]
    for path in map(unit.expand, written):
        if not any(f"{path}/".startswith(f"{folder}/") for folder in unit.folders.values()):
            yield f"folder {path}"


def find_wrong_properties(unit: Deployment) -> Iterator[str]:
    """Commands of the guide run with the user and the folders of the unit."""
    for word in chain(*(words for words in unit.commands if words[0] == "systemd-run")):
        name, _, value = word.removeprefix("--property=").partition("=")
        if word.startswith("--property=") and value not in unit.settings[name]:
            yield f"property {name}={value}"


def find_wrong_files(unit: Deployment) -> Iterator[str]:
    """The guide installs the unit, makes the folder of its settings, and names files of the repository."""
    installed = {words[-1] for words in unit.commands if words[0] == "install"}
    optional = [path.removeprefix("-") for path in unit.settings["EnvironmentFile"]]
    for path in (f"/etc/systemd/system/{UNIT.name}", *optional):
        if path not in unit.guide or not installed & {path, path.rpartition("/")[0]}:
            yield f"file {path}"
    for path in set(re.findall(r"\bdeploy/[\w./-]*\w", unit.guide)):
        if not (ROOT / path).exists():
            yield f"file {path}"


def find_wrong_settings(unit: Deployment) -> Iterator[str]:
    """Settings exist and have valid values; addresses in the guide have the port of the service."""
    given = {
        name.removeprefix("ISLANDS_").lower(): value
        for name, value in unit.variables.items()
        if name.startswith("ISLANDS_")
    }
    named = given.keys() | {name.lower() for name in re.findall(r"\bISLANDS_(\w+)", unit.guide)}
    yield from (f"setting {name}" for name in named - ServiceSettings.model_fields.keys() - {"cache_dir"})
    try:
        port = ServiceSettings(**given).port
    except ValidationError as error:
        yield str(error)
    else:
        for address in re.findall(r"http://(127\.0\.0\.1:\d+)", unit.guide):
            if address != f"127.0.0.1:{port}":
                yield f"address {address}"


def find_wrong_units(unit: Deployment) -> Iterator[str]:
    """Units are those of systemd, and this one."""
    for name in ("After", "Wants", "Requires", "BindsTo", "WantedBy"):
        yield from (f"unit {each}" for each in unit.settings[name] if each not in STANDARD)
    for words in unit.commands:
        if words[0] in {"systemctl", "journalctl"} and words[1] != "daemon-reload":
            name = next(word for word in words[2:] if not word.startswith("--"))
            if name != UNIT.stem:
                yield f"unit {name}"


RULES = (
    *(find_wrong_calls, find_wrong_folders, find_wrong_properties),
    *(find_wrong_files, find_wrong_settings, find_wrong_units),
)


def find_faults(unit: str, guide: str) -> list[str]:
    """Return a text for each name that leads nowhere."""
    deployment = read_deployment(unit, guide)
    return [fault for rule in RULES for fault in rule(deployment)]


def test_every_name_in_the_unit_and_in_its_guide_leads_somewhere():
    assert not find_faults(UNIT.read_text(), GUIDE.read_text())
