"""All regular expressions of the sources, and texts for which backtracking takes most time.

A new expression is tested as well: it is found in the syntax tree of its module. The texts follow from the
structure of the expression: the text of a repetition, many times, between the text that precedes it and a
character with which the match fails.
"""

import ast
import importlib
import random
import re
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import product
from pathlib import Path
from re import _constants as codes
from re import _parser as parser
from types import ModuleType
from typing import Any

from support.repository import ROOT

#: Folders of the sources, each with one package.
FOLDERS = ("src", "services", "measurements", "api")

#: Position of the argument with the flags, by function.
FLAGS = {"compile": 1, "search": 2, "match": 2, "fullmatch": 2, "findall": 2, "finditer": 2}
FLAGS |= {"split": 3, "sub": 4, "subn": 4}

#: Variables of functions that hold an expression: for the text of equations, not of users.
VARIABLES = {"pattern", "law"}

#: Largest growth of the time when the length of a text doubles.
LARGEST_RATIO = 2.2

#: Lengths of texts. They grow slowly at first: the time of some expressions doubles with each character.
_LENGTHS = (12, 17, 24, 34, 48, 68, 96, 192, 384, 768, 1536)

#: Seconds from which on the growth is measured; at the last of the lengths, a match in linear time takes
#: a tenth.
_SUSPICIOUS, _MEASURABLE = 5e-4, 1e-3

#: Longest text whose time is measured, and the length of a text that is hopeless if its time is measurable.
_LONGEST, _SHORT = 1 << 20, 96

#: Growth that needs no further measurement, and seconds of a match that is not repeated.
_HOPELESS, _LONG = 6.0, 0.5

#: Characters of each category, and others of which at least one does not match most classes.
_CATEGORIES = {codes.CATEGORY_DIGIT: "3", codes.CATEGORY_SPACE: " ", codes.CATEGORY_WORD: "a"}
_OTHERS = "a3 -."

#: Expressions of the categories.
_SPELLINGS = {
    codes.CATEGORY_DIGIT: r"\d",
    codes.CATEGORY_NOT_DIGIT: r"\D",
    codes.CATEGORY_SPACE: r"\s",
    codes.CATEGORY_NOT_SPACE: r"\S",
    codes.CATEGORY_WORD: r"\w",
    codes.CATEGORY_NOT_WORD: r"\W",
}

#: Repetitions, and the number of them up to which their time is bounded.
_REPETITIONS, _FEW = {codes.MAX_REPEAT, codes.MIN_REPEAT, codes.POSSESSIVE_REPEAT}, 300

#: Random texts per repetition, and characters of the expression that are tried alone.
_SAMPLES, _MOST_CHARACTERS = 6, 8


@dataclass(frozen=True, slots=True)
class Expression:
    """A regular expression in a source file.

    Attributes
    ----------
    place : str
        File and line.
    pattern : re.Pattern
    methods : frozenset of str
        Methods by which it is used.
    """

    place: str
    pattern: re.Pattern[Any]
    methods: frozenset[str]

    def __str__(self) -> str:
        return self.place


def list_expressions(folder: str = "") -> list[Expression]:
    """Return the regular expressions of all sources, or of those in one folder of the repository."""
    return [
        found
        for root in FOLDERS
        for path in sorted((ROOT / root).rglob("*.py"))
        if path.is_relative_to(ROOT / folder)
        and "import re\n" in (source := path.read_text(encoding="utf-8"))
        for found in _find_expressions(path, ast.parse(source), ROOT / root)
    ]


def _find_expressions(path: Path, tree: ast.Module, folder: Path) -> Iterator[Expression]:
    module = importlib.import_module(".".join(path.relative_to(folder).with_suffix("").parts))
    owners = {id(node.value): node.targets[0] for node in ast.walk(tree) if isinstance(node, ast.Assign)}
    for node in ast.walk(tree):
        match node:
            case ast.Call(func=ast.Attribute(value=ast.Name(id="re"), attr=name)) if name in FLAGS:
                text = _evaluate(node.args[0], module)
                if text is None:
                    assert _name_of(node.args[0]) in VARIABLES, (
                        f"{path}: name the expression in line {node.lineno}"
                    )
                    continue
                given = [
                    *node.args[FLAGS[name] :],
                    *(each.value for each in node.keywords if each.arg == "flags"),
                ]
                flags = _evaluate(given[0], module) if given else 0
                methods = {name} if name != "compile" else _list_methods(tree, owners.get(id(node)))
                yield Expression(
                    f"{path.relative_to(ROOT)}:{node.lineno}", re.compile(text, flags), frozenset(methods)
                )


