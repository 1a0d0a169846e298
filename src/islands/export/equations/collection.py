"""Collection of the equations of an extended simulation from its document."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import isinf

import numpy as np

from islands.effects.catalogue import CATALOGUE, get_summary
from islands.effects.interface.context import SimulationContext
from islands.effects.interface.effect import Effect, ForceLaw, Site
from islands.effects.time_variation import GAIN_EFFECTS
from islands.errors import ModelError
from islands.export.equations.extended_system import (
    ExtendedEquations,
    NamedValue,
    OutputForce,
    SampledCore,
    SignalMap,
    StateLimit,
)
from islands.export.equations.sampled_core import (
    drop_force,
    read_core,
    read_output_system,
    read_system,
    refuse,
)
from islands.expressions.primitives import EQUATION_FUNCTIONS, NEG
from islands.expressions.tree import Apply, Constant, Expression, Primitive, Symbol, substitute
from islands.records.channel_names import TEMPERATURES, parse_channel_name
from islands.simulators.extended import count_sampled_maps
from islands.simulators.ode.effects import (
    LAW_STATE,
    extend_system,
    is_term,
    list_terms,
    parse_law,
)
from islands.simulators.ode.system import OdeEffect, OdeSystem
from islands.simulators.specification.base import EffectSpec
from islands.simulators.specification.description import read_scales
from islands.simulators.specification.table import ExtendedSpec

#: Signal that is the factor of the gain; no name in equations has brackets.
GAIN_SIGNAL = "gain(t)"

#: Operators on a channel, and whether it is a temperature.
CHANNEL_OPERATORS = {"temperature": True, "coupled": False}


def collect_equations(spec: ExtendedSpec) -> ExtendedEquations:
    """Return the equations of an extended simulation.

    Raises
    ------
    ModelError
        The simulation is a function or an FMU, its parameters are unknown, or an effect has no program.
    """
    levels = [spec]
    while isinstance(levels[-1].core, ExtendedSpec):
        if (levels[-1].hold, levels[-1].times) != ("first-order", 1):
            raise refuse("an extended simulation whose input is interpolated twice")
        levels.append(levels[-1].core)
    core = read_core(levels[-1])
    outer = levels if core is None else levels[:-1]
    if any(level.output_equation is not None for level in outer):
        raise refuse("missing terms that are added to the output of an extended simulation")
    system = read_system(levels[-1]) if core is None else read_output_system(levels[-1])
    return _Collection(system, core, levels).collect()


@dataclass(slots=True)
class _Collection:
    system: OdeSystem
    core: SampledCore | None
    levels: list[ExtendedSpec]
    values: dict[str, NamedValue] = field(default_factory=dict)
    start: dict[str, NamedValue] = field(default_factory=dict)
    columns: dict[str, str] = field(default_factory=dict)
    terms: list[OdeEffect] = field(default_factory=list)
    clips: set[str] = field(default_factory=set)
    laws: list[tuple[str, Mapping[str, Expression], ForceLaw]] = field(default_factory=list)
    characteristic: Expression | None = None
    moment_maps: list[SignalMap] = field(default_factory=list)
    gain: Expression | None = None

    def collect(self) -> ExtendedEquations:
        core, system = self.levels[-1], self.system
        self.values |= {
            parameter.name: NamedValue(parameter.value, parameter.unit) for parameter in system.parameters
        }
        self.columns[system.input] = core.inputs[0]
        if self.core is None:
            self.columns |= {name: self._find_column(name) for name in system.channels}
        else:
            self.columns |= self.core.columns
            self.values |= self.core.values
            self.start |= self.core.start
        for state in system.states:
            value = self.levels[0].start.get(state.name, state.initial or 0.0)
            self.start[state.name] = NamedValue(value, state.unit)
        input_maps: list[SignalMap] = []
        output_maps: list[SignalMap] = []
        for level in self.levels:
            inputs, outputs = self._read_level(level)
            if level is core and self.core is None:
                inputs = self._take_characteristic(inputs)
            input_maps += inputs
            output_maps = [*outputs, *output_maps]
        has_equation = system.force is not None and bool(system.force.rate)
        factor = GAIN_SIGNAL if self.gain is not None and system.gain else ""
        named = [(symbols, law) for _, symbols, law in self.laws] if has_equation else []
        extended = extend_system(system, self.terms, factor, named)
        return ExtendedEquations(
            system=drop_force(extended),
            columns=self.columns,
            output=self.levels[0].output,
            values=self.values,
            start=self.start,
            hold=core.hold,
            times=core.times,
            steps=max(system.steps, 1),
            dt=core.scales.dt,
            fitted=round(core.scales.fitted_s / core.scales.dt),
            limits=self._find_limits(),
            input_maps=tuple(input_maps),
            output_maps=tuple(output_maps),
            characteristic=self.characteristic,
            moment_maps=tuple(self.moment_maps),
            forces=() if has_equation else tuple(self._make_force(*law) for law in self.laws),
            gain=self.gain,
            gain_signal=factor,
            core=self.core,
            effects=tuple(
                f"{each.name}: {get_summary(each.name)}" for level in self.levels for each in level.effects
            ),
        )

    def _find_column(self, name: str) -> str:
        columns = self.levels[-1].inputs[1:]
        found = [column for column in columns if name in (column, parse_channel_name(column).stem)]
        if len(found) != 1:
            raise refuse(f"an extended simulation without one column of the channel {name}")
        return found[0]

    def _read_level(self, level: ExtendedSpec) -> tuple[list[SignalMap], list[SignalMap]]:
        """Read the effects of one extension; return its maps of the input and of the output."""
        units = parse_channel_name(level.inputs[0]).unit, parse_channel_name(level.output).unit
        context = read_scales(level.scales, np.zeros(2), level.scales.dt, units)
        maps: dict[Site, list[SignalMap]] = {Site.INPUT: [], Site.OUTPUT: []}
        for each in level.effects:
            effect = CATALOGUE.get(each.name)
            symbols = self._name_values(each, effect, context)
            if effect is not None and effect.site in maps:
                maps[effect.site].append(self._make_map(effect, symbols, context))
            elif effect is not None and isinstance(effect.form, ForceLaw):
                self._add_law(effect, each, symbols)
            elif effect is not None and effect.name in GAIN_EFFECTS:
                self._add_gain(effect, symbols)
            else:
                self._add_term(each)
        return maps[Site.INPUT], maps[Site.OUTPUT]

    def _name_values(
        self, given: EffectSpec, effect: Effect | None, context: SimulationContext
    ) -> dict[str, Expression]:
        """Give names to the values of an effect; return what is written for ``n0``, ``n1``, ..."""
        names = list(given.parameters)
        # The parameter of an effect of a channel has a unit of that channel, which the document has not.
        if effect is not None and len(names) > 1:
            names = [each.name for each in effect.parameters(context)]
        symbols: dict[str, Expression] = {}
        for index, name in enumerate(names):
            if name not in given.parameters:
                raise ModelError(f"effect {given.name} has no value for {name}: diagnose again")
            full = name if name.startswith(given.name) else f"{given.name} {name}"
            entry = given.parameters[name]
            self.values[full] = NamedValue(entry.value, entry.unit)
            symbols[f"n{index}"] = Symbol(full)
        return symbols

    def _make_map(
        self, effect: Effect, symbols: Mapping[str, Expression], context: SimulationContext
    ) -> SignalMap:
        if effect.equation is None:
            raise refuse(f"the effect {effect.name}")
        written = effect.equation(context)
        operators = tuple(
            (
                name,
                (Symbol(self._find_channel(effect.name, thermal=CHANNEL_OPERATORS[name])),)
                if name in CHANNEL_OPERATORS
                else tuple(substitute(parse_law(each), symbols) for each in arguments),
            )
            for name, *arguments in written.operators
        )
        equation = substitute(parse_law(written.equation), symbols)
        return SignalMap(effect.name, get_summary(effect.name), equation, operators)

    def _take_characteristic(self, maps: list[SignalMap]) -> list[SignalMap]:
        """Take the last maps if they act between samples; return the others."""
        last = count_sampled_maps([CATALOGUE[signal_map.effect] for signal_map in maps])
        if any(signal_map.operators for signal_map in maps[last:]):
            self.moment_maps = maps[last:]
            return maps[:last]
        for signal_map in maps[last:]:
            before = self.characteristic or Symbol("x")
            self.characteristic = substitute(signal_map.equation, {"x": before})
        return maps[:last]

    def _find_channel(self, effect: str, thermal: bool) -> str:
        """Return the name of the channel of an effect, which is found by its unit."""
        columns = self.levels[-1].inputs[1:]
        channels = [each for each in columns if (parse_channel_name(each).unit in TEMPERATURES) == thermal]
        if len(channels) != 1 and len(columns) != 1:
            raise refuse(f"the effect {effect}, since several channels or none may be meant,")
        column = (channels or columns)[0]
        name = next((name for name, own in self.columns.items() if own == column), column)
        self.columns[name] = column
        return name

    def _add_law(self, effect: Effect, given: EffectSpec, symbols: dict[str, Expression]) -> None:
        law = effect.form
        assert isinstance(law, ForceLaw)
        if not is_term(law) or (self.system.force is None and self.core is None):
            raise refuse(f"the effect {effect.name}")
        core = self.levels[-1]
        times = core.times
        context = read_scales(core.scales, np.zeros(2), core.scales.dt / times, ("", ""))
        constants = {
            f"n{len(symbols) + index}": Constant(float(value))
            for index, value in enumerate(law.constants(context))
        }
        state = f"{effect.name} {LAW_STATE}"
        if law.state_equation:
            values = np.array(
                [self.values[each.name].value for each in symbols.values() if isinstance(each, Symbol)]
            )
            unit = given.parameters["z0"].unit if "z0" in given.parameters else ""
            self.start[state] = NamedValue(law.get_initial_state(values), unit)
        if law.initial_state_index is not None:  # it is a state of the program and no parameter
            initial = symbols[f"n{law.initial_state_index}"]
            assert isinstance(initial, Symbol)
            del self.values[initial.name]
        self.laws.append((effect.name, {**symbols, **constants, LAW_STATE: Symbol(state)}, law))

    def _make_force(self, name: str, symbols: Mapping[str, Expression], law: ForceLaw) -> OutputForce:
        force = substitute(parse_law(law.equation), symbols)
        if law.is_dissipative and self.levels[-1].scales.frame.sense < 0.0:
            force = Apply(NEG, (force,))
        if not law.state_equation:
            return OutputForce(name, force)
        state = symbols[LAW_STATE]
        assert isinstance(state, Symbol)
        return OutputForce(name, force, state.name, substitute(parse_law(law.state_equation), symbols))

    def _add_gain(self, effect: Effect, symbols: Mapping[str, Expression]) -> None:
        core = self.levels[-1]
        context = read_scales(core.scales, np.zeros(2), core.scales.dt / core.times, ("", ""))
        assert effect.equation is not None
        written = parse_law(effect.equation(context).equation)
        match written:
            case Apply(Primitive("mul"), (Symbol("x"), factor)) if self.gain is None:
                self.gain = substitute(factor, symbols)
            case _:
                self.gain = substitute(written, {**symbols, "x": self.gain or Constant(1.0)})

    def _add_term(self, given: EffectSpec) -> None:
        listed = {each.name: each for each in list_terms(self.system)}
        if given.name not in listed:
            raise refuse(f"the effect {given.name}")
        if listed[given.name].term is None:
            self.clips.add(given.name)
        else:
            self.terms.append(listed[given.name])

    def _find_limits(self) -> dict[str, StateLimit]:
        limits = {}
        for state in self.system.states:
            label = f"state-clip:{state.name}"
            lower: Expression | None = None if isinf(state.lower) else Constant(state.lower)
            upper: Expression | None = None if isinf(state.upper) else Constant(state.upper)
            caught: Expression | None = None
            if label in self.clips:
                level = Symbol(label)
                upper = _choose("min", upper, level)
                lower = _choose("max", lower, Apply(NEG, (level,)))
                caught = Symbol(f"{label} caught") if f"{label} caught" in self.values else None
            own = f"state-range:{state.name}"
            if own in self.clips:
                upper = _choose("min", upper, Symbol(f"{own} upper"))
                lower = _choose("max", lower, Symbol(f"{own} lower"))
            if (lower, upper) != (None, None):
                limits[state.name] = StateLimit(lower, upper, state.spills_into if caught else "", caught)
        return limits


def _choose(function: str, given: Expression | None, other: Expression) -> Expression:
    return other if given is None else Apply(EQUATION_FUNCTIONS[function], (given, other))
