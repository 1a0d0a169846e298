"""The simulations that trials hold against records: of what system, how each is made, what it has to do."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

from islands.data.dataset import Dataset
from islands.discrepancy.interfaces.simulator import Simulator
from islands.discrepancy.simulators.bouc_wen_piezo import BoucWenPiezoSimulator
from islands.discrepancy.simulators.narx import NarxSimulator
from islands.discrepancy.simulators.recorded_output import RecordedOutput
from islands.errors import RecordError
from islands.estimation.estimate import estimate
from islands.estimation.refinement import refine
from islands.io.simulator_spec.factory import make_simulator
from islands.model.expression import Apply, Expression, Lagged
from islands.model.model import Model
from islands.model.primitives import MUL, PRIMITIVES
from islands.model.regressor import Regressor, regressor
from islands.performance.trials.injection.measurement import SEEN, FaultyRecord
from islands.performance.trials.injection.oscillator import OSCILLATOR
from islands.performance.trials.injection.piezo import PIEZO
from islands.performance.trials.injection.rig import Rig
from islands.performance.trials.injection.tanks import TANKS
from islands.performance.trials.targets import EXACT, IDENTIFIED, Targets
from islands.simulation.outcome import EvaluationOutcome

#: The constraint under which it holds still where its input does.
_CONSTRAINT = "hysteresis"


def identify_actuator(record: Dataset) -> Model:
    """Identify increments of the output by those of the input, their size and sign, and levels.

    The structure is fixed: what an increment of a Bouc-Wen actuator is made of, the levels up to the second
    degree. A second increment takes the first one on to the present, which a model may not read. Parameters
    are estimated one step ahead and refined in free run.

    Raises
    ------
    RecordError
        No such model can be estimated on this record.
    """
    found = estimate(_structure(), record, _CONSTRAINT)
    if isinstance(found, EvaluationOutcome):
        raise RecordError(f"no NARX model of this structure can be estimated: {found}")
    refined = refine(found.model, record, None, _CONSTRAINT)
    return found.model if isinstance(refined, EvaluationOutcome) else refined.model


def _structure() -> list[Regressor]:
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
    """A simulation in trials.

    Attributes
    ----------
    system : Rig
        What records are of.
    made : callable
        Makes the simulation that is held against a record.
    goals : Targets
    tolerance : mapping
        What is stated of the simulation's parameters.
    apart : bool
        The truth's parameters are not quite the simulation's. They are where it cannot be calibrated.
    free : bool
        Its parameters are estimated, and nothing is stated of them.
    without : frozenset of str
        What can be hidden in the system and has no name in this simulation: it has no place for it, or no
        tolerances. Hidden all the same, they are unknown causes.
    """

    system: Rig
    made: Callable[[FaultyRecord], Simulator]
    goals: Targets
    tolerance: Mapping[str, float]
    apart: bool = True
    free: bool = False
    without: frozenset[str] = frozenset()

    @property
    def nameable(self) -> tuple[str, ...]:
        """What can be hidden and found."""
        return tuple(name for name in self.system.known if name not in self.without)

    @property
    def nameless(self) -> tuple[str, ...]:
        """What can be hidden, and has no name."""
        return (*self.system.unknown, *sorted(self.without))


def _narx(hiding: FaultyRecord) -> Simulator:
    record = hiding.record
    alone = replace(record, u=record.u[:, :1], input_names=record.input_names[:1], input_units=("V",))
    model = identify_actuator(alone[: int(SEEN * record.samples)])
    return NarxSimulator(model, "narx", record.y[: model.maximum_lag])


def _estimated(name: str) -> Callable[[FaultyRecord], Simulator]:
    """Return what makes a physical system whose parameters are estimated from the record."""
    return lambda hiding: make_simulator(name, hiding.record)


_EQUATION = frozenset(("relaxation", "rate-dependent-loop", "loop-asymmetry", "gain-step", "ageing"))
_INPUT = frozenset(
    ("delay", "clock-skew", "input-gain", "dead-zone", "input-saturation", "backlash", "stiction")
)

#: Cases by name. A new one is an entry here; a new system is a file in `trials.injection`.
CORES: Mapping[str, SimulatedCase] = MappingProxyType(
    {
        "bouc-wen-piezo": SimulatedCase(PIEZO, lambda _: BoucWenPiezoSimulator(), EXACT, PIEZO.tolerance),
        "narx": SimulatedCase(
            PIEZO,
            _narx,
            IDENTIFIED,
            {},
            without=_EQUATION | {"sensor-gain", "input-gain", "wrong-parameter"},
        ),
        "column": SimulatedCase(
            PIEZO,
            lambda hiding: RecordedOutput("column", hiding.nominal),
            replace(IDENTIFIED, first=85.0),
            {},
            apart=False,
            without=_EQUATION | _INPUT | {"wrong-parameter"},
        ),
        "second-order": SimulatedCase(OSCILLATOR, _estimated("second-order"), EXACT, {}, free=True),
        "cascaded-tanks": SimulatedCase(TANKS, _estimated("cascaded-tanks"), EXACT, {}, free=True),
    }
)
