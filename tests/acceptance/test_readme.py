"""Commands of the README, run in their order in an empty folder, and the outputs that it shows."""

import re
import shlex
import shutil
import subprocess
import sys
from contextlib import chdir
from pathlib import Path

import pytest
from command_outputs import PAGES, update

import islands
from islands.persistence.models import read_model
from support import pages
from support.command_line import succeed
from support.repository import DOCS
from support.undrawn import undrawn_figures

README = Path(__file__).parents[2] / "README.md"

#: The first steps show output of two commands of the README.
FIRST_MODEL = DOCS / "getting-started/first-model.md"

#: Commands with separate tests: they start services, or search for half a minute.
ELSEWHERE = ("identify", "serve", "jobs")


def read_commands(page: Path) -> list[list[str]]:
    lines = re.findall(r"^ {4}islands (.*)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    words = [shlex.split(line, comments=True) for line in lines]
    return [each for each in words if each[0] not in ELSEWHERE]


@pytest.mark.ci
def test_every_command_runs_and_the_shown_outputs_are_those_of_the_commands(tmp_path: Path) -> None:
    """The figures are not laid out. ``python docs/_scripts/command_outputs.py`` writes the outputs."""
    text = README.read_text(encoding="utf-8")
    outputs: dict[str, str] = {}

    def run(command: str) -> str:
        if command not in outputs:
            outputs[command] = succeed(*shlex.split(command))
        return outputs[command]

    with chdir(tmp_path), undrawn_figures():
        commands = read_commands(README)
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
                run(shlex.join(words))
        for page in PAGES:
            shown = page.read_text(encoding="utf-8")
            assert update(shown, run) == shown
        check_first_model(FIRST_MODEL)
        assert read_model(Path("motor/models/01.json")).input_names == ("drive_V",)
        (program,) = re.findall(r"^```python\n(.*?)^```", text, re.M | re.S)
        Path("program.py").write_text(program, encoding="utf-8")
        subprocess.run([sys.executable, "program.py"], check=True, timeout=120)


def check_first_model(page: Path) -> None:
    """Compare the record and the program of a page with those in the current folder."""
    record, *_ = (code for language, code in pages.blocks(page) if language == "text")
    assert Path("motor.csv").read_text(encoding="utf-8").startswith(record)
    (program,) = (code for language, code in pages.blocks(page) if language == "c")
    assert program in islands.load("motor").export("c")
