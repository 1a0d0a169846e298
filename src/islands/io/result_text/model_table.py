"""Table of the models of a search result."""

from math import isfinite

from islands.evolution.search_result import SearchResult
from islands.io.result_text.text_layout import MARK
from islands.validation.assessment import PARTS, Assessment

#: Columns of every table.
_COLUMNS = ("rank", "terms", "MAPE est. %", "MAPE val. %", "R2 val.", "residuals")

#: Columns of models of hysteresis.
_HYSTERESIS_COLUMNS = ("drift %", "Property 1")


def table(found: SearchResult) -> list[str]:
    """Return the table of models as lines of equal width. Errors are those of the free run."""
    lines = [columns(found), *rows(found)]
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    return ["  ".join(cell.rjust(width) for cell, width in zip(line, widths, strict=True)) for line in lines]


def columns(found: SearchResult) -> tuple[str, ...]:
    """Return the headings; those of holds only if a model claims hysteresis."""
    return (*_COLUMNS[:-1], *(_HYSTERESIS_COLUMNS if found.claims_hysteresis else ()), _COLUMNS[-1])


def rows(found: SearchResult) -> list[tuple[str, ...]]:
    """Return the cells of every model, in the order of the ranks."""
    recommended = found.recommendation.rank
    return [
        _row(f"{rank}{MARK if rank == recommended else ' '}", entry, found.claims_hysteresis)
        for rank, entry in enumerate(found.models, start=1)
    ]


def _row(rank: str, entry: Assessment, hysteresis: bool) -> tuple[str, ...]:
    metrics, physics = entry.metrics, entry.physics
    estimation, validation = metrics["estimation"]["free_run"], metrics["validation"]["free_run"]
    estimated, validated = (bool(entry.outcomes[part]["free_run"]) for part in PARTS)
    holds_bounded = all(hold.bounded for hold in physics.holds)
    claims = (
        number(physics.hold_drift_percent, "{:.3f}", holds_bounded),
        "yes" if physics.property_1 else "no",
    )
    return (
        rank,
        str(entry.model.size),
        number(estimation.mape, "{:.4f}", estimated),
        number(validation.mape, "{:.4f}", validated),
        number(validation.r2, "{:.5f}", validated),
        *(claims if hysteresis else ()),
        entry.residual_structure.verdict,
    )


def number(value: float, form: str, bounded: bool) -> str:
    """Format a number. Return "diverged" if its simulation diverged and "-" if the number is not finite."""
    if not bounded:
        return "diverged"
    return form.format(value) if isfinite(value) else "-"
