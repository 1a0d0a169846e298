"""Words: prose and names of the repository use standard terms (CONTRIBUTING, "Style")."""

import ast
import re

from support.repository import ROOT

#: Words of fables and of false subjects, with the plain ones that replace them.
BANNED = {
    "nobody|somebody|whoever|whomever": "no client, a caller, users that",
    "who|whom": "that, which",
    "strangers?": "untrusted client, new user",
    "anew": "again, from scratch",
    "in the place of": "instead of",
    "foretells?|foretold": "predict",
    "beside": "next to, in addition to",
    "what (?:it|they|he)": "a noun",
    "where there (?:is|are) none": "if there is none",
    "told|knocks?|lets? go|stands?": "a literal verb",
    "so many": "this number of",
    "of (?:its|their) own|of ours": "own, separate",
    "doors?|crews?|itinerary|voyages?|rungs?|murmurs?": "the term of the field",
}
PATTERN = re.compile(
    "|".join(rf"(?<![a-z])(?:{words.replace(' ', '[ _]+')})(?![a-z])" for words in BANNED), re.I
)

#: The account without rights of a Unix system.
EXEMPT = 'ACCOUNTS = ("postgres", "nobody")'

#: First words of a test's name that refer to nothing.
PRONOUNS = {"it", "its", "so", "that", "they", "this", "these", "what", "who", "others", "nobody"}


def written_files() -> list[str]:
    folders = ("src", "services", "api", "docs", "tests", "examples", "benchmarks")
    suffixes = {".py", ".pyi", ".md", ".html", ".js", ".css"}
    found = [path for folder in folders for path in (ROOT / folder).rglob("*") if path.suffix in suffixes]
    return sorted(str(path.relative_to(ROOT)) for path in (*found, *ROOT.glob("*.md")))


def test_prose_has_no_banned_word() -> None:
    found = [
        f"{name}:{number}: {line.strip()}"
        for name in written_files()
        if not name.endswith("test_prose.py")
        for number, line in enumerate((ROOT / name).read_text(encoding="utf-8").splitlines(), start=1)
        if PATTERN.search(line) and line != EXEMPT
    ]
    assert not found, "\n".join(found)


def test_a_banned_word_is_found_in_names_and_sentences() -> None:
    assert PATTERN.search("def test_nobody_waits():")
    assert PATTERN.search("Return what it holds.")
    assert not PATTERN.search("The standard model understands doorways.")


def test_names_of_tests_are_sentences_about_a_subject() -> None:
    found = []
    for name in written_files():
        if not name.startswith("tests/") or not name.endswith(".py"):
            continue
        for node in ast.walk(ast.parse((ROOT / name).read_text(encoding="utf-8"))):
            if isinstance(node, ast.FunctionDef) and node.name.startswith("test_"):
                first = node.name.split("_")[1]
                if first in PRONOUNS or len(node.name) > 75:
                    found.append(f"{name}: {node.name}")
    assert not found, "\n".join(found)
