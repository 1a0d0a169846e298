"""Text of the method of a search for latent models: what evolved, with the numbers of its settings."""

from collections.abc import Iterator, Mapping
from typing import Any

from islands.estimation.latent_models import ORDERS
from islands.evolution.latent_variation import EFFECT_STEPS, FURTHER_STEPS, MOST_STATES, MOST_UNITS, STEPS
from islands.evolution.settings import LATENT
from islands.models.latent import STRUCTURE_SUMMARIES


def is_latent(settings: Mapping[str, Any]) -> bool:
    """Return whether the settings of a result are those of a search for latent models."""
    return settings.get("model_class") == LATENT


def describe_latent_search(settings: Mapping[str, Any], generations: int) -> Iterator[str]:
    """Yield the paragraphs about a search for latent models.

    Parameters
    ----------
    settings : mapping
        Settings of the result.
    generations : int
        Generations that were completed.
    """
    islands, population = settings["islands"], settings["population"]
    where = "1 island" if islands == 1 else f"{islands} islands"
    elite = max(1, round(settings["elite"] * population))
    orders = f"{', '.join(map(str, ORDERS[:-1]))} and {ORDERS[-1]}"
    yield (
        f"Search: state spaces with static units evolved on {where} for {generations} generations of "
        f"{population} offspring each. The first ones are linear systems of order {orders} with random "
        f"units. A system has at most {MOST_STATES} states and {MOST_UNITS} units. "
        f"Structure {settings['structure']}: {STRUCTURE_SUMMARIES[settings['structure']]}."
    )
    yield (
        f"Offspring: with probability {settings['crossover']:g}, a parent with a unit of another system, the "
        "argument of which a regression writes for the states of the parent. Otherwise a mutation: a unit "
        "or a state is added or removed, the function of a unit is replaced, a connection is removed, the "
        "arguments of the units are disturbed, or the estimation goes on. A parent is the best one of "
        f"{settings['tournament']} drawn from the elite, or one of the front of size and error."
    )
    yield (
        "Parameters: damped least squares of the free run over blocks of the estimation data, at most "
        f"{EFFECT_STEPS} steps for everything but the arguments of new or changed units, then {STEPS} for "
        f"all parameters, or {FURTHER_STEPS} if the estimation goes on. Error: the largest one of several "
        "free runs over the held-out rows of the blocks, from the states of the block, from estimated and "
        "from disturbed states."
    )
    yield (
        f"Selection: the elite of an island has {elite} systems, each structure once: the front of size and "
        "error, and those with the least logarithm of the error plus the penalty of the Bayesian information "
        "criterion for each parameter."
    )
    if islands > 1:
        yield (
            f"Migration: topology {settings['topology']}, every {settings['migrate_every']} generations, "
            f"{settings['migrants']} systems at most on each way (emigrants: {settings['emigrants']}, "
            f"replaced: {settings['replaced']})."
        )
    if settings.get("constraints", "none") != "none":
        yield from _describe_constraints(settings["constraints"])
    yield (
        "In the end, the systems of the front lose blocks of parameters that the held-out error does not "
        "need, and are estimated on longer blocks."
    )


def _describe_constraints(constraints: str) -> Iterator[str]:
    """Yield the paragraph about the constraints of a search."""
    found = [each.strip() for each in constraints.split(";")]
    if "odd" in found:
        yield "Constraint odd: every system of the search has odd units only, without offsets."
    if statics := [each for each in found if each not in {"odd", "none"}]:
        yield (
            f"Constraints: the systems of every size are estimated again so that they meet "
            f"{'; '.join(statics)}. The errors after that select the front. Each step of the damped least "
            "squares is projected onto the constraints. Systems that cannot meet them are infeasible, and "
            "left out."
        )
