"""Settings of an evolution. With the record and the seed they determine its result."""

from collections.abc import Mapping
from dataclasses import Field, dataclass, field
from math import inf
from types import MappingProxyType
from typing import Any, TypeVar

from islands.errors import (
    SettingsError,
    check_at_least,
    check_integers,
    check_numbers,
    check_probabilities,
    check_sequences,
    check_texts,
    lookup,
)
from islands.estimation.constraints.parser import FORMS
from islands.estimation.estimator_table import ESTIMATORS, REFITS
from islands.estimation.parameter_constraints import CONSTRAINTS, check_latent_constraints, constraint
from islands.estimation.structure_selection.input_delays import check_delays
from islands.evolution.err_targets import ERR_TARGETS
from islands.evolution.fitness import FITNESSES
from islands.evolution.gene_structure import STRUCTURES
from islands.evolution.island_profiles import ISLAND_PROFILES
from islands.evolution.migration.policies import REPLACEMENT_POLICIES, SELECTION_POLICIES
from islands.evolution.migration.schedule import Schedule, parse_schedule
from islands.evolution.migration.topology import TOPOLOGIES, parse_topology
from islands.expressions.primitives import PRIMITIVES
from islands.expressions.tree import Primitive
from islands.expressions.user_primitive import primitive_table
from islands.models.candidate_library import get_library
from islands.models.latent import ZERO_BLOCKS, LatentModel
from islands.records.averaging import check_average
from islands.records.input_lead import check_feedthrough

#: Maximum number of islands, limited by the memory of a coordinator.
MOST_ISLANDS = 10_000

#: What becomes of children with too many genes, by name.
OVERLONG: Mapping[str, str] = MappingProxyType(
    {"truncate": "the last genes are left out", "parent": "a parent takes the place of the child"}
)

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

T = TypeVar("T")


def _option(
    default: T,
    help_text: str | None = None,
    name: str | None = None,
    after: str = "",
    text_type: Any = None,
) -> T:
    """Declare a setting that is also an option of the command line.

    Parameters
    ----------
    default
        Default of the setting. The option's own default is None: the value of the preset.
    name : str, optional
        Name of the option; ``--max-terms`` for the setting ``max_terms`` by default.
    after : str, optional
        Setting whose option precedes this one in the help; the order of the fields by default.
    text_type : type, optional
        Type of the setting on the command line and over REST; the type of the field by default.
    """
    metadata = {"option": name, "help": help_text, "after": after}
    made: T = field(default=default, metadata={"command_line": metadata, "text_type": text_type})
    return made


