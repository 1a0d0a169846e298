"""Where a search stands, as it is shown while it goes on."""

from collections.abc import Callable, Sequence
from itertools import takewhile
from math import inf
from time import monotonic

from islands.evolution.history import HistoryPoint
from islands.evolution.search_state import SearchState
from islands.evolution.settings import Settings
from islands_api.cli.console import Display

#: Islands that are shown one by one.
SHOWN = 16


def search_progress(tell: Display) -> Callable[[SearchState, Settings], None]:
    """Return a watcher that shows generation, speed, time left, the best of every size and every island."""
    began: list[tuple[float, int]] = []

    def watch(state: SearchState, settings: Settings) -> None:
        now = monotonic()
        began[:] = began or [(now, state.evaluations)]
        rate = (state.evaluations - began[0][1]) / max(now - began[0][0], 1e-9)
        done, last = state.history[-1].generation, settings.generations
        left = (last - done) * settings.population * len(state.archipelago.islands) / max(rate, 1e-9)
        best = " ".join(f"{size}:{error**0.5:.3g}" for size, error in state.history[-1].best.items())
        remaining = f", {left:.0f} s left" if rate else ""
        tell(
            f"generation {done}/{last}, {rate:.0f}/s{remaining}",
            done / max(1, last),
            [f"  RMSE by terms  {best}", *_islands(state.history)],
        )

    return watch


def _has(island: int, best: float) -> Callable[[HistoryPoint], bool]:
    return lambda point: point.islands[island] == best


def _islands(history: Sequence[HistoryPoint]) -> list[str]:
    """Return a line for every island: its best, and for how long; of many for the best ones."""
    least = history[-1].islands
    if len(least) == 1:
        return []
    lines = []
    for island in sorted(sorted(range(len(least)), key=least.__getitem__)[:SHOWN]):
        *_, since = takewhile(_has(island, least[island]), reversed(history))
        age = history[-1].generation - since.generation
        found = f"RMSE {least[island] ** 0.5:.4g}" if least[island] < inf else "no model yet"
        lines.append(f"  island {island:3d}  {found}, for {age} generations")
    left = len(least) - len(lines)
    return [*lines, f"  and {left} more, behind these"] if left else lines
