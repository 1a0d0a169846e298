"""Sentences from templates over facts: the wording is in ``templates/``, quantities and limits in the facts.

A block of a template is a statement: its text is empty where it does not hold. The first word of its name is
the group to which it belongs.
"""

from collections.abc import Iterable, Iterator
from functools import cache, partial
from importlib.resources import files
from math import floor
from typing import TYPE_CHECKING, Any

from islands.errors import name_option
from islands.progress import Failure, attempt
from islands.report.text.facts import BEFORE_REFIT, CERTAIN, write_amount
from islands.validation.predictable_residual import LARGEST_SHARE
from islands.validation.prediction_bands import LEVEL

if TYPE_CHECKING:
    from jinja2 import Environment, Template


def write(template: str, group: str, **facts: Any) -> list[str]:
    """Return the texts of the statements of a group that hold; the text of one that fails says so.

    Parameters
    ----------
    template : str
        Name of a file in ``templates/``.
    group : str
        First word of the names of the blocks, or the name of one block.
    **facts
        Variables of the template.
    """
    return [text for _, text in write_named(template, group, **facts)]


def write_named(template: str, group: str = "", **facts: Any) -> Iterator[tuple[str, str]]:
    """Yield name and text of each statement of a group that holds; an empty group has all of them."""
    loaded = _load().get_template(template)
    for name in loaded.blocks:
        if f"{name}_".startswith(f"{group}_" if group else ""):
            text = attempt(partial(_render, loaded, name, facts))
            if isinstance(text, Failure):
                yield name, f"(not computed: {name.removeprefix(f'{group}_')}: {text.reason})"
            elif text:
                yield name, text


def _render(template: "Template", block: str, facts: dict[str, Any]) -> str:
    text = "".join(template.blocks[block](template.new_context(facts)))
    return "\n".join(" ".join(filter(None, line.split(" "))) for line in text.split("\n")).strip()


def _list_names(names: Iterable[str]) -> str:
    """Write names as a list: ``A, B and C``."""
    *others, last = dict.fromkeys(names) or ("",)
    return f"{', '.join(others)} and {last}" if others else last


@cache
def _load() -> "Environment":
    """Return the environment of the templates, in which a line break of the source is a space."""
    from jinja2 import Environment, FunctionLoader, StrictUndefined  # noqa: PLC0415 - takes 70 ms

    folder = files("islands.report.text") / "templates"
    environment = Environment(
        loader=FunctionLoader(
            lambda name: " ".join(map(str.strip, (folder / name).read_text(encoding="utf-8").splitlines()))
        ),
        undefined=StrictUndefined,
    )
    environment.filters |= {
        "amount": write_amount,
        "counted": lambda count, noun: f"{count} {noun}{'s' * (count != 1)}",
        "digits": lambda value, count: float(f"{value:.{count}g}"),
        "effect_label": lambda effect, facts: facts.label_effect(effect),
        "form": format,
        "listed": _list_names,
        "label": lambda name, facts: facts.label(name),
        "percent": lambda share: f"{100 * share:.0f} %",
        # A share below a limit never shows the limit.
        "round_down": lambda share: f"{floor(100 * share) / 100:.2f}",
    }
    environment.globals |= {
        "BEFORE_REFIT": BEFORE_REFIT,
        "BAND": f"{100 * LEVEL:g} %",
        "CERTAIN": CERTAIN,
        "LARGEST_SHARE": LARGEST_SHARE,
        "option": name_option,
    }
    environment.globals["phrase"] = environment.get_template("phrases.txt").module
    return environment