def _name_of(node: ast.expr) -> str:
    return node.id if isinstance(node, ast.Name) else ""


def _evaluate(node: ast.expr, module: ModuleType) -> Any:
    """Return the value of an argument; None if it is a variable of a function.

    A variable within a text is the word ``name``.
    """
    if isinstance(node, ast.JoinedStr):
        return "".join(
            str(part.value)
            if isinstance(part, ast.Constant)
            else str(_evaluate(part.value, module) or "name")
            for part in node.values
            if isinstance(part, ast.Constant | ast.FormattedValue)
        )
    try:
        return eval(compile(ast.Expression(node), module.__name__, "eval"), vars(module))
    except NameError:
        return None


def _list_methods(tree: ast.Module, target: ast.expr | None) -> set[str]:
    """Return the methods that a module calls of a compiled expression, by name or else of any."""
    methods = {
        node.attr
        for node in ast.walk(tree)
        if isinstance(node, ast.Attribute)
        and isinstance(node.value, ast.Name)
        and isinstance(target, ast.Name)
        and node.value.id == target.id
        and node.attr in FLAGS
    }
    used = {
        node.attr
        for node in ast.walk(tree)
        if isinstance(node, ast.Attribute)
        and not (isinstance(node.value, ast.Name) and node.value.id == "re")
    }
    return methods or used & {"search", "match", "fullmatch", "finditer"} or {"search"}


def list_texts(pattern: re.Pattern[Any]) -> list[tuple[str, str, str]]:
    """Return beginnings, repeated parts and ends of texts that are costly for an expression."""
    rng = random.Random(0)
    tree = parser.parse(pattern.pattern, pattern.flags & ~(re.UNICODE | re.LOCALE))
    alphabet = _list_characters(tree)
    sample = partial(_sample, rng=rng, alphabet=alphabet)
    texts: dict[tuple[str, str, str], None] = {}
    for before, body, sequence in _list_repetitions(tree, ()):
        alone = [each for each in alphabet if len(body) == 1 and _admits(body[0], each)]
        units = {*alone, *(sample(part) for part in (body, sequence, tree) for _ in range(_SAMPLES))} - {""}
        begins = {"", sample(before), sample(before)}
        texts |= dict.fromkeys(product(sorted(begins), sorted(units), ("", "\0", "\n", *alphabet)))
    return list(texts)


def _list_repetitions(sequence: Sequence[Any], before: tuple[Any, ...]) -> Iterator[tuple[Any, Any, Any]]:
    """Yield the nodes before each repetition, its body, and the sequence that contains it."""
    for place, (code, argument) in enumerate(sequence):
        above = (*before, *list(sequence)[:place])
        for part in _list_parts(code, argument):
            if code in _REPETITIONS and argument[1] > _FEW:
                yield above, part, sequence
            yield from _list_repetitions(part, above)


def _list_parts(code: Any, argument: Any) -> Sequence[Any]:
    """Return the sequences within a node of a syntax tree."""
    match code:
        case codes.MAX_REPEAT | codes.MIN_REPEAT | codes.POSSESSIVE_REPEAT:
            return [argument[2]]
        case codes.SUBPATTERN:
            return [argument[3]]
        case codes.BRANCH:
            return list(argument[1])
        case codes.ASSERT | codes.ASSERT_NOT:
            return [argument[1]]
        case codes.ATOMIC_GROUP:
            return [argument]
    return []


def _list_characters(tree: Sequence[Any]) -> list[str]:
    """Return characters of which every class of an expression matches some, the expression's own first."""
    found: dict[str, None] = {}
    for code, argument in tree:
        match code:
            case codes.LITERAL | codes.NOT_LITERAL:
                found[chr(argument)] = None
            case codes.IN:
                found |= dict.fromkeys(_list_characters(argument))
            case codes.RANGE:
                found[chr(argument[0])] = None
            case codes.CATEGORY:
                found[_CATEGORIES.get(argument, "-")] = None
        for part in _list_parts(code, argument):
            found |= dict.fromkeys(_list_characters(part))
    return list(dict.fromkeys([*list(found)[:_MOST_CHARACTERS], *_OTHERS]))


