"""Table of scores next to their goals."""

from collections.abc import Sequence

from rich.table import Table

from lab.diagnosis.scoring import Proportion, Statistic


def make_score_table(title: str, rows: Sequence[Proportion | Statistic]) -> Table:
    """Return a table of the scores that have trials, with their intervals and goals."""
    table = Table("", "trials", "", "95 %", "goal", "", title=title, title_justify="left")
    for row in rows:
        if row.of:
            goal = "" if row.goal is None else f"{'<=' if row.most else '>='} {row.goal:g}"
            kept = {True: "kept", False: "MISSED", None: ""}[row.kept]
            table.add_row(row.name, f"{row.of}", *_format_value(row), goal, kept)
    return table


def _format_value(row: Proportion | Statistic) -> tuple[str, str]:
    if isinstance(row, Statistic):
        return f"{row.value:.3f}", ""
    low, high = row.bounds
    return f"{row.percent:.1f} %", f"{low:.1f} to {high:.1f}"
