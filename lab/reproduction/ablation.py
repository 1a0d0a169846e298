"""Ablation of the literal search of case 1: one switch at a time is changed."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

import numpy as np
import scipy

from lab.reproduction.section import WHY, ComparisonTable
from lab.reproduction.tasks import Document

#: Probability below which a difference between two sets of searches is called significant.
_SIGNIFICANT = 0.05

#: Seeds with which a sign test can be significant.
_FEWEST = 6


@dataclass(frozen=True, slots=True)
class Switch:
    """One change of the literal search.

    Attributes
    ----------
    text : str
        Description.
    changes : mapping
        Settings that differ from the preset ``paper-case1``.
    root_rule : bool
        See `islands.evolution.evaluation.Evaluator`.
    """

    text: str
    changes: Mapping[str, Any] = field(default_factory=dict)
    root_rule: bool = True


#: Name of the search without a change.
LITERAL = "literal"

#: Switches by name. The first is the search of the paper.
SWITCHES: Mapping[str, Switch] = MappingProxyType(
    {
        LITERAL: Switch("as the paper: pruning on y(k), distinct elite, tournament 2"),
        "prune-none": Switch("no pruning (prune = 0)", {"prune": 0.0}),
        "prune-single": Switch(
            "pruning on y(k), not orthogonalised (err_target = output-single)",
            {"err_target": "output-single"},
        ),
        "prune-increment": Switch(
            "pruning on increments (err_target = increment)", {"err_target": "increment"}
        ),
        "no-root-rule": Switch("no root rule in the search", root_rule=False),
        "not-distinct": Switch("elite not distinct (distinct = False)", {"distinct": False}),
        "tournament-3": Switch("tournament 3", {"tournament": 3}),
        "truncate": Switch(
            "children that are too long: truncated (overlong = truncate)", {"overlong": "truncate"}
        ),
        "prune-copies": Switch(
            "unchanged copies are pruned too (prune_copies = True)", {"prune_copies": True}
        ),
    }
)


def selected_error(found: Document, record: str = "validation_100s") -> float:
    """Return the MAPE of the model that a search has selected; infinite if there is none."""
    if found["selected"] is None:
        return float("inf")
    error = found["selected"]["errors"][record]["mape"]
    return float("inf") if error is None else float(error)


def median(values: Sequence[float]) -> float:
    """Return the median; infinite if the middle value is infinite."""
    ordered = sorted(values)
    low, high = ordered[(len(ordered) - 1) // 2], ordered[len(ordered) // 2]
    return low if low == high else (low + high) / 2


def describe_range(sizes: Sequence[int]) -> str:
    """Return the smallest and the largest of several numbers as text; ``-`` if there is none."""
    if not sizes:
        return "-"
    return f"{min(sizes)} to {max(sizes)}" if min(sizes) < max(sizes) else str(min(sizes))


def tabulate_ablation(found: Mapping[str, Sequence[Document]], short: str) -> ComparisonTable:
    """Return the table of the ablation.

    Parameters
    ----------
    found : mapping
        Searches of every switch by its name, in the order of the seeds. A switch may have fewer seeds than
        the literal search.
    short : str
        Note on the short form for the title, or empty.
    """
    rows = []
    for name, searches in found.items():
        errors = [selected_error(each) for each in searches]
        sizes = [each["selected"]["size"] for each in searches if each["selected"]]
        models = sum(each["hall"]["models"] for each in searches)
        converging = sum(each["hall"]["converging"] for each in searches)
        literal = [selected_error(each) for each in found[LITERAL][: len(errors)]]
        why = "the reference of the rows below" if name == LITERAL else compare_errors(errors, literal)
        rows.append(
            (
                SWITCHES[name].text,
                f"{median(errors):.3f}",
                f"{max(errors):.3f}",
                describe_range(sizes),
                f"{100 * converging / max(models, 1):.0f} %",
                why,
            )
        )
    columns = ("switch", "median MAPE %", "worst MAPE %", "terms", "hall with Property 1", WHY)
    title = f"Ablation: one switch changed, validation over 100 s{short}"
    return ComparisonTable(title, tuple(rows), columns)


def compare_errors(errors: Sequence[float], literal: Sequence[float]) -> str:
    """Compare the errors of a changed search with those of the literal one, seed by seed."""
    better = int(np.sum(np.array(errors) < np.array(literal)))
    worse = int(np.sum(np.array(errors) > np.array(literal)))
    counted = f"smaller error with {better}, larger with {worse} of {len(errors)} seeds"
    if better + worse == 0:
        return f"{counted}: no effect on these seeds"
    if better + worse < _FEWEST:
        return f"{counted}: too few seeds for a sign test"
    probability = float(scipy.stats.binomtest(better, better + worse).pvalue)
    verdict = "a significant" if probability < _SIGNIFICANT else "no significant"
    return f"{counted}: {verdict} difference (sign test, p = {probability:.2g})"
