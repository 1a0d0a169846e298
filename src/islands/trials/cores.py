"""The simulations that trials hold against records: of what system, how each is made, what it has to do."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

from islands.discrepancy.core import Core
from islands.discrepancy.cores.bouc_wen_piezo import BoucWenPiezoCore
from islands.discrepancy.cores.column import ColumnCore
from islands.discrepancy.cores.narx import NarxCore
from islands.io.simulations import simulation
from islands.trials.goals import EXACT, IDENTIFIED, Goals
from islands.trials.hide.oscillator import OSCILLATOR
from islands.trials.hide.piezo import PIEZO
from islands.trials.hide.records import SEEN, Hiding
from islands.trials.hide.system import System
from islands.trials.hide.tanks import TANKS
from islands.trials.narx import identified


@dataclass(frozen=True, slots=True)
class Simulated:
    """A simulation in trials.

    Attributes
    ----------
    system : System
        What records are of.
    made : callable
        Makes the simulation that is held against a record.
    goals : Goals
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

    system: System
    made: Callable[[Hiding], Core]
    goals: Goals
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


def _narx(hiding: Hiding) -> Core:
    record = hiding.record
    alone = replace(record, u=record.u[:, :1], input_names=record.input_names[:1], input_units=("V",))
    model = identified(alone[: int(SEEN * record.samples)])
    return NarxCore(model, "narx", record.y[: model.maximum_lag])


def _estimated(name: str) -> Callable[[Hiding], Core]:
    """Return what makes a physical system whose parameters are estimated from the record."""
    return lambda hiding: simulation(name, hiding.record)


_EQUATION = frozenset(("relaxation", "rate-dependent-loop", "loop-asymmetry", "gain-step", "ageing"))
_INPUT = frozenset(
    ("delay", "clock-skew", "input-gain", "dead-zone", "input-saturation", "backlash", "stiction")
)

#: By name; a new one is an entry here, and where its system is new, a file in `islands.trials.hide`.
CORES: Mapping[str, Simulated] = MappingProxyType(
    {
        "bouc-wen-piezo": Simulated(PIEZO, lambda _: BoucWenPiezoCore(), EXACT, PIEZO.tolerance),
        "narx": Simulated(
            PIEZO,
            _narx,
            IDENTIFIED,
            {},
            without=_EQUATION | {"sensor-gain", "input-gain", "wrong-parameter"},
        ),
        "column": Simulated(
            PIEZO,
            lambda hiding: ColumnCore("column", hiding.nominal),
            replace(IDENTIFIED, first=85.0),
            {},
            apart=False,
            without=_EQUATION | _INPUT | {"wrong-parameter"},
        ),
        "second-order": Simulated(OSCILLATOR, _estimated("second-order"), EXACT, {}, free=True),
        "cascaded-tanks": Simulated(TANKS, _estimated("cascaded-tanks"), EXACT, {}, free=True),
    }
)
