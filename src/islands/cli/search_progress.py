"""Progress display of a search."""

from collections.abc import Callable, Mapping, Sequence
from itertools import takewhile
from math import inf
from time import monotonic

from islands.cli.progress_display import Display
from islands.evolution.search_state import HistoryPoint, SearchState
from islands.evolution.settings import NARX, Settings
from islands.facade.identification_progress import IdentificationProgress

#: Largest number of islands that have a line each.
SHOWN_ISLANDS = 16


class SearchDisplay:
    """Progress callbacks of an identification that show its messages and epochs in a bar.

    Parameters
    ----------
    show : Display
    preset, samples, settings, outputs
        See `islands.facade.identification_progress.identification_phases`.
    """

    def __init__(
        self,
        show: Display,
        preset: object,
        samples: int,
        settings: Settings,
        outputs: Sequence[str] = (),
    ) -> None:
        self._show = show
        self._progress = IdentificationProgress(self._show_stage, preset, samples, settings, outputs)
        self._fraction = 0.0
        #: Number of the search of an output, and time and evaluations after its first epoch.
        self._first: tuple[int, float, int] | None = None

    def __call__(self, message: str, fraction: float | None = None, /) -> None:
        """Show a message of a stage before or after the epochs."""
        self._progress(message, fraction)

    def show_epoch(self, state: SearchState, settings: Settings) -> None:
        """Show generation, speed, time left, and the best error by size and by island."""
        now, number = monotonic(), len(state.earlier)
        if self._first is None or self._first[0] != number:
            self._first = number, now, state.evaluations
        _, since, before = self._first
        rate = (state.evaluations - before) / max(now - since, 1e-9)
        left = self._progress.report_epoch(state, settings, rate)
        front = _find_front(state.history[-1].best)
        best = " ".join(f"{size}:{error**0.5:.3g}" for size, error in front.items())
        counted = "terms" if settings.model_class == NARX else "parameters"
        self._show(
            f"generation {state.history[-1].generation}/{settings.generations}, {rate:.0f}/s",
            self._fraction,
            [f"  RMSE by {counted}  {best}", *_island_lines(state.history)],
            left,
        )

    def _show_stage(self, message: str, fraction: float | None = None, /) -> None:
        self._fraction = fraction or 0.0
        self._show(message, fraction)


def _find_front(best: Mapping[int, float]) -> dict[int, float]:
    """Return the errors that are less than those of all smaller models; latent models have many sizes."""
    front: dict[int, float] = {}
    least = inf
    for size, error in sorted(best.items()):
        if error < least:
            front[size] = least = error
    return front


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
