"""The trials with unusual causes of ``islands trials``: their plan and their tables."""

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
from rich.table import Table

from islands.cli.console import output
from islands.errors import SettingsError
from lab.diagnosis.injection.unusual.table import UNUSUAL_CAUSES
from lab.diagnosis.score_table import make_score_table
from lab.diagnosis.scoring import Proportion, Statistic
from lab.diagnosis.unusual_scoring import (
    Answer,
    classify_answer,
    count_answers,
    list_sure_claims,
    score_unusual,
)
from lab.diagnosis.unusual_trial import UnusualOutcome, UnusualTrial

#: Simulations of the unusual causes by the names of the trials' cases, as beginnings of their names.
_SIMULATIONS = {"second-order": "second-order", "linear": "linear:"}


def plan_unusual(cores: Sequence[str], names: Sequence[str], count: int, seed: int) -> list[UnusualTrial]:
    """Return the trials of unusual causes: ``count`` plants of each, with seeds from ``seed`` on.

    Parameters
    ----------
    cores : sequence of str
        Cases of the trials whose causes are wanted; all of them if it is empty.
    names : sequence of str
        Causes; all of the cores if it is empty.

    Raises
    ------
    SettingsError
        No cause belongs to the cores and names.
    """
    begins = tuple(_SIMULATIONS[core] for core in cores if core in _SIMULATIONS) if cores else ("",)
    chosen = [
        name
        for name, cause in UNUSUAL_CAUSES.items()
        if cause.simulation.startswith(begins) and (not names or name in names)
    ]
    if not chosen:
        raise SettingsError(
            f"no unusual cause has the core {' or '.join(cores)}: take {' or '.join(_SIMULATIONS)}"
        )
    return [UnusualTrial(name, seed + turn) for turn in range(count) for name in chosen]


def report_unusual(outcomes: Sequence[UnusualOutcome]) -> dict[str, Any]:
    """Print the scores of trials with unusual causes, and return them as a document."""
    rows = score_unusual(outcomes)
    output.print(_make_cause_table(outcomes))
    output.print(make_score_table("all causes", rows))
    for each in outcomes:
        if (line := describe_failure(each)) is not None:
            output.print(line, markup=False)
    document = {
        "shares": [{**asdict(row), "bounds": row.bounds} for row in rows if isinstance(row, Proportion)],
        "measures": [asdict(row) for row in rows if isinstance(row, Statistic) and row.of],
        "answers": {
            name: {str(answer): times for answer, times in counts.items() if times}
            for name, counts in count_answers(outcomes).items()
        },
        "outcomes": [
            {
                **asdict(each),
                "answer": str(classify_answer(each)),
                "failing": [
                    sure.claim.term or sure.claim.name for sure in list_sure_claims(each) if sure.fails
                ],
            }
            for each in outcomes
        ],
    }
    finite: dict[str, Any] = _replace_infinite(document)
    return finite


def _replace_infinite(value: Any) -> Any:
    """Return a document with null for infinite errors, for which JSON has no number."""
    if isinstance(value, dict):
        return {key: _replace_infinite(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [_replace_infinite(each) for each in value]
    return None if isinstance(value, float) and not np.isfinite(value) else value


def _make_cause_table(outcomes: Sequence[UnusualOutcome]) -> Table:
    """Return the answers by cause, with the ratios of the errors on fresh records."""
    table = Table("cause", *map(str, Answer), "fresh error, extended / simulation", title="unusual causes")
    for name, counts in count_answers(outcomes).items():
        ratios = [each.fresh.ratio for each in outcomes if each.fresh and each.trial.cause == name]
        shown = [str(times or "") for times in counts.values()]
        table.add_row(name, *shown, ", ".join(f"{ratio:.2g}" for ratio in ratios))
    return table


def describe_failure(outcome: UnusualOutcome) -> str | None:
    """Return a line on an outcome that is missed, wrong or an error, or fails on a fresh record."""
    answer = classify_answer(outcome)
    failing = [each.claim for each in list_sure_claims(outcome) if each.fails]
    is_worse = outcome.fresh is not None and outcome.fresh.is_worse
    if answer in (Answer.RIGHT, Answer.FAMILY, Answer.UNKNOWN) and not failing and not is_worse:
        return None
    claims = "; ".join(
        f"{each.term or each.name} ({each.confidence:.2f}{', fails' if each in failing else ''})"
        for each in outcome.claims
    )
    fresh, error = outcome.fresh, outcome.error.rstrip().rpartition("\n")[2]
    errors = "" if fresh is None else f"; fresh error {fresh.base:.3g} to {fresh.extended:.3g} sigma"
    return (
        f"{outcome.trial.cause}, seed {outcome.trial.seed}, {outcome.misfit:.1f} sigma: {answer}, verdict "
        f"{outcome.verdict!r}: {claims or error or 'no claim'}{errors}"
    )
