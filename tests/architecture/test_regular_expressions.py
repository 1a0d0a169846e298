"""Regular expressions match, or fail, in a time that grows in proportion to the length of the text.

Texts come from users: cells and names of files, options, headers of requests.
"""

import ast

import pytest

from support.regular_expressions import FOLDERS, find_slow_text, list_expressions
from support.repository import ROOT


def test_expressions_of_the_readers_take_linear_time() -> None:
    expressions = list_expressions("src/islands/records/reading")
    assert len(expressions) > 8
    assert [f"{each}: {text}" for each in expressions if (text := find_slow_text(each))] == []


@pytest.mark.ci
def test_every_expression_takes_linear_time() -> None:
    expressions = list_expressions()
    assert len(expressions) > 70
    assert [f"{each}: {text}" for each in expressions if (text := find_slow_text(each))] == []


def test_expressions_are_calls_of_the_module_re() -> None:
    """Otherwise they are not found."""
    for folder in FOLDERS:
        for path in (ROOT / folder).rglob("*.py"):
            source = path.read_text(encoding="utf-8")
            if "re" not in source:
                continue
            for node in ast.walk(ast.parse(source)) if "from re " in source or "re as " in source else ():
                assert not (isinstance(node, ast.ImportFrom) and node.module == "re"), path
                assert not (
                    isinstance(node, ast.Import)
                    and any(each.name == "re" and each.asname for each in node.names)
                )
