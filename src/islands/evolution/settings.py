"""Settings of an evolution. With the record and the seed they determine its result."""

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Annotated, Any

from pydantic import BeforeValidator, Field, InstanceOf, WithJsonSchema

from islands.errors import SettingsError, lookup
from islands.estimation.constraints.parser import FORMS
from islands.estimation.estimator_table import ESTIMATORS, REFITS
from islands.estimation.parameter_constraints import CONSTRAINTS, check_latent_constraints, constraint
from islands.estimation.structure_selection.input_delays import Delays
from islands.evolution.gene_structure import STRUCTURES
from islands.evolution.migration import (
    REPLACEMENT_POLICIES,
    SELECTION_POLICIES,
    TOPOLOGIES,
    Schedule,
    parse_schedule,
    parse_topology,
)
from islands.expressions.primitives import PRIMITIVES
from islands.expressions.tree import Primitive
from islands.expressions.user_primitive import primitive_table
from islands.models.candidate_library import LIBRARIES
from islands.models.latent import ZERO_BLOCKS, LatentModel
from islands.records.averaging import check_average
from islands.records.input_lead import check_feedthrough
from islands.settings_schema import AS_INTEGER, Integer, setting, settings_class

#: Returns the samples of a shooting interval, given the setting ``shooting``; None means a free run.
ShootingInterval = Callable[[int], int | None]

#: Targets by name, with their codes in `islands.kernels.err_selection`: settings are read without Numba. The
#: paper refers the ERR to y(k). On an oversampled record y(k-1) explains nearly all of y(k), so that pruning
#: with the paper's tolerance leaves one or two terms of any model. ``increment`` refers it to increments of
#: the output in the null space of the constraints. ``output-single`` refers it to y(k), for each term alone:
#: without orthogonalisation, whose effect it serves to measure.
ERR_TARGETS: Mapping[str, int] = MappingProxyType({"output": 0, "increment": 1, "output-single": 2})

ISLAND_PROFILES: Mapping[str, Mapping[str, Any]] = MappingProxyType(
    {
        "plain": {},
        "explorer": {"mutation": 1.0, "outer": 0.9, "tournament": 2},
        "exploiter": {"outer": 0.1, "tournament": 6},
        "recombiner": {"crossover": 0.9, "high_level": 0.8},
        "pruner": {"prune": 0.8},
    }
)

#: Maximum number of islands, limited by the memory of a coordinator.
MOST_ISLANDS = 10_000

#: What becomes of children with too many genes, by name.
OVERLONG: Mapping[str, str] = MappingProxyType(
    {"truncate": "the last genes are left out", "parent": "a parent takes the place of the child"}
)

#: Generations of a search relative to those of its preset, by effort. Without a generation, the result is the
#: front of the fits, with the models that would seed the search.
EFFORTS: Mapping[str, int] = MappingProxyType({"quick": 0, "normal": 1, "deep": 5})

#: What counts among models that the data do not distinguish.
PREFERENCES = (READABLE, ACCURATE) = ("readable", "accurate")

#: What recommends a model of the result, by name.
SELECTIONS: Mapping[str, str] = MappingProxyType(
    {
        "validation": "the free-run error on the validation data, and the number of terms",
        "fitness": "the error of the search on the estimation data",
    }
)

#: Names of the classes of the models of a search.
NARX, LATENT = "narx", LatentModel.kind

#: Values of the setting ``structure`` of each class.
STRUCTURES_OF: Mapping[str, Mapping[str, Any]] = MappingProxyType({NARX: STRUCTURES, LATENT: ZERO_BLOCKS})

#: Default of an option in the help.
_OF_PRESET = "that of the preset"


def _one_step_ahead(_shooting: int) -> int | None:
    """Error of the one-step-ahead prediction."""
    return 1


def _shooting(shooting: int) -> int | None:
    """Error of multiple shooting over intervals of ``shooting`` samples."""
    return shooting


