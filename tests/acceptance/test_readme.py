"""Commands of the README, run in their order in an empty folder."""

import re
import shlex
import shutil
import subprocess
import sys
from contextlib import chdir
from pathlib import Path

import pytest

from islands.io.models import read_model
from support.command_line import succeed
from support.undrawn import undrawn_figures

README = Path(__file__).parents[2] / "README.md"

#: Commands with separate tests: they start services, or search for half a minute.
ELSEWHERE = ("identify", "serve", "jobs")


def read_commands() -> list[list[str]]:
    lines = re.findall(r"^ {4}islands (.*)$", README.read_text(encoding="utf-8"), re.MULTILINE)
    words = [shlex.split(line, comments=True) for line in lines]
    return [each for each in words if each[0] not in ELSEWHERE]


@pytest.mark.ci
def test_every_command_runs_and_the_shown_equation_is_that_of_the_result(tmp_path: Path) -> None:
    """The figures are not laid out."""
    shown = re.search(
        r"^speed_rad_s\(k\) =.*?\n\n", README.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL
    )
    assert shown is not None
    with chdir(tmp_path), undrawn_figures():
        commands = read_commands()
        assert {each[0] for each in commands} >= {
            "examples",
            "fit",
            "inspect",
            "simulate",
            "show",
            "diagnose",
        }
        folders: dict[tuple[str, ...], str] = {}
        for words in commands:
            *command, last = words
            if command[-1:] == ["--out"] and (known := folders.setdefault((*command,), last)) != last:
                shutil.copytree(known, last)  # the same command with another folder
            else:
                succeed(*words)
        assert shown[0] in Path("motor/summary.txt").read_text(encoding="utf-8")
        assert read_model(Path("motor/models/01.json")).input_names == ("drive_V",)
        (program,) = re.findall(r"^```python\n(.*?)^```", README.read_text(encoding="utf-8"), re.M | re.S)
        Path("program.py").write_text(program, encoding="utf-8")
        subprocess.run([sys.executable, "program.py"], check=True, timeout=120)
