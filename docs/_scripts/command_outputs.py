"""Outputs of commands in the README and in "First model".

``python docs/_scripts/command_outputs.py`` runs the commands, writes the outputs, and draws the gallery.

A block of text below the command of a fit or of a diagnosis is an excerpt of its output: the paragraphs with
the same first two words, and ``...`` for others.
"""

import re
import shlex
import subprocess
import sys
from collections.abc import Callable
from contextlib import chdir
from pathlib import Path
from tempfile import TemporaryDirectory

from gallery import draw_gallery

import islands
from islands.systems.example_records import EXAMPLE_RECORDS

ROOT = Path(__file__).parents[2]

#: Pages with outputs; their commands use the same folders.
PAGES = (ROOT / "README.md", ROOT / "docs" / "getting-started" / "first-model.md")

#: Commands whose output is shown.
_SHOWN = ("fit ", "diagnose ")

#: Number of terms up to which the gallery shows an equation.
_SHORT = 4

#: A command, or a block of text.
_PART = re.compile(r"^    islands (?P<command>[^#\n]*)|^```text\n(?P<excerpt>.*?)^```$", re.M | re.S)

#: Row of the gallery: example, command and law; the equation and the error that are found.
_ROW = re.compile(r"^(\| [^|]+ \| `islands (fit [^|`]+)` \| [^|]+ \|) [^|]+ \| [^|]+ \|$", re.M)


def update(text: str, run: Callable[[str], str]) -> str:
    """Return a page with the outputs of its commands.

    Parameters
    ----------
    text : str
    run : callable
        Return the output of a command without the name of the program. Its files are in the current folder.
    """
    command = ""

    def write_excerpt(match: re.Match[str]) -> str:
        nonlocal command
        if match["command"]:
            command = match["command"].strip()
        elif command.startswith(_SHOWN):
            # Figures do not change the output.
            return f"```text\n{quote(run(command.replace(' --figures all', '')), match['excerpt'])}```"
        return match[0]

    def write_row(match: re.Match[str]) -> str:
        run(match[2])
        words = shlex.split(match[2])
        best = load_result(words[words.index("--out") + 1]).best
        return f"{match[1]} {describe_equation(best)} | {describe_error(best)} |"

    return _ROW.sub(write_row, _PART.sub(write_excerpt, text))


def quote(output: str, excerpt: str) -> str:
    """Return the paragraphs of an output that an excerpt has, and ``...`` for those between and behind."""
    shown = [name for name, _ in split_paragraphs(excerpt) if name != "..."]
    parts = [text if name in shown else "...\n" for name, text in split_paragraphs(output)]
    if missing := {*shown}.difference(name for name, _ in split_paragraphs(output)):
        raise ValueError(f"the output has no paragraph {missing}: change the block of the page")
    text = re.sub(r"(\.\.\.\n)+", "...\n", "".join(parts))
    return text.removeprefix("...\n")


def split_paragraphs(text: str) -> list[tuple[str, str]]:
    """Return the first two words and the text of every paragraph: its first line is not indented."""
    found = re.findall(r"^\S.*\n(?:(?: .*)?\n)*", text, re.M)
    return [(" ".join(each.split()[:2]), each) for each in found]


def load_result(folder: str) -> islands.Result:
    """Load a result that a command has saved."""
    found = islands.load(folder)
    assert isinstance(found, islands.Result)
    return found


def describe_equation(best: islands.FittedModel) -> str:
    """Return a short equation with four digits, the number of its terms, or what a state space is."""
    model = best.model
    if not isinstance(model, islands.Model):
        curves = [f"order {model.order} with a curve: {unit}" for unit in model.units]
        return "; ".join([*curves, *best.linearise().describe()])
    if model.size > _SHORT:
        return f"{model.size} terms"
    terms = zip(model.parameters, model.equation().terms, strict=True)
    return f"`{' + '.join(f'{parameter:.4g}*{term}' for parameter, term in terms).replace('+ -', '- ')}`"


def describe_error(best: islands.FittedModel) -> str:
    """Return the mean absolute error of the free run on the validation data."""
    return f"{best.metrics['validation']['free_run'].mape:.2g} %"


def main() -> None:
    """Run the commands in an empty folder, and write the pages and the picture."""
    outputs: dict[str, str] = {}

    def run(command: str) -> str:
        if command not in outputs:
            words = [sys.executable, "-m", "islands", *shlex.split(command)]
            outputs[command] = subprocess.run(words, check=True, capture_output=True, text=True).stdout
        return outputs[command]

    with TemporaryDirectory() as folder, chdir(folder):
        run("examples .")
        for page in PAGES:
            page.write_text(update(page.read_text("utf-8"), run), encoding="utf-8")
        draw_gallery({name: load_result(name) for name in EXAMPLE_RECORDS})


if __name__ == "__main__":
    main()