def _free_run(_shooting: int) -> int | None:
    """Error of the free run over the whole record."""
    return None


FITNESSES: Mapping[str, ShootingInterval] = MappingProxyType(
    {"one-step": _one_step_ahead, "shooting": _shooting, "free-run": _free_run}
)

#: Kind of simulation whose error a fitness function is, an entry of `islands.validation.assessment.MODES`.
FITNESS_MODES: Mapping[str, str] = MappingProxyType(
    {"one-step": "one_step_ahead", "shooting": "multiple_shooting", "free-run": "free_run"}
)


def _refuse_function(entry: Any) -> Any:
    if callable(entry):
        raise ValueError(f"{entry!r} is a function: pass islands.primitive(name, function)")
    return entry


#: A built-in primitive by its name, or one of the user.
_Primitive = Annotated[
    str | InstanceOf[Primitive], BeforeValidator(_refuse_function), WithJsonSchema({"type": "string"})
]


@settings_class
class Settings:
    """Settings of an evolution: the parameters of section 5 of the paper, and those it leaves open.

    A default holds unless the preset has another value.
    """

    population: Integer = setting(500, "Offspring of each generation: individuals of an island.", ge=1)
    effort: str = setting(
        "normal",
        "Length of the search, unless `generations` are given: `quick` compares the models of fits, `normal` "
        "evolves as long as the preset says, `deep` five times as long.",
        choices=EFFORTS,
        daily=True,
    )
    generations: Integer = setting(500, "Generations of a search, at most.", ge=0, daily=_OF_PRESET)
    elite: float = setting(0.1, "Fraction of the population that is kept as elite.", ge=0, le=1)
    crossover: float = setting(0.8, "CXPB: probability that a pair recombines.", ge=0, le=1)
    mutation: float = setting(
        0.2, "MTPB: probability that an individual mutates if it did not recombine.", ge=0, le=1
    )
    prune: float = setting(
        0.5, "PRPB: probability that an evaluated individual is pruned by FROE.", ge=0, le=1
    )
    prune_copies: bool = setting(
        True,
        "Whether individuals that selection copies unchanged are pruned with the same probability. Otherwise "
        "an individual that was not pruned remains so, as in the authors' toolbox.",
    )
    tolerance: float = setting(1e-5, "Smallest error reduction ratio of a term that pruning keeps.", ge=0)
    err_target: str = setting(
        "output",
        "What the error reduction ratio refers to. `output` is as in the paper; `output-single` does not "
        "orthogonalise.",
        choices=ERR_TARGETS,
    )
    max_terms: Integer = setting(10, "Terms of the largest model.", ge=1, daily=_OF_PRESET)
    max_height: Integer = setting(
        5,
        "Height of an expression tree, at most. It is the number of edges from the root of a gene to a leaf, "
        "including back-shifts.",
        ge=0,
    )
    shifts: tuple[Annotated[int, Field(ge=1), AS_INTEGER], ...] = setting(
        (1, 2, 3, 4, 5), "Back-shift operators q1, q2, ... that genes may contain."
    )
    primitives: tuple[_Primitive, ...] = setting(
        ("mul", "phi1", "phi2"),
        f"Functions that genes may contain: {', '.join(PRIMITIVES)}. In Python also your own "
        "(`islands.primitive`).",
    )
    structure: str = setting(
        "phi",
        f"Form of genes: {', '.join(STRUCTURES)}; of latent models the blocks of parameters that are zero: "
        f"{', '.join(ZERO_BLOCKS)}.",
    )
    constraints: str = setting(
        "hysteresis",
        f"Constraints on the parameters: {', '.join(CONSTRAINTS)}, or statements with semicolons between "
        f"them: {'; '.join(FORMS)}. Latent models have gain, fixed-point and odd.",
        daily=_OF_PRESET,
    )
    fitness: str = setting("shooting", "Error that a search minimises.", choices=FITNESSES)
    shooting: Integer = setting(
        500, "Samples of the record, before averaging, in each interval of multiple shooting.", ge=1
    )
    tournament: Integer = setting(
        3,
        "Contestants of a tournament, which selects a parent. The paper does not give it; its authors' "
        "toolbox takes 2.",
        ge=1,
    )
    high_level: float = setting(
        0.5,
        "Probability that a crossover exchanges whole genes, not subtrees. The paper does not give it.",
        ge=0,
        le=1,
    )
    outer: float = setting(
        0.5,
        "Probability that a mutation replaces a whole gene, not a subtree. The paper does not give it.",
        ge=0,
        le=1,
    )
    initial_terms: tuple[int, int] = setting(
        (1, 10),
        "Fewest and most genes of individuals in the first population. The paper does not give them.",
    )
    initial_height: Integer = setting(
        3,
        "Largest height of genes in the first population and of random subtrees, at most `max_height`. The "
        "paper does not give it.",
        ge=0,
    )
    overlong: str = setting(
        "truncate",
        "What becomes of children with more than `max_terms` genes. `truncate` leaves out the last genes; "
        "`parent` takes a parent in place of the child, as in the authors' toolbox.",
        choices=OVERLONG,
    )
    library: str = setting(
        "",
        "Candidate library. Its constrained forward selection seeds the first population, and outer mutation "
        "may insert its regressors. Empty for no library.",
        choices=LIBRARIES,
    )
    library_degree: Integer = setting(5, "Degree of the library.")
    library_lags: Integer = setting(3, "Lags of the library.")
    library_delays: Delays = setting(
        (),
        "Dead times in samples of the record, before averaging: one for all inputs, or one for each. The "
        "library reads the inputs later by them.",
    )
    swap_search: bool = setting(
        False,
        "Whether a swap search over the library takes the place of the seeds of forward selection.",
    )
    from_library: float = setting(
        0.0,
        "Probability that an outer mutation uses the library. No effect without a library.",
        ge=0,
        le=1,
    )
    distinct: bool = setting(False, "Whether the elite contains each structure only once.")
    niches: bool = setting(
        True,
        "Whether a distinct elite has, of structures that differ only in their lags, the fittest one first.",
    )
    refine: bool = setting(
        False,
        "Whether to refine the parameters of the hall of fame by minimising the shooting error.",
    )
    estimator: str = setting(
        "",
        "Estimator of the parameters of the final models; by default validation selects. Without one they "
        "are those of least squares or, if it is better on the validation data, of a refinement.",
        choices=ESTIMATORS,
    )
    refit: str = setting(
        "none",
        "`all` estimates the parameters of the ranked models again in the end, on all data. The errors of "
        "the result remain those of the parameters before, since no data are left to measure the others.",
        choices=REFITS,
    )
    prefer: str = setting(
        READABLE,
        "Which of the models that the data do not distinguish is recommended: `readable`, a linear one or "
        "the smallest, or `accurate`, the one with the most evidence in the free run on all data.",
        choices=PREFERENCES,
        daily=True,
    )
    select: str = setting(
        "validation",
        "What recommends a model: validation, or fitness, the error on the estimation data. `validation` "
        "takes the simplest model with the most evidence in the free run on all data. `fitness` takes the "
        "model with the least error of the search, as Appendix A of the paper; its free run may diverge.",
        choices=SELECTIONS,
    )
    average: Integer | str = setting(
        1,
        "Samples of a mean that becomes one sample of the data, 1 for none. `auto` averages the noise of an "
        "oversampled record if small models of a library are clearly better on the validation data. Models "
        "then have the sampling time of the means.",
    )
    feedthrough: str = setting(
        "no",
        "Whether models read inputs at sample k: yes, no, or auto, which tests the record. `auto` is for "
        "those inputs to which the output of the estimation data responds within the sample.",
    )
    islands: Integer = setting(
        1,
        "Number of islands that evolve in parallel, each with a separate population.",
        ge=1,
        le=MOST_ISLANDS,
        daily=_OF_PRESET,
    )
    topology: str = setting(
        "isolated",
        f"Which islands send to which: {', '.join(TOPOLOGIES)}, or edges: 0>1,1>2. Isolated islands were the "
        "most reliable choice with the paper's settings (decision 0008).",
    )
    migrate_every: int | str = setting(
        10, "Generations between migrations; 5,100:20 is 5, and 20 from generation 100 on."
    )
    migrants: int | str = setting(
        1, "Individuals sent to each neighbour: a number, or a schedule as of `migrate_every`."
    )
    emigrants: str = setting("best", "Which individuals migrate.", choices=SELECTION_POLICIES)
    replaced: str = setting("worst", "Which individuals immigrants replace.", choices=REPLACEMENT_POLICIES)
    characters: tuple[str, ...] = setting(
        (), f"Profiles that the islands have in turn: {', '.join(ISLAND_PROFILES)}. None if all are equal."
    )
    max_evaluations: Integer = setting(
        0, "Stop after the epoch that reaches this number of individuals; 0 for no limit.", ge=0
    )
    target_error: float = setting(
        0.0, "Stop after the epoch that reaches this RMSE, in the output's unit; 0 for no target.", ge=0
    )
    model_class: str = setting(
        NARX,
        "Class of the models, which is that of the preset. Latent models have the settings of the "
        "populations, of the islands and of the end of a search, `structure` and `constraints`; all others "
        "are those of NARX models.",
        choices=STRUCTURES_OF,
    )

    def __post_init__(self) -> None:
        fewest, most = self.initial_terms
        if not 1 <= fewest <= most <= self.max_terms:
            raise SettingsError(
                f"initial_terms {self.initial_terms} lie between 1 and max_terms {self.max_terms}"
            )
        if self.initial_height > self.max_height:
            raise SettingsError(
                f"initial_height {self.initial_height} is larger than max_height {self.max_height}"
            )
        if not (self.primitives or self.shifts):
            raise SettingsError("genes are made of primitives and back-shifts: give at least one of them")
        check_average(self.average)
        check_feedthrough(self.feedthrough)
        lookup(STRUCTURES_OF[self.model_class], self.structure, f"structure of {self.model_class} models")
        constraint(self.constraints)
        if self.model_class == LATENT:
            check_latent_constraints(self.constraints)
        primitive_table(self.primitives)
        for name in self.characters:
            lookup(ISLAND_PROFILES, name, "character")
        _ = self.stops
        most = max(count for _, count in self.leaving.pieces)
        arriving = most * parse_topology(self.topology, self.islands, 0).in_degree
        if arriving > self.population:
            raise SettingsError(
                f"{arriving} individuals would arrive on an island of {self.population}: fewer migrants, "
                "a sparser topology or a larger population are needed"
            )

    @property
    def primitive_table(self) -> Mapping[str, Primitive]:
        """Built-in primitives and those of the user, by name."""
        return primitive_table(self.primitives)

    @property
    def stops(self) -> Schedule:
        """Schedule of the intervals between migrations, in generations."""
        return parse_schedule(self.migrate_every, 1, "migrate_every")

    @property
    def leaving(self) -> Schedule:
        """Schedule of the number of emigrants per neighbour."""
        return parse_schedule(self.migrants, 0, "migrants")

    @property
    def maximum_lag(self) -> int:
        """Largest lag that a gene can have: the lag of a leaf plus a back-shift on every edge above it.

        A leaf from a library has a lag of the library, and variation can insert it at any depth.
        """
        leaf = self.library_lags + max(self.library_delays, default=0) if self.library else 1
        return leaf + self.max_height * max(self.shifts, default=0)

    @property
    def elites(self) -> int:
        """Number of individuals in the elite, at least one."""
        return max(1, round(self.elite * self.population))
