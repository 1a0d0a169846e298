"""Program of an extended simulation in MATLAB, which also runs in Octave."""

import re

from islands.data.segments import MAX_RANGE_AT_REST
from islands.export.equations.collection import CHANNEL_OPERATORS
from islands.export.equations.extended_system import ExtendedEquations, SignalMap
from islands.export.equations.matlab.core import write_matlab_core
from islands.export.equations.matlab.operators import MATLAB_OPERATORS
from islands.export.equations.matlab.signals import write_matlab_signals
from islands.export.equations.matlab.templates import (
    ADVANCE,
    DEFINITIONS,
    FILE,
    FORCE_SLOPES,
    FORCE_STEPS,
    FORCES,
    LOOP,
    MAP,
    MOVE,
    SAMPLED_LOOP,
)
from islands.export.equations.statements import EquationCode, make_step
from islands.expressions.tree import Symbol
from islands.simulators.ode.output_system import SIMULATED

#: Functions that are complex outside the domain of real numbers.
_REAL = {"sqrt": "root", "log": "logarithm", "pow": "raise"}

#: Names that the arguments of the function cannot have.
_TAKEN = frozenset(("y", "p", "r", "s", "c", "in", "initial", "shape", "step", "middle"))


def matlab_equations(equations: ExtendedEquations) -> str:
    """Return an extended simulation of equations as a MATLAB function in ASCII."""
    return _MatlabWriter(equations).write()


def make_matlab_code(equations: ExtendedEquations) -> EquationCode:
    """Return the writer of expressions and statements in MATLAB."""
    return EquationCode(equations, ".", _REAL, "", " ...", lambda base, power: f"raise({base}, {power})")


def _indent(lines: list[str], columns: int = 2) -> str:
    return f"\n{' ' * columns}".join(lines)


