"""Trial cases: the simulations under trial, their systems and their targets."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

from islands.errors import RecordError
from islands.estimation.estimate import estimate
from islands.estimation.refinement import refine
from islands.expressions.primitives import MUL, PRIMITIVES
from islands.expressions.tree import Apply, Expression, Lagged
from islands.models.narx import Model
from islands.models.regressor import Regressor, regressor
from islands.records.dataset import Dataset
from islands.simulation.outcome import EvaluationOutcome
from islands.simulation.predictors import free_run
from islands.simulators.external import RecordedOutput
from islands.simulators.identified import NarxSimulator
from islands.simulators.interface import Simulator
from islands.simulators.specification.factory import make_simulator
from lab.diagnosis.injection.measurement import VISIBLE_FRACTION, FaultyRecord
from lab.diagnosis.injection.oscillator import OSCILLATOR
from lab.diagnosis.injection.piezo import PIEZO
from lab.diagnosis.injection.rig import Rig
from lab.diagnosis.injection.tanks import TANKS
from lab.diagnosis.targets import EXACT, IDENTIFIED, Targets

#: Parameter constraint of the identified actuator: the output stays constant under a constant input.
_CONSTRAINT = "hysteresis"


def identify_actuator(record: Dataset) -> Model:
    """Identify a NARX model of a Bouc-Wen actuator with a fixed structure.

    The regressors are increments of the input, their size and sign, and products with input and output up to
    the second degree. The second input increment extrapolates the first one to the current sample, which the
    model cannot read. Parameters are estimated one step ahead and refined in free run.

    Raises
    ------
    RecordError
        The model cannot be estimated from this record.
    """
    found = estimate(_make_regressors(), record, _CONSTRAINT)
    if isinstance(found, EvaluationOutcome):
        raise RecordError(f"no NARX model of this structure can be estimated: {found}")
    refined = refine(found.model, record, None, _CONSTRAINT)
    return found.model if isinstance(refined, EvaluationOutcome) else refined.model


def _make_regressors() -> list[Regressor]:
    y, u = Lagged(0, 1), Lagged(1, 1)
    increments = [Apply(PRIMITIVES["phi1"], (Lagged(1, lag), Lagged(1, lag + 1))) for lag in (1, 2)]
    direction = Apply(PRIMITIVES["phi2"], (Lagged(1, 1), Lagged(1, 2)))

    def product(*factors: Expression) -> Expression:
        return Apply(MUL, factors)

    size = product(direction, increments[0])
    expressions = [y, *increments, product(size, u), product(size, y)]
    expressions += [product(increments[0], *levels) for levels in ((u, u), (u, y), (y, y))]
    return [item for _, item in map(regressor, expressions) if item is not None]


@dataclass(frozen=True, slots=True)
class SimulatedCase:
    """A simulation under trial.

    Attributes
    ----------
    system : Rig
        System that the records come from.
    make : callable
        Makes the simulator that is compared with a record. RecordError if none can be identified on it.
    goals : Targets
    tolerance : mapping
        Tolerances of the simulator's parameters.
    perturbed : bool
        Whether the parameters of the plant differ from those of the simulator. False if the simulator cannot
        be calibrated.
    free : bool
        Whether the parameters are estimated without tolerances.
    without : frozenset of str
        Faults of the system that this simulation has no name for, because it lacks the input or the equation
        they act on, or tolerances. Injected faults of this kind count as unknown causes.
    """

    system: Rig
    make: Callable[[FaultyRecord], Simulator]
    goals: Targets
    tolerance: Mapping[str, float]
    perturbed: bool = True
    free: bool = False
    without: frozenset[str] = frozenset()

    @property
    def nameable(self) -> tuple[str, ...]:
        """Faults that the analysis can name."""
        return tuple(name for name in self.system.known if name not in self.without)

    @property
    def nameless(self) -> tuple[str, ...]:
        """Faults that the analysis has no name for."""
        return (*self.system.unknown, *sorted(self.without))


def _make_narx(faulty: FaultyRecord) -> Simulator:
    """Identify a model on the visible part of a record; raise RecordError if it diverges on the record."""
    record = faulty.record
    single_input = replace(record, u=record.u[:, :1], input_names=record.input_names[:1], input_units=("V",))
    model = identify_actuator(single_input[: int(VISIBLE_FRACTION * record.samples)])
    outcome = free_run(model, single_input).outcome
    if not outcome:
        raise RecordError(f"the free run of the identified model fails: {outcome}")
    return NarxSimulator(model, "narx", record.y[: model.maximum_lag])


def _make_built_in(name: str) -> Callable[[FaultyRecord], Simulator]:
    """Return a factory of a built-in simulator; parameters are estimated from the record if possible."""
    return lambda faulty: make_simulator(name, faulty.record)


#: Faults in the equation of the plant, which needs a physical simulator.
_EQUATION_FAULTS = frozenset(("relaxation", "rate-dependent-loop", "loop-asymmetry", "gain-step", "ageing"))

#: Faults at the input, which need a simulator with an input.
_INPUT_FAULTS = frozenset(
    (
        "delay",
        "clock-skew",
        "input-gain",
        "dead-zone",
        "input-saturation",
        "rate-limit",
        "quantised-input",
        "backlash",
        "stiction",
    )
)

#: Cases by name. To add a case, add an entry; to add a system, add a file to `trials.injection`.
CASES: Mapping[str, SimulatedCase] = MappingProxyType(
    {
        "bouc-wen-piezo": SimulatedCase(PIEZO, _make_built_in("bouc-wen-piezo"), EXACT, PIEZO.tolerance),
        "narx": SimulatedCase(
            PIEZO,
            _make_narx,
            IDENTIFIED,
            {},
            without=_EQUATION_FAULTS | {"sensor-gain", "input-gain", "wrong-parameter"},
        ),
        "column": SimulatedCase(
            PIEZO,
            lambda faulty: RecordedOutput("column", faulty.nominal),
            replace(IDENTIFIED, first=85.0),
            {},
            perturbed=False,
            without=_EQUATION_FAULTS | _INPUT_FAULTS | {"wrong-parameter"},
        ),
        "second-order": SimulatedCase(OSCILLATOR, _make_built_in("second-order"), EXACT, {}, free=True),
        "linear": SimulatedCase(
            OSCILLATOR,
            _make_built_in("linear:2"),
            EXACT,
            {},
            free=True,
            without=frozenset(("offset", "gain-step", "ageing", "cogging")),
        ),
        "cascaded-tanks": SimulatedCase(TANKS, _make_built_in("cascaded-tanks"), EXACT, {}, free=True),
    }
)
