"""Run of the epochs of a search, with its state and its budgets."""

from collections.abc import Callable
from contextlib import closing

from islands.errors import SettingsError
from islands.evolution.archipelago import empty_archipelago
from islands.evolution.engine import Engine, SearchProblem
from islands.evolution.search_state import SearchState, advance, stop_reason
from islands.evolution.settings import Settings
from islands.progress import Steps

#: Receives the state of a search after every epoch, and its settings.
SearchCallback = Callable[[SearchState, Settings], None]


def ignore_epoch(_state: SearchState, _settings: Settings) -> None:
    """Ignore the state after an epoch."""


def begin_search(start: SearchState | None, islands: int, seed: int) -> SearchState:
    """Return the state from which a search continues, or that of empty islands.

    Raises
    ------
    SettingsError
        The state has other islands or another seed.
    """
    state = start or SearchState(empty_archipelago(islands, seed))
    if [(island.index, island.seed) for island in state.archipelago.islands] != [
        (index, seed) for index in range(islands)
    ]:
        raise SettingsError(
            "the start state has other islands or another seed: pass the settings and the seed of its run"
        )
    return state


def evolve(
    problem: SearchProblem,
    state: SearchState,
    settings: Settings,
    engine: Engine,
    steps: Steps,
    on_epoch: SearchCallback,
) -> SearchState:
    """Run the epochs, which are an optional step; return the state after the last one.

    Parameters
    ----------
    problem : SearchProblem
    state : SearchState
        State to continue from.
    settings : Settings
        Settings as passed by the user, which ``on_epoch`` receives.
    engine : Engine
    steps : Steps
    on_epoch : callable
    """
    with closing(engine.run(problem, state.archipelago, steps.stop)) as epochs:
        # Epochs after the last one are never requested, so work that an engine does in advance has no effect.
        while not (steps.stop() or stop_reason(state, settings)) and (epoch := next(epochs, None)):
            state = advance(state, epoch)
            on_epoch(state, settings)
    if not stop_reason(state, settings):
        # Also an engine may end the epochs, without a stop of the steps after them.
        done = max(0, state.archipelago.generation)
        steps.leave_out(f"search from generation {done} to {settings.generations}")
    return state
