"""Commands of the README, run in their order in an empty folder."""

import re
import shlex
import subprocess
import sys
from contextlib import chdir
from pathlib import Path

import pytest

from islands.io.models import read_model
from support.command_line import succeed

README = Path(__file__).parents[2] / "README.md"

#: Commands with separate tests: they start services, or search for half a minute.
ELSEWHERE = ("identify", "serve", "jobs")


def read_commands() -> list[list[str]]:
    lines = re.findall(r"^ {4}islands (.*)$", README.read_text(encoding="utf-8"), re.MULTILINE)
    words = [shlex.split(line, comments=True) for line in lines]
    return [each for each in words if each[0] not in ELSEWHERE]


@pytest.mark.ci
def test_every_command_runs_and_the_shown_equation_is_that_of_the_result(tmp_path: Path) -> None:
    shown = re.search(
        r"^speed_rad_s\(k\) =.*?\n\n", README.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL
    )
    assert shown is not None
    with chdir(tmp_path):
        commands = read_commands()
        assert {each[0] for each in commands} >= {
            "examples",
            "fit",
            "inspect",
            "simulate",
            "show",
            "diagnose",
        }
        for words in commands:
            succeed(*words)
        assert shown[0] in Path("motor/summary.txt").read_text(encoding="utf-8")
        assert read_model(Path("motor/models/01.json")).input_names == ("drive_V",)
        (program,) = re.findall(r"^```python\n(.*?)^```", README.read_text(encoding="utf-8"), re.M | re.S)
        Path("program.py").write_text(program, encoding="utf-8")
        subprocess.run([sys.executable, "program.py"], check=True, timeout=120)
