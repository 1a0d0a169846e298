"""Progress display of a search."""

from collections.abc import Callable, Sequence
from itertools import takewhile
from math import inf
from time import monotonic

from islands.cli.progress_display import Display
from islands.evolution.history import HistoryPoint
from islands.evolution.search_state import SearchState
from islands.evolution.settings import Settings

#: Largest number of islands that have a line each.
SHOWN_ISLANDS = 16


def search_progress(show: Display) -> Callable[[SearchState, Settings], None]:
    """Return a callback that shows generation, speed, time left, and the best error by size and by island."""
    began: list[tuple[float, int]] = []

    def update(state: SearchState, settings: Settings) -> None:
        now = monotonic()
        began[:] = began or [(now, state.evaluations)]
        rate = (state.evaluations - began[0][1]) / max(now - began[0][0], 1e-9)
        done, last = state.history[-1].generation, settings.generations
        left = (last - done) * settings.population * len(state.archipelago.islands) / max(rate, 1e-9)
        best = " ".join(f"{size}:{error**0.5:.3g}" for size, error in state.history[-1].best.items())
        remaining = f", {left:.0f} s left" if rate else ""
        show(
            f"generation {done}/{last}, {rate:.0f}/s{remaining}",
            done / max(1, last),
            [f"  RMSE by terms  {best}", *_island_lines(state.history)],
        )

    return update


def _has_error(island: int, error: float) -> Callable[[HistoryPoint], bool]:
    return lambda point: point.islands[island] == error


def _island_lines(history: Sequence[HistoryPoint]) -> list[str]:
    """Return a line for each of the best islands: its best error, and the generations without improvement."""
    least = history[-1].islands
    if len(least) == 1:
        return []
    lines = []
    for island in sorted(sorted(range(len(least)), key=least.__getitem__)[:SHOWN_ISLANDS]):
        *_, since = takewhile(_has_error(island, least[island]), reversed(history))
        age = history[-1].generation - since.generation
        found = f"RMSE {least[island] ** 0.5:.4g}" if least[island] < inf else "no model yet"
        lines.append(f"  island {island:3d}  {found}, for {age} generations")
    left = len(least) - len(lines)
    return [*lines, f"  and {left} more"] if left else lines
