"""Propose: a formula for what is left over where no name explains it, evolved by the islands."""

import re
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import numpy as np

from islands.data.dataset import Dataset
from islands.discrepancy.diagnosis import Diagnosis, ResidualFormula
from islands.discrepancy.inference.verdict import Verdict
from islands.evolution.engine import Engine
from islands.facade.identify import identify
from islands.model.equations import equation
from islands.simulation.predictors import free_run

#: The search: small and simple, since a formula is for reading.
SEARCH: Mapping[str, Any] = MappingProxyType(
    {"population": 200, "generations": 40, "islands": 2, "max_terms": 5, "initial_terms": (1, 5)}
)

#: Share of the remainder, on samples that nothing has seen, from which on a formula is worth telling.
WORTH = 0.1

#: What the residual, and the output that is simulated, are called in it.
LEFT, SIMULATED = "residual", "simulated"


def explain_residual(found: Diagnosis, seed: int = 0, engine: Engine | None = None) -> ResidualFormula | None:
    """Look for a formula of what has no name; None where nothing is left, or none is worth it.

    The islands search on the samples that the analysis was fitted to. The locked ones say what it is worth.
    """
    if found.verdict not in (Verdict.UNKNOWN, Verdict.REMAINDER):
        return None
    record = found.record
    left = record.y - found.best.output
    remainder = Dataset(
        u=np.column_stack([record.u[:, 0], found.best.output]),
        y=left,
        dt=record.dt,
        input_names=(record.input_names[0], SIMULATED),
        input_units=(record.input_units[0], record.output_unit),
        output_name=LEFT,
        output_unit=record.output_unit,
    )
    result = identify(
        remainder[: found.estimation_samples], 0.25, preset="narx", seed=seed, engine=engine, **SEARCH
    )
    best, explains = None, WORTH
    for each in result.models:
        run = free_run(each.model, remainder)
        missed = np.where(np.isfinite(run.y), left - run.y, left)[found.estimation_samples :]
        size = float(np.sum(left[found.estimation_samples :] ** 2))
        share = 1.0 - float(np.sum(missed**2)) / size if size else 0.0
        # The shortest one that is nearly as good: every term more has to be worth it.
        if share > explains + 0.02:
            best, explains = each.model, share
    if best is None:
        return None
    names = {"u1": record.input_names[0], "u2": SIMULATED, "y": LEFT}
    return ResidualFormula(
        re.sub(r"\b(u1|u2|y)(?=\()", lambda name: names[name[1]], equation(best)), explains
    )
