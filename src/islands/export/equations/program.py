"""Program of an extended simulation, in any language with structures."""

import re
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from typing import ClassVar

from islands.export.equations.collection import CHANNEL_OPERATORS
from islands.export.equations.extended_system import ExtendedEquations, SampledCore, SignalMap
from islands.export.equations.language import Language
from islands.export.equations.sampled_core import MEASURED, RECORDED
from islands.export.equations.statements import MOMENTS, EquationCode, make_step
from islands.export.languages.bodies import function_name
from islands.expressions.printing import render
from islands.expressions.tree import RATE, Apply, Expression, Symbol
from islands.models.block import Block
from islands.simulators.intersample import REACH, design_low_pass
from islands.simulators.ode.equation_parser import TIME
from islands.simulators.ode.system_document import SIMULATED


class EquationProgram(ABC):
    """Writer of the program of an extended simulation.

    A subclass has a language, and writes what only this language requires.
    """

    language: ClassVar[Language]

    def __init__(self, equations: ExtendedEquations) -> None:
        self.given, self.code = equations, EquationCode(equations, self.language)
        self.columns = [self.code.identifiers[name] for name in equations.columns]
        self.states = self.code.list_states()
        self.input = self.code.identifiers[equations.system.input]
        self.moments = self.code.identifiers[MOMENTS]
        self.maps = (*equations.input_maps, *equations.moment_maps, *equations.output_maps)

    def write(self) -> str:
        """Return the program."""
        given, language = self.given, self.language
        operators = {name for signal_map in self.maps for name, _ in signal_map.operators}
        has_slopes = not given.core or any(force.state for force in given.forces)
        text = language.program.format(
            **self.describe_data(),
            **self._reading(),
            **(self._integration() if given.core is None else self._sampling(given.core)),
            output=self._indent(self._output()),
            move=self._fill(language.move, moves=self._moves()) if has_slopes else "",
            operators="".join(f"{text}\n" for name, text in language.operators.items() if name in operators),
            maps="".join(self._map(signal_map) for signal_map in self.maps),
            forces=self._forces() if given.forces else "",
        )
        return self.complete(text)

    @abstractmethod
    def describe_data(self) -> dict[str, str]:
        """Return the texts of parameters, states and columns in the template of the program."""

    @abstractmethod
    def complete(self, text: str) -> str:
        """Return the program with the definitions that its text requires."""

    @abstractmethod
    def apply_operator(self, function: str, result: str, arguments: Sequence[str]) -> list[str]:
        """Write the statements that apply an operator to the signal ``x`` of a map."""

    @abstractmethod
    def map_input(self) -> list[str]:
        """Write the statements before a simulation, which apply the maps of the input."""

    @abstractmethod
    def map_output(self) -> list[str]:
        """Write the statements after a simulation, which apply the maps of the output."""

    @abstractmethod
    def copy_output(self, column: str, count: int | None) -> list[str]:
        """Write the statements that copy a column, or its first samples, to the output."""

    @abstractmethod
    def read_signal(self, function: str, source: Symbol, arguments: Sequence[str]) -> str:
        """Write the call of a function of ``Language.rates`` with a signal."""

    @abstractmethod
    def list_weights(self, weights: Sequence[Sequence[float]]) -> str:
        """Write a table of numbers."""

    def begin(self, _lines: Sequence[str], *_arguments: str) -> list[str]:
        """Write what the language requires before statements, which may not read all of the arguments."""
        return []

    def wrap_signals(self, _sources: Iterable[Symbol]) -> str:
        """Write the functions of signals whose rates or delays are read, if the language requires them."""
        return ""

    def read(self, signal: Expression) -> str:
        """Write the value of a signal at the part ``part`` of the step ``step``."""
        given = self.given
        match signal:
            case Symbol(name) if name == TIME:
                return self.language.time
            case Symbol(name) if name == given.gain_signal:
                return self._call("interpolate_gain", "p", "r", "step", "part")
            case Symbol(name):
                value = self._call(f"read_{self.code.identifiers[name]}", "p", "r", "step", "part")
                if name == given.system.input and given.gain is not None and not given.gain_signal:
                    return f"{self._call('read_gain', 'p', self.language.part)}*{value}"
                return value
            case Apply(function, (Symbol(name) as source, *others)):
                is_held = name == given.system.input and given.hold == "zero-order"
                if function == RATE and given.core is not None:
                    return self.read_signal("find_central_rate", source, [])
                reader = "find_rate" if function == RATE else "delay"
                if function == RATE and name == given.system.input and given.has_kinks:
                    reader = "find_limited_rate"
                if is_held:
                    reader = "find_held_rate" if function == RATE else "delay_held"
                tau = [self.code.write(each) for each in others]
                return self.read_signal(reader, source, tau if is_held else ["part", *tau])
        raise AssertionError(signal)

    def _indent(self, lines: Iterable[str], depth: int = 1) -> str:
        return f"\n{' ' * (self.language.indent * depth)}".join(lines)

    def _fill(self, template: str, **parts: str | list[str]) -> str:
        """Return a template with texts, and with statements at its first level."""
        return template.format(
            **{name: part if isinstance(part, str) else self._indent(part) for name, part in parts.items()}
        )

    def _add(self, target: str, term: str) -> str:
        return self.language.add.format(target, term)

    def _at(self, column: str, place: str | int = "k") -> str:
        """Write a sample of a column, whose place is a variable or counted from zero."""
        place = place if isinstance(place, str) else str(place + self.language.first)
        return self.language.at.format(column, place)

    def _call(self, function: str, *arguments: str) -> str:
        return f"{function}({', '.join([*arguments, *self.language.context])})"

    def _name(self, column: str) -> str:
        """Write a column of the record."""
        return f"r{self.language.member}{column}"

    def _loop(self, first: int, lines: Iterable[str]) -> list[str]:
        begin = self.language.loop.format(first + self.language.first)
        return [begin, *(f"{' ' * self.language.indent}{line}" for line in lines), self.language.end]

    def _clear(self, states: Iterable[str]) -> list[str]:
        clear = self.language.clear
        return [clear.format(self.code.identifiers[name]) for name in states] if clear else []

    def _finish(self, name: str) -> list[str]:
        return [self.language.finish.format(name)] if self.language.finish else []

    def _integration(self) -> dict[str, str]:
        """Return the functions that integrate the equations, and the statements of a simulation."""
        language = self.language
        states = [name for name, _ in self.given.system.derivatives]
        steps = [*self._steps(states, f"s{language.member}", language.step), *self._limits()]
        return {
            "core": "",
            "derivatives": self._fill(language.derivatives, derivatives=self._derivatives()),
            "advance": self._fill(language.advance, advances=[*self.begin(steps, "fourth"), *steps]),
            "before": self._indent([*self.map_input(), ""]),
            "loop": language.loop_steps,
            "after": self._indent([*self._add_forces(), *self.map_output(), ""]),
        }

    def _sampling(self, core: SampledCore) -> dict[str, str]:
        """Return the function of a simulation in discrete time, and the statements of a simulation."""
        before = [*self.map_input(), self.language.simulate_core, *self._add_forces()]
        return {
            "core": self._core(core),
            "derivatives": "",
            "advance": "",
            "before": self._indent([*before, ""]),
            "loop": self.language.loop_samples.format(simulated=self.code.identifiers[SIMULATED]),
            "after": self._indent([*self.map_output(), ""]),
        }

    def _add_forces(self) -> list[str]:
        return [self.language.add_forces] if self.given.forces else []

    def _derivatives(self) -> list[str]:
        code, right_sides = self.code, self.given.system.derivatives
        lines = code.assign_variables([right for _, right in right_sides])
        lines += self._clear(each.state for each in self.given.forces if each.state)
        lines += self._assign_slopes(dict(right_sides))
        return [*self.begin(lines, "p", "s", "in"), *lines]

    def _assign_slopes(
        self, slopes: Mapping[str, Expression], local: Mapping[str, str] | None = None
    ) -> list[str]:
        targets = [(f"slope.{self.code.identifiers[name]}", slope) for name, slope in slopes.items()]
        return self.code.assign(targets, local)

    def _moves(self) -> list[str]:
        slope = f"slope{self.language.member}"
        return [self._add(f"next.{name}", f"time*{slope}{name}") for name, *_ in self.states]

    def _output(self) -> list[str]:
        code, output = self.code, self.given.system.output
        lines = [*code.assign_variables([output]), *code.assign([(f"{self.language.declare}y", output)])]
        return [*self.begin(lines, "p", "s", "in"), *lines, *self._finish("y")]

    def _steps(self, states: Iterable[str], access: str, time: str) -> list[str]:
        return make_step(self.code, access, [self.code.identifiers[name] for name in states], time)

    def _limits(self) -> list[str]:
        code, lines, clips = self.code, [], []
        access, condition = f"s{self.language.member}", self.language.condition
        for name, limit in self.given.limits.items():
            state = f"{access}{code.identifiers[name]}"
            if limit.caught is not None and limit.upper is not None:
                upper, receiver = code.write(limit.upper), f"{access}{code.identifiers[limit.receiver]}"
                gain = self._add(receiver, f"{code.write(limit.caught)}*({state} - {upper})")
                lines.append(condition.format(f"{state} > {upper}", gain))
            for expression, comparison in ((limit.lower, "<"), (limit.upper, ">")):
                if expression is not None:
                    bound = code.write(expression)
                    clips.append(condition.format(f"{state} {comparison} {bound}", f"{state} = {bound};"))
        return lines + clips

    def _map(self, given: SignalMap) -> str:
        local, before = self._read_operators(given)
        lines = self.code.assign([(self._at("x"), given.equation)], local)
        if re.search(r"\bt\b", "\n".join(lines)):
            lines.insert(0, f"{self.language.declare}t = {self.language.sample_time};")
        return self._fill(
            self.language.map,
            summary=f"{given.effect}: {given.summary}".replace("*/", "* /"),
            name=map_function(given),
            operators=[*self.begin([*before, *lines], "p", "rows"), *before, ""],
            statements=self._indent(lines, 2),
        )

    def _read_operators(self, given: SignalMap) -> tuple[dict[str, str], list[str]]:
        """Return the texts of the results of operators, and the statements that compute them."""
        local, lines = {"x": self._at("x"), "t": "t"}, []
        for index, (name, arguments) in enumerate(given.operators):
            result = f"z{index}"
            if name in CHANNEL_OPERATORS:
                assert isinstance(arguments[0], Symbol)
                column = self._name(self.code.identifiers[arguments[0].name])
                first = f" - {self._at(column, 0)}" if CHANNEL_OPERATORS[name] else ""
                local[result] = f"({self._at(column)}{first})"
            elif name in ("first", "rests"):
                value = self._at("x", 0) if name == "first" else self.language.rests
                lines.append(f"{self.language.declare}{result} = {value};")
            else:
                function = "interpolate_at" if name == "interpolate" else name.replace("-", "_")
                texts = [self.code.write(each) for each in arguments]
                if name == "limit-rate":
                    texts.append("3" if given in self.given.moment_maps else "1")
                lines += self.apply_operator(function, result, texts)
                local[result] = self._at(result)
        return local, lines

    def _forces(self) -> str:
        given, language, local = self.given, self.language, {"x": "x", "v": "v"}
        arguments = ("p", "s", "x", "v")
        targets = [f"force_{place}" for place in range(len(given.forces))]
        forces = self.code.assign(
            [
                (f"{language.declare}{name}", force.force)
                for name, force in zip(targets, given.forces, strict=True)
            ],
            local,
        )
        slopes = {force.state: force.slope for force in given.forces if force.slope is not None}
        changes = self._assign_slopes(slopes, local)
        changes = [
            *self.begin(changes, *arguments),
            *self._clear(name for name, _ in given.system.derivatives),
            *changes,
        ]
        steps = self._indent(self._steps(slopes, "s.", "time"), 2)
        return self._fill(
            language.forces,
            forces=[*self.begin(forces, *arguments), *forces],
            total=" + ".join(targets),
            input=self.input,
            states="struct" if slopes else "const struct",
            slopes=self._fill(language.force_slopes, slopes=changes) if slopes else "",
            steps=language.force_steps.format(advances=steps) if slopes else "",
        )

    def _reading(self) -> dict[str, str]:
        """Return the functions that read the signals of the equations, and those that they call."""
        given, code, language = self.given, self.code, self.language
        lines = [
            f"in.{code.identifiers[render(signal)]} = {self.read(signal)};" for signal in code.read_signals
        ]
        lines = [*self.begin(lines, "p", "r", "step", "part"), *lines]
        signals = self._fill(language.signals, lines=lines)
        sources = {
            str(signal.arguments[0]): signal.arguments[0]
            for signal in code.signals
            if isinstance(signal, Apply)
        }
        read = [name for name in given.columns if Symbol(name) in {*code.signals, *sources.values()}]
        if given.forces and given.system.input not in read:
            read.insert(0, given.system.input)
        readers = "".join(self._reader(name) for name in read)
        calls = readers + self.interpolate(given.system.input) if given.moment_maps else readers
        gain = "" if given.gain is None else code.write(given.gain, {TIME: "t"})
        rates = _list_called(language.rates, signals)
        return {
            "signals": signals,
            "readers": readers,
            "between": _list_called(language.interpolations, calls),
            "band_limit": self._limit_band() if "limit_band(" in calls else "",
            "gain": language.gain.format(gain=gain) if gain else "",
            "gain_between": language.gain_between if given.gain_signal else "",
            "rates": (language.pointer if rates else "") + rates,
            "wrappers": self.wrap_signals(
                each for _, each in sorted(sources.items()) if isinstance(each, Symbol)
            ),
        }

    def interpolate(self, name: str) -> str:
        """Write the value of a column at the part ``part`` of the step ``step``."""
        hold = self.given.hold if name == self.given.system.input else "first-order"
        return self.language.between[hold].format(self._name(self.code.identifiers[name]))

    def _reader(self, name: str) -> str:
        """Write the function that reads a column between samples."""
        given, language = self.given, self.language
        is_input = name == given.system.input
        value = self.interpolate(name)
        if is_input and given.moment_maps:
            value = language.moment.format(self._name(self.moments))
        lines = [language.give.format(value)]
        if is_input and given.characteristic is not None:
            result = f"{language.declare}{language.value}"
            mapped = self.code.assign([(result, given.characteristic)], {"x": "x"})
            lines = [f"{language.declare}x = {value};", *mapped, *self._finish(language.value)]
        lines = [*self.begin(lines, "p", "part"), *lines]
        return self._fill(language.reader, name=self.code.identifiers[name], lines=lines)

    def _limit_band(self) -> str:
        phases = 2 * self.given.times
        weights = self.list_weights(design_low_pass(phases).tolist())
        return self.language.band_limit.format(reach=REACH, phases=phases, weights=weights)

    def _core(self, core: SampledCore) -> str:
        """Return the function ``simulate_core``, and the functions that it calls."""
        language, names, u = self.language, self.code.identifiers, self._name(self.input)
        primitives = () if core.block is None else core.block.primitives
        if core.block is not None:
            lines = self._model(core.block, u, self._name(names[MEASURED]))
        elif core.output is None:
            lines = self.copy_output(self._name(names[RECORDED]), None)
        else:
            local = {"x": "x", "y": self._at("y"), **{name: name for name, _ in core.after}}
            x = self._at(u, language.delayed.format(core.delay) if core.delay else "k")
            steps = self.code.assign([(self._at("y"), core.output), *core.after], local)
            first = {"x": self._at(u, 0)}
            lines = [
                *language.output,
                *(
                    f"{language.variable}{name} = {self.code.write(each, first)};"
                    for name, each in core.before
                ),
                *self._loop(0, [f"{language.declare}x = {x};", *steps]),
            ]
        return self._fill(
            language.core,
            lines=[*self.begin(lines, "p", "s"), *lines],
            functions="".join(f"{language.define(primitive)}\n" for primitive in primitives),
        )

    def _model(self, block: Block, u: str, measured: str) -> list[str]:
        """Write the free run of a model. The past samples of a state are variables, the newest one is 1."""
        language, lag = self.language, block.maximum_lag
        states = list(enumerate(block.signals[block.outputs : block.computed], start=block.outputs))
        own = {name for _, name in states}
        leads = dict(zip(block.signals, block.leads, strict=True))

        def read(name: str, back: int) -> str:
            if name in own:
                return f"{name}_{back}"
            # The program reads the same column as the simulation, which may be one sample early.
            back += leads[name]
            return language.past.format(name, back) if back else self._at(name)

        def start(place: int, back: int) -> str:
            return block.start_text(place, lambda name, _lag: self._at(name, lag - back), function_name)

        def set_zero(name: str) -> str:
            return f"{language.variable}{name} = {language.zero};"

        def accumulate(target: str, place: int) -> list[str]:
            terms = block.terms(place, read, function_name)
            return [set_zero(target), *(self._add(target, term) for term in terms)]

        lines = [f"{language.alias}u = {u};"] if any(name == "u" for name, _ in block.samples_read) else []
        lines += [*language.output, *(self.copy_output(measured, lag) if lag else [])]
        steps, is_long = [], f"{self._name('samples')} >= {lag}"
        for place, name in states:
            for back in range(1, block.depths[place] + 1):
                value = f"{name}_{back} = {start(place - block.outputs, back)};"
                lines += [set_zero(f"{name}_{back}"), language.condition.format(is_long, value)]
            steps += accumulate(f"{name}_0", place)
        steps += [*accumulate("total", 0), f"{self._at('y')} = total;"]
        for place, name in states:
            steps += [f"{name}_{back} = {name}_{back - 1};" for back in range(block.depths[place], 0, -1)]
        return [*lines, *self._loop(lag, steps)]


def map_function(given: SignalMap) -> str:
    """Return the name of the function of a map."""
    return f"apply_{given.effect.replace('-', '_')}"


def _list_called(functions: Mapping[str, str], calls: str) -> str:
    """Return the functions that a text calls."""
    return "".join(text for name, text in functions.items() if re.search(rf"\b{name}\(", calls))