class _MatlabWriter:
    def __init__(self, equations: ExtendedEquations) -> None:
        self.given, self.code = equations, make_matlab_code(equations)

    def write(self) -> str:
        given, code = self.given, self.code
        columns = [code.identifiers[name] for name in given.columns]
        arguments = [f"{name}_" if name in _TAKEN else name for name in columns]
        states = code.list_states()
        maps = [*given.input_maps, *given.output_maps]
        names = {name for each in maps for name, _ in each.operators}
        text = FILE.format(
            columns=", ".join(arguments),
            first=arguments[0],
            count=len(arguments) + 1,
            last=len(arguments) + 2,
            heading="\n".join(f"% {line}".rstrip() for line in code.describe()),
            record=_indent(
                [f"r.{name} = double({given}(:));" for name, given in zip(columns, arguments, strict=True)]
            ),
            before=self._before(),
            after=self._after(),
            dt=repr(given.dt),
            steps=given.times * given.steps,
            part_steps=given.steps,
            step=repr(given.dt / (given.times * given.steps)),
            fitted=given.fitted,
            rest=repr(MAX_RANGE_AT_REST),
            parameters=_indent(
                [f"p.{name} = {value}; % {unit}" for name, value, unit in code.list_parameters()]
            ),
            states=_indent([f"s.{name} = {value}; % {unit}" for name, value, unit in states]),
            output=_indent(self._output()),
            integration=self._integration([name for name, _, _ in states]),
            loop=SAMPLED_LOOP.format(simulated=code.identifiers[SIMULATED]) if given.core else LOOP,
        )
        text += write_matlab_core(given.core, code) if given.core else ""
        text += write_matlab_signals(given, code) + self._forces()
        text += "".join(f"{self._map(each)}\n" for each in maps)
        text += "".join(f"{MATLAB_OPERATORS[name]}\n" for name in MATLAB_OPERATORS if name in names)
        called = [*code.find_functions(text), *(key for key, name in _REAL.items() if f"{name}(" in text)]
        return (text + "\n".join(DEFINITIONS[each] for each in called)).rstrip() + "\n"

    def _integration(self, states: list[str]) -> str:
        """Write the functions that advance the states; forces on the output may have states too."""
        given, code = self.given, self.code
        moves = _indent([f"next.{name} = next.{name} + time*slope.{name};" for name in states])
        move = MOVE.format(moves=moves) if not given.core or any(each.state for each in given.forces) else ""
        if given.core:
            return move
        own = [code.identifiers[name] for name, _ in given.system.derivatives]
        steps = make_step(code, "s.", own, "c.step") + self._limits()
        return move + ADVANCE.format(derivatives=_indent(self._derivatives()), advances=_indent(steps))

    def _derivatives(self) -> list[str]:
        code, given = self.code, self.given
        lines = code.assign_variables([right for _, right in given.system.derivatives])
        zeros = [f"slope.{code.identifiers[each.state]} = 0;" for each in given.forces if each.state]
        targets = [(f"slope.{code.identifiers[name]}", right) for name, right in given.system.derivatives]
        return [*lines, *zeros, *code.assign(targets)]

    def _output(self) -> list[str]:
        output = self.given.system.output
        return [*self.code.assign_variables([output]), *self.code.assign([("y", output)])]

    def _limits(self) -> list[str]:
        code, own, lines, clips = self.code, self.code.identifiers, [], []
        for name, limit in self.given.limits.items():
            state = f"s.{own[name]}"
            if limit.caught is not None and limit.upper is not None:
                receiver, upper = f"s.{own[limit.receiver]}", code.write(limit.upper)
                gain = f"{receiver} = {receiver} + {code.write(limit.caught)}*({state} - {upper});"
                lines.append(f"if {state} > {upper}, {gain} end")
            for expression, comparison in ((limit.lower, "<"), (limit.upper, ">")):
                if expression is not None:
                    bound = code.write(expression)
                    clips.append(f"if {state} {comparison} {bound}, {state} = {bound}; end")
        return lines + clips

    def _map(self, given: SignalMap) -> str:
        local, before = self._read_operators(given)
        statements = self.code.assign([("x(k)", given.equation)], local)
        if re.search(r"\bt\b", "\n".join(statements)):
            statements = ["t = (k - 1)*c.dt;", *statements]
        return MAP.format(
            summary=f"{given.effect}: {given.summary}",
            name=f"apply_{given.effect.replace('-', '_')}",
            operators=_indent([*before, ""]) if before else "",
            statements=_indent(statements, 4),
        )

    def _read_operators(self, given: SignalMap) -> tuple[dict[str, str], list[str]]:
        """Return the texts of the results of operators, and the statements that compute them."""
        local, lines = {"x": "x(k)", "t": "t"}, []
        for index, (name, arguments) in enumerate(given.operators):
            result, texts = f"z{index}", ["x", *map(self.code.write, arguments)]
            if name in CHANNEL_OPERATORS:
                assert isinstance(arguments[0], Symbol)
                column = f"r.{self.code.identifiers[arguments[0].name]}"
                first = f" - {column}(1)" if CHANNEL_OPERATORS[name] else ""
                local[result] = f"({column}(k){first})"
            elif name in ("first", "rests"):
                lines.append(f"{result} = {'x(1)' if name == 'first' else 'rests(x, c)'};")
            else:
                function = "interpolate_at" if name == "interpolate" else name.replace("-", "_")
                texts += [] if name in ("play", "slider") else ["c"]
                lines.append(f"{result} = {function}({', '.join(texts)});")
                local[result] = f"{result}(k)"
        return local, lines

    def _forces(self) -> str:
        given, code = self.given, self.code
        if not given.forces:
            return ""
        local = {"x": "x", "v": "v"}
        slopes = [
            (f"slope.{code.identifiers[each.state]}", each.slope)
            for each in given.forces
            if each.slope is not None
        ]
        targets = [(f"force_{place}", each.force) for place, each in enumerate(given.forces)]
        own = [code.identifiers[each.state] for each in given.forces if each.slope is not None]
        zeros = [f"slope.{code.identifiers[name]} = 0;" for name, _ in given.system.derivatives]
        return FORCES.format(
            forces=_indent(code.assign(targets, local)),
            total=" + ".join(name for name, _ in targets),
            input=code.identifiers[given.system.input],
            slopes=FORCE_SLOPES.format(slopes=_indent([*zeros, *code.assign(slopes, local)])) if own else "",
            steps=FORCE_STEPS.format(advances=_indent(make_step(code, "s.", own, "time"), 4)) if own else "",
        )

    def _before(self) -> str:
        column = f"r.{self.code.identifiers[self.given.system.input]}"
        lines = [
            f"{column} = apply_{each.effect.replace('-', '_')}(p, r, {column}, c);"
            for each in self.given.input_maps
        ]
        if self.given.core:
            lines += ["y = simulate_core(p, initial, r);", *self._add_forces()]
        return _indent([*lines, ""]) if lines else ""

    def _add_forces(self) -> list[str]:
        return ["if r.samples > 1, y = add_forces(p, initial, r, y, c); end"] if self.given.forces else []

    def _after(self) -> str:
        lines = [] if self.given.core else self._add_forces()
        lines += [
            f"y = apply_{each.effect.replace('-', '_')}(p, r, y, c);" for each in self.given.output_maps
        ]
        return _indent([*lines, ""]) if lines else ""