@dataclass(frozen=True, slots=True)
class Settings:
    """Settings of an evolution: the parameters of section 5 of the paper, and those it leaves open.

    Attributes
    ----------
    population, generations : int
        Offspring of each generation; number of generations.
    elite : float
        Fraction of the population that is kept as elite.
    crossover : float
        CXPB, probability that a pair recombines.
    mutation : float
        MTPB, probability that an individual mutates if it did not recombine.
    prune : float
        PRPB, probability that an evaluated individual is pruned by FROE.
    prune_copies : bool
        Whether individuals that selection copies unchanged are pruned with the same probability. Otherwise
        an individual that was not pruned remains so, as in the authors' toolbox.
    tolerance : float
        Smallest error reduction ratio of a term that pruning keeps.
    err_target : str
        An entry of ``ERR_TARGETS``: what the error reduction ratio refers to, ``output`` as in the paper,
        ``increment``, or ``output-single``, which does not orthogonalise.
    max_terms, max_height : int
        Largest number of genes of an individual; largest number of edges from the root of a gene to a leaf,
        including back-shifts.
    shifts : tuple of int
        Back-shift operators q1, q2, ... that genes may contain.
    primitives : tuple of str or Primitive
        Functions that genes may contain: names of built-in ones, and your own (`islands.primitive`).
    structure : str
        An entry of ``STRUCTURES``: constraint on the form of genes. Of latent models an entry of
        ``ZERO_BLOCKS``: the blocks of parameters that are zero.
    constraints : str
        Constraints on the parameters: ``hysteresis``, ``none``, or statements with semicolons between them,
        such as ``odd; fixed-point = 0, 0; gain = 2.5; [u(k-1)] >= 0``. Latent models have ``gain``,
        ``fixed-point`` and ``odd``.
    fitness : str
        An entry of ``FITNESSES``.
    shooting : int
        Samples of the record, before averaging, in each interval of multiple shooting.
    tournament : int
        Contestants of a tournament. The paper does not give it; its authors' toolbox takes 2.
    high_level : float
        Probability that a crossover exchanges whole genes, not subtrees; not given in the paper.
    outer : float
        Probability that a mutation replaces a whole gene, not a subtree; not given in the paper.
    initial_terms : tuple of int
        Fewest and most genes of individuals in the first population; not given in the paper.
    initial_height : int
        Largest height of genes in the first population and of random subtrees, at most ``max_height``; not
        given in the paper.
    overlong : str
        An entry of ``OVERLONG``: what becomes of children with more than ``max_terms`` genes. ``truncate``
        leaves out the last genes; ``parent`` takes a parent in place of the child, as in the authors'
        toolbox.
    library : str
        Candidate library. Its constrained forward selection seeds the first population, and outer mutation
        may insert its regressors. Empty for no library.
    library_degree, library_lags : int
        Degree and lags of the library.
    library_delays : tuple of int
        Dead times by which the library reads the inputs later, in samples of the record, before averaging:
        one for all inputs, or one for each.
    swap_search : bool
        Whether a swap search over the library takes the place of the seeds of forward selection.
    from_library : float
        Probability that an outer mutation uses the library; no effect without a library.
    distinct : bool
        Whether the elite contains each structure only once.
    niches : bool
        Whether a distinct elite has, of structures that differ only in their lags, the fittest one first.
    refine : bool
        Whether to refine the parameters of the hall of fame by minimising the shooting error.
    estimator : str
        An entry of ``ESTIMATORS``, which estimates the parameters of the final models. Empty: least squares
        and, with ``refine``, refinement; the validation data select between the two.
    refit : str
        An entry of ``REFITS``. With ``all``, the parameters of the ranked models are estimated again on
        estimation and validation data together; the errors remain those of the parameters before.
    select : str
        An entry of ``SELECTIONS``, which recommends a model. ``validation`` takes the smallest model that is
        as good as the best on the validation data. ``fitness`` takes the model with the least error of the
        search on the estimation data, as Appendix A of the paper; its free run may diverge.
    average : int or str
        Samples of a mean that becomes one sample of the data, 1 for none. ``auto`` averages the noise of an
        oversampled record if small models of a library are clearly better on the validation data.
    feedthrough : str
        Whether models read inputs at sample k: ``yes`` for all inputs, ``no``, or ``auto`` for those to which
        the output of the estimation data responds within the sample.
    islands : int
        Number of islands, each with a separate population.
    topology : str
        Which islands send to which: an entry of ``TOPOLOGIES`` or a list of edges, ``0>1,1>2``. Isolated
        islands were the most reliable choice with the paper's settings (decision 0008).
    migrate_every : int or str
        Generations of an epoch, at the end of which individuals migrate: a number or a schedule,
        ``5,100:20`` for 5, and 20 from generation 100 on.
    migrants : int or str
        Number of emigrants per neighbour and epoch: a number or a schedule.
    emigrants, replaced : str
        Selection of emigrants and of individuals that immigrants replace: entries of ``SELECTION_POLICIES``
        and of ``REPLACEMENT_POLICIES``.
    characters : tuple of str
        Entries of ``ISLAND_PROFILES``, assigned to the islands in turn; empty if all islands are equal.
    max_evaluations : int
        The run ends after the first epoch with at least this number of evaluated individuals; 0 for no limit.
    target_error : float
        The run ends after the first epoch in which an individual has at most this RMSE, in the unit of the
        output; 0 for no target.
    model_class : str
        Class of the models: ``narx`` or ``latent``. Latent models have the settings of the populations, of
        the islands and of the end of a search, `structure` and `constraints`; all others are those of NARX
        models.
    """

    population: int = _option(500, "Individuals of an island.")
    generations: int = _option(500, "Generations of a search, at most.")
    elite: float = _option(0.1, "Fraction of the population that is kept as elite.")
    crossover: float = _option(0.8, "CXPB: probability that a pair recombines.")
    mutation: float = _option(0.2, "MTPB: probability of a mutation if there was no crossover.")
    prune: float = _option(0.5, "PRPB: probability that an individual is pruned.")
    prune_copies: bool = _option(
        True, "Prune unchanged copies of parents as well.", "--prune-copies/--no-prune-copies"
    )
    tolerance: float = _option(1e-5, "Smallest error reduction ratio of a term that pruning keeps.")
    err_target: str = _option(
        "output", f"What the error reduction ratio refers to: {', '.join(ERR_TARGETS)}."
    )
    max_terms: int = _option(10, "Terms of the largest model.")
    max_height: int = _option(5, "Height of an expression tree, at most.")
    shifts: tuple[int, ...] = _option((1, 2, 3, 4, 5), "Back-shifts of genes; repeat it: 1, 2, ...")
    primitives: tuple[str | Primitive, ...] = _option(
        ("mul", "phi1", "phi2"),
        f"Repeat it: {', '.join(PRIMITIVES)}.",
        "--primitive",
        text_type=tuple[str, ...],
    )
    structure: str = _option(
        "phi", f"Form of genes: {', '.join(STRUCTURES)}; of latent models: {', '.join(ZERO_BLOCKS)}."
    )
    constraints: str = _option("hysteresis", f"{', '.join(CONSTRAINTS)}, or statements: {'; '.join(FORMS)}.")
    fitness: str = "shooting"
    shooting: int = _option(500, "Samples of a shooting interval, before averaging.", after="max_height")
    tournament: int = _option(3, "Contestants of a tournament, which selects a parent.")
    high_level: float = 0.5
    outer: float = 0.5
    initial_terms: tuple[int, int] = (1, 10)
    initial_height: int = 3
    overlong: str = _option("truncate", f"Children with too many genes: {', '.join(OVERLONG)}.")
    library: str = ""
    library_degree: int = 5
    library_lags: int = 3
    library_delays: tuple[int, ...] = _option(
        (), "Dead time in samples; repeat it for each input.", "--dead-time"
    )
    swap_search: bool = False
    from_library: float = 0.0
    distinct: bool = _option(False, "Keep each structure once in the elite.", "--distinct/--no-distinct")
    niches: bool = _option(
        True, "Prefer structures that differ in more than their lags.", "--niches/--no-niches"
    )
    refine: bool = False
    estimator: str = _option(
        "", f"{', '.join(ESTIMATORS)}; by default validation selects.", after="constraints"
    )
    refit: str = _option(
        "none",
        f"Estimate the parameters again on all data in the end: {', '.join(REFITS)}.",
        after="estimator",
    )
    select: str = _option(
        "validation",
        "What recommends a model: validation, or fitness, the error on the estimation data.",
        after="refit",
    )
    average: int | str = _option(1, "Samples of a mean that becomes one sample, or auto.")
    feedthrough: str = _option("no", "Whether models read u(k): auto (test the record), yes or no.")
    islands: int = _option(1, "Number of islands that evolve in parallel.")
    topology: str = _option("isolated", f"{', '.join(TOPOLOGIES)}, or edges: 0>1,1>2.")
    migrate_every: int | str = _option(
        10, "Generations between migrations; 5,100:20 is 5, and 20 from generation 100 on."
    )
    migrants: int | str = _option(1, "Individuals sent to each neighbour; may change likewise.")
    emigrants: str = _option("best", f"Which individuals migrate: {', '.join(SELECTION_POLICIES)}.")
    replaced: str = _option("worst", f"Which individuals are replaced: {', '.join(REPLACEMENT_POLICIES)}.")
    characters: tuple[str, ...] = _option(
        (), f"Repeat it, islands take turns: {', '.join(ISLAND_PROFILES)}.", "--character"
    )
    max_evaluations: int = _option(0, "Stop after the epoch that reaches this number of individuals.")
    target_error: float = _option(0.0, "Stop after the epoch that reaches this RMSE, in the output's unit.")
    model_class: str = NARX

    def __post_init__(self) -> None:
        check_sequences(
            shifts=self.shifts,
            primitives=self.primitives,
            initial_terms=self.initial_terms,
            characters=self.characters,
        )
        check_numbers(tolerance=self.tolerance, target_error=self.target_error)
        check_at_least(1, population=self.population, max_terms=self.max_terms, shooting=self.shooting)
        check_at_least(0, generations=self.generations, max_height=self.max_height)
        check_at_least(1, tournament=self.tournament)
        check_probabilities(
            elite=self.elite, crossover=self.crossover, mutation=self.mutation, prune=self.prune
        )
        check_probabilities(high_level=self.high_level, outer=self.outer, from_library=self.from_library)
        if not self.tolerance >= 0.0:
            raise SettingsError(f"the tolerance of pruning is not negative, got {self.tolerance}")
        check_integers(initial_height=self.initial_height)
        fewest, most = self.initial_terms
        if not 1 <= fewest <= most <= self.max_terms:
            raise SettingsError(
                f"initial_terms {self.initial_terms} lie between 1 and max_terms {self.max_terms}"
            )
        if not 0 <= self.initial_height <= self.max_height:
            raise SettingsError(
                f"initial_height {self.initial_height} lies between 0 and max_height {self.max_height}"
            )
        if not (self.primitives or self.shifts):
            raise SettingsError("genes are made of primitives and back-shifts: give at least one of them")
        if self.library:
            get_library(self.library)
        check_delays(self.library_delays)
        check_average(self.average)
        check_feedthrough(self.feedthrough)
        structures = lookup(STRUCTURES_OF, self.model_class, "class of models")
        lookup(structures, self.structure, f"structure of {self.model_class} models")
        check_texts(constraints=self.constraints)
        constraint(self.constraints)
        if self.model_class == LATENT:
            check_latent_constraints(self.constraints)
        lookup(FITNESSES, self.fitness, "fitness")
        lookup(OVERLONG, self.overlong, "overlong")
        lookup(ERR_TARGETS, self.err_target, "err_target")
        lookup(SELECTIONS, self.select, "select")
        if self.estimator:
            lookup(ESTIMATORS, self.estimator, "estimator")
        lookup(REFITS, self.refit, "refit")
        primitive_table(self.primitives)
        for shift in self.shifts:
            check_integers(shifts=shift)
        if any(shift < 1 for shift in self.shifts):
            raise SettingsError(f"back-shifts are at least 1, got {self.shifts}")
        self._check_islands()

    def _check_islands(self) -> None:
        check_at_least(1, islands=self.islands)
        check_at_least(0, max_evaluations=self.max_evaluations)
        if self.islands > MOST_ISLANDS:
            raise SettingsError(f"at most {MOST_ISLANDS} islands, got {self.islands}")
        if not 0.0 <= self.target_error < inf:
            raise SettingsError(f"target_error is a number and not negative, got {self.target_error}")
        lookup(SELECTION_POLICIES, self.emigrants, "emigrants")
        lookup(REPLACEMENT_POLICIES, self.replaced, "replaced")
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


def get_text_type(setting: "Field[Any]") -> Any:
    """Return the type of a setting on the command line and over REST."""
    return setting.metadata.get("text_type") or setting.type
