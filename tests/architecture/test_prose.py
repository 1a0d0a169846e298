"""Words: prose and names of the repository use standard terms (CONTRIBUTING, "Style")."""

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
PATTERN = re.compile(rf"(?<![a-z])(?:{'|'.join(BANNED).replace(' ', '[ _]+')})(?![a-z])")

#: The account without rights of a Unix system.
EXEMPT = 'ACCOUNTS = ("postgres", "nobody")'

#: The definition of a test.
TEST = re.compile(r"^ *(?:async )?def (test_\w+)", re.M)

#: First words of a test's name that refer to nothing.
PRONOUNS = {"it", "its", "so", "that", "they", "this", "these", "what", "who", "others", "nobody"}


def written_files() -> list[str]:
    folders = ("src", "services", "measurements", "api", "docs", "tests", "examples", "benchmarks")
    suffixes = {".py", ".pyi", ".md", ".html", ".js", ".css"}
    found = [path for folder in folders for path in (ROOT / folder).rglob("*") if path.suffix in suffixes]
    return sorted(str(path.relative_to(ROOT)) for path in (*found, *ROOT.glob("*.md")))


def find_banned_words(text: str) -> list[str]:
    return PATTERN.findall(text.lower())


def test_prose_has_no_banned_word() -> None:
    found = []
    for name in written_files():
        text = (ROOT / name).read_text(encoding="utf-8").replace(EXEMPT, "")
        if not name.endswith("test_prose.py") and (words := find_banned_words(text)):
            found.append(f"{name}: {', '.join(words)}")
    assert not found, "\n".join(found)


def test_a_banned_word_is_found_in_names_and_sentences() -> None:
    assert find_banned_words("def test_nobody_waits():") == ["nobody"]
    assert find_banned_words("Return What it holds.") == ["what it"]
    assert not find_banned_words("The standard model understands doorways.")


def test_names_of_tests_are_sentences_about_a_subject() -> None:
    found = [
        f"{name}: {test}"
        for name in written_files()
        if name.startswith("tests/") and name.endswith(".py")
        for test in TEST.findall((ROOT / name).read_text(encoding="utf-8"))
        if test.split("_")[1] in PRONOUNS or len(test) > 75
    ]
    assert not found, "\n".join(found)
