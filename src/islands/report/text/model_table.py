"""Table of the models of a result, from ``result.json``."""

from islands.report.text.facts import Document, ResultFacts
from islands.report.text.layout import MARK
from islands.validation.assessment import PARTS

#: Columns of every table.
_COLUMNS = ("rank", "terms", "MAPE est. %", "MAPE val. %", "R2 val.", "residuals")

#: Columns of models of hysteresis.
_HYSTERESIS_COLUMNS = ("drift %", "Property 1")


def table(document: Document) -> list[str]:
    """Return the table of models and of the linear one as lines of equal width, with free-run errors."""
    hysteresis = ResultFacts(document).claims_hysteresis
    linear = [_row("lin.", document["linear"], hysteresis)] if document.get("linear") else []
    lines = [columns(document), *rows(document), *linear]
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    return ["  ".join(cell.rjust(width) for cell, width in zip(line, widths, strict=True)) for line in lines]


def columns(document: Document) -> tuple[str, ...]:
    """Return the headings; those of holds only if a model claims hysteresis."""
    facts = ResultFacts(document)
    rank, size, *errors, residuals = _COLUMNS
    counted = "parameters" if facts.has_named_parameters else size
    return rank, counted, *errors, *(_HYSTERESIS_COLUMNS if facts.claims_hysteresis else ()), residuals


def rows(document: Document) -> list[tuple[str, ...]]:
    """Return the cells of every model, in the order of the ranks."""
    hysteresis = ResultFacts(document).claims_hysteresis
    return [
        _row(f"{entry['rank']}{MARK if entry['recommended'] else ' '}", entry, hysteresis)
        for entry in document["models"]
    ]


def _row(rank: str, entry: Document, hysteresis: bool) -> tuple[str, ...]:
    metrics = entry["metrics"]
    estimation, validation = metrics["estimation"]["free_run"], metrics["validation"]["free_run"]
    estimated, validated = (entry["outcomes"][part]["free_run"] == "ok" for part in PARTS)
    return (
        rank,
        str(entry["size"]),
        number(estimation["mape"], "{:.4f}", estimated),
        number(validation["mape"], "{:.4f}", validated),
        number(validation["r2"], "{:.5f}", validated),
        *(_describe_claims(entry["physics"]) if hysteresis else ()),
        entry["residual_tests"]["verdict"],
    )


def _describe_claims(physics: Document) -> tuple[str, str]:
    bounded = all(hold["bounded"] for hold in physics["holds"])
    drift = number(physics["hold_drift_percent"], "{:.3f}", bounded)
    return drift, "yes" if physics["property_1"] else "no"


def number(value: float | None, form: str, bounded: bool) -> str:
    """Format a number. Return "diverged" if its simulation diverged and "-" if there is no number."""
    if not bounded:
        return "diverged"
    return "-" if value is None else form.format(value)
