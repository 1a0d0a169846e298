"""Options that are settings of a search: shared by ``islands identify`` and ``islands jobs submit``."""

from typing import Annotated

import typer

from islands.estimation.parameter_constraints import CONSTRAINTS
from islands.evolution.gp.island_profiles import ISLAND_PROFILES
from islands.evolution.migration.policies import REPLACEMENT_POLICIES, SELECTION_POLICIES
from islands.evolution.migration.topology import TOPOLOGIES
from islands.evolution.presets import PRESETS
from islands.model.primitives import PRIMITIVES

#: Options that are settings, and have their names.
SETTINGS = (
    *("population", "generations", "max_terms", "max_height", "shooting", "primitives", "constraints"),
    *("islands", "topology", "migrate_every", "migrants", "emigrants", "replaced", "characters"),
    *("max_evaluations", "target_error"),
)

Preset = Annotated[str, typer.Option("--preset", help=", ".join(PRESETS))]
Seed = Annotated[int, typer.Option("--seed", min=0, help="Seed of the random generator.")]
Population = Annotated[int | None, typer.Option("--population")]
Generations = Annotated[int | None, typer.Option("--generations")]
MaxTerms = Annotated[int | None, typer.Option("--max-terms")]
MaxHeight = Annotated[int | None, typer.Option("--max-height")]
Shooting = Annotated[int | None, typer.Option("--shooting", help="Samples of an interval.")]
Primitives = Annotated[
    list[str] | None, typer.Option("--primitive", help=f"Repeat it: {', '.join(PRIMITIVES)}.")
]
Constraints = Annotated[str | None, typer.Option("--constraints", help=" or ".join(CONSTRAINTS))]
Islands = Annotated[int | None, typer.Option("--islands", help="Islands that evolve side by side.")]
Topology = Annotated[
    str | None, typer.Option("--topology", help=f"{', '.join(TOPOLOGIES)}, or edges: 0>1,1>2.")
]
MigrateEvery = Annotated[
    str | None, typer.Option("--migrate-every", help="Generations; 5,100:20 is 20 from generation 100 on.")
]
Migrants = Annotated[str | None, typer.Option("--migrants", help="For each neighbour; may change likewise.")]
Emigrants = Annotated[
    str | None, typer.Option("--emigrants", help=f"Who leaves: {', '.join(SELECTION_POLICIES)}.")
]
Replaced = Annotated[
    str | None, typer.Option("--replaced", help=f"Whose place they take: {', '.join(REPLACEMENT_POLICIES)}.")
]
Characters = Annotated[
    list[str] | None,
    typer.Option("--character", help=f"Repeat it, islands take turns: {', '.join(ISLAND_PROFILES)}."),
]
MaxEvaluations = Annotated[
    int | None, typer.Option("--max-evaluations", help="End with the epoch that reaches it.")
]
TargetError = Annotated[
    float | None, typer.Option("--target-error", help="RMSE; end with the epoch that reaches it.")
]