def _admits(node: tuple[Any, Any], character: str) -> bool:
    """Return whether a node of a single character matches it."""
    code, argument = node
    match code:
        case codes.LITERAL:
            return argument == ord(character)
        case codes.NOT_LITERAL:
            return argument != ord(character)
        case codes.RANGE:
            return argument[0] <= ord(character) <= argument[1]
        case codes.CATEGORY:
            return re.fullmatch(_SPELLINGS[argument], character) is not None
        case codes.ANY:
            return character != "\n"
        case codes.IN:
            negated = argument[0][0] is codes.NEGATE
            return negated != any(_admits(each, character) for each in argument[negated:])
    return False


def _sample(
    sequence: Sequence[Any], rng: random.Random, alphabet: Sequence[str], groups: dict[int, str] | None = None
) -> str:
    """Return a short text that a sequence matches, but for look-arounds and the case of letters."""
    groups = {} if groups is None else groups
    found = ""
    for code, argument in sequence:
        match code:
            case codes.MAX_REPEAT | codes.MIN_REPEAT | codes.POSSESSIVE_REPEAT:
                least, most, body = argument
                for _ in range(rng.randint(least, min(least + 1, most))):
                    found += _sample(body, rng, alphabet, groups)
            case codes.SUBPATTERN:
                found += (text := _sample(argument[3], rng, alphabet, groups))
                groups[argument[0]] = text
            case codes.BRANCH:
                found += _sample(rng.choice(argument[1]), rng, alphabet, groups)
            case codes.ATOMIC_GROUP:
                found += _sample(argument, rng, alphabet, groups)
            case codes.GROUPREF:
                found += groups.get(argument, "")
            case codes.LITERAL:
                found += chr(argument)
            case _:
                found += rng.choice([each for each in alphabet if _admits((code, argument), each)] or [""])
    return found


def find_slow_text(expression: Expression) -> str:
    """Return a description of a text whose time does not grow in proportion to its length; empty if none."""
    for begin, unit, end in list_texts(expression.pattern):
        for method in sorted(expression.methods - {"compile"}):
            match = make_match(expression.pattern, method)
            ratio = measure_growth(match, partial(_repeat, begin, unit, end))
            if ratio > LARGEST_RATIO:
                return (
                    f"{method} of {begin!r} + {unit!r} * n + {end!r}: {ratio:.1f} times for twice the length"
                )
    return ""


def _repeat(begin: str, unit: str, end: str, length: int) -> str:
    return begin + unit * (length // len(unit)) + end


def make_match(pattern: re.Pattern[Any], method: str) -> Callable[[str], object]:
    """Return a function that applies a method of an expression to a text."""
    call = getattr(pattern, method)
    arguments = ("",) if method in ("sub", "subn") else ()
    if isinstance(pattern.pattern, bytes):
        arguments = tuple(each.encode() for each in arguments)
        return lambda text: call(*arguments, text.encode("latin-1", "replace"))
    if method == "finditer":
        return lambda text: list(call(text))
    return lambda text: call(*arguments, text)


def measure_growth(match: Callable[[str], object], write: Callable[[int], str]) -> float:
    """Return the growth of the CPU time when the length of a text doubles; 1 if every time is short.

    A text of a few characters whose time is measurable is hopeless: the growth is exponential.
    """
    for length in _LENGTHS:
        if _measure(match, write(length)) > _SUSPICIOUS and _measure(match, write(length), 3) > _SUSPICIOUS:
            break
    else:
        return 1.0
    if length <= _SHORT:
        return float("inf")
    while (least := _measure(match, write(length), 3)) < _MEASURABLE and length < _LONGEST:
        length += max(4, length // 4)
    if length >= _LONGEST:
        return 1.0
    # The growth over two doublings: noise of one measurement counts by its square root.
    doubled = _measure(match, write(2 * length), 3)
    if doubled > _HOPELESS * least:
        return doubled / least
    return float((_measure(match, write(4 * length), 3) / _measure(match, write(length), 3)) ** 0.5)


def _measure(match: Callable[[str], object], text: str, repetitions: int = 1) -> float:
    """Return the least CPU time of several matches in seconds."""
    times = []
    for _ in range(repetitions):
        began = time.process_time()
        match(text)
        times.append(time.process_time() - began)
        if times[-1] > _LONG:
            break
    return min(times)
