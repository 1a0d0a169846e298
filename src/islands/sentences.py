"""Sentences from templates over facts: wording in ``templates/``, quantities and decisions in the facts.

A block of a template is a statement: its text is empty where it does not hold. The first word of its name is
the group to which it belongs. The facts, with all limits, are made in the other packages.
"""

from collections.abc import Iterable, Iterator
from functools import cache, partial
from importlib.resources import files
from math import floor
from typing import TYPE_CHECKING, Any

from islands.errors import name_option
from islands.progress import Failure, attempt

if TYPE_CHECKING:
    from jinja2 import Environment, Template


def write(template: str, group: str, /, **facts: Any) -> list[str]:
    """Return the lines of the statements of a group that hold; the line of one that fails says so.

    Parameters
    ----------
    template : str
        Name of a template.
    group : str
        First words of the names of the blocks, or the name of one block.
    **facts
        Variables of the template.
    """
    named = write_named(template, group, **facts)
    return [line for _, text in named for line in text.splitlines()]


def write_one(template: str, group: str, /, **facts: Any) -> str:
    """Return the text of the only statement of a group that holds; empty if none does."""
    return " ".join(write(template, group, **facts))


def write_named(template: str, group: str = "", /, **facts: Any) -> Iterator[tuple[str, str]]:
    """Yield name and text of each statement of a group that holds; an empty group has all of them."""
    loaded = _load().get_template(f"{template}.txt")
    for name in list_statements(template, group):
        text = attempt(partial(_render, loaded, name, facts))
        if isinstance(text, Failure):
            statement = (name.partition("_")[2] or name).replace("_", " ")
            yield name, f"(not computed: {statement}: {text.reason})"
        elif text:
            yield name, text


def list_statements(template: str, group: str = "") -> list[str]:
    """Return the names of the statements of a group; an empty group has all of them."""
    blocks = _load().get_template(f"{template}.txt").blocks
    return [name for name in blocks if f"{name}_".startswith(f"{group}_" if group else "")]


def write_amount(value: float, unit: str, digits: str = ".4g") -> str:
    """Write a value with its unit."""
    return f"{value:{digits}} {unit}".rstrip()


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
    from jinja2 import Environment, FunctionLoader, StrictUndefined, pass_context  # noqa: PLC0415 - takes 70 ms

    folder = files("islands") / "templates"
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
        "verb": lambda names, verb: f"{verb}{'s' * (len(names) == 1)}",
        # A share below a limit never shows the limit.
        "round_down": lambda share: f"{floor(100 * share) / 100:.2f}",
    }
    environment.globals |= {
        "option": name_option,
        # The statements of a group of the same template, with the same facts.
        "statements": pass_context(
            lambda context, group, **more: write(
                context.name.removesuffix(".txt"), group, **{**context.parent, **more}
            )
        ),
    }
    environment.globals["phrase"] = environment.get_template("phrases.txt").module
    return environment
