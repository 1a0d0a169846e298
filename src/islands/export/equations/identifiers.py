"""Names of equations and effects as identifiers of C and MATLAB."""

import re
from collections.abc import Iterable

#: Reserved words of C, names of its macros, reserved words of MATLAB, and members of structures in programs.
_RESERVED = frozenset(
    """
    alignas alignof auto bool break case char const constexpr continue default do double else enum extern
    false float for goto if inline int long nullptr register restrict return short signed sizeof static
    static_assert struct switch thread_local true typedef typeof typeof_unqual union unsigned void volatile
    while NAN INFINITY NULL HUGE_VAL RAND_MAX EXIT_SUCCESS EXIT_FAILURE unix linux i386 assert errno
    catch classdef elseif end endfunction endif endfor endwhile function global otherwise parfor
    persistent spmd try until unwind_protect samples none
    """.split()  # noqa: SIM905
)

#: Largest length; C and MATLAB distinguish 63 characters.
_LENGTH = 55


def make_identifiers(names: Iterable[str]) -> dict[str, str]:
    """Return a different identifier for each name, which is the name itself if possible.

    A minus sign before a digit becomes ``m``, so that ``at -0.25`` and ``at 0.25`` differ.
    """
    found: dict[str, str] = {}
    taken: set[str] = set()
    for name in dict.fromkeys(names):
        text = re.sub(r"\W+", "_", re.sub(r"-(?=\d)", "m", name), flags=re.ASCII).strip("_")[:_LENGTH]
        if not text or not text[0].isalpha():
            text = f"n{text}"
        if text in _RESERVED:
            text += "_"
        number, unique = 2, text
        while unique in taken:
            unique, number = f"{text}_{number}", number + 1
        taken.add(unique)
        found[name] = unique
    return found
