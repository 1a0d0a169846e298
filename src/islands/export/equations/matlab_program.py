"""Program of an extended simulation in MATLAB, which also runs in Octave."""

from collections.abc import Sequence

from islands.export.equations.extended_system import ExtendedEquations
from islands.export.equations.matlab_language import MATLAB, REAL
from islands.export.equations.program import EquationProgram, map_function
from islands.expressions.tree import Symbol
from islands.records.segments import MAX_RANGE_AT_REST

#: Names that the arguments of the function cannot have.
_TAKEN = frozenset(("y", "p", "r", "s", "c", "in", "initial", "shape", "step", "middle"))


def matlab_equations(equations: ExtendedEquations) -> str:
    """Return an extended simulation of equations as a MATLAB function in ASCII."""
    return _MatlabProgram(equations).write()


class _MatlabProgram(EquationProgram):
    language = MATLAB

    def describe_data(self) -> dict[str, str]:
        given, code = self.given, self.code
        arguments = [f"{name}_" if name in _TAKEN else name for name in self.columns]
        columns = zip(self.columns, arguments, strict=True)
        return {
            "columns": ", ".join(arguments),
            "first": arguments[0],
            "count": str(len(arguments) + 1),
            "last": str(len(arguments) + 2),
            "heading": "\n".join(f"% {line}".rstrip() for line in code.describe()),
            "record": self._indent([f"r.{name} = double({argument}(:));" for name, argument in columns]),
            "dt": repr(given.dt),
            "steps": str(given.times * given.steps),
            "part_steps": str(given.steps),
            "step": repr(given.dt / (given.times * given.steps)),
            "fitted": str(given.fitted),
            "rest": repr(MAX_RANGE_AT_REST),
            "parameters": self._indent(
                [f"p.{name} = {value}; % {unit}" for name, value, unit in code.list_parameters()]
            ),
            "states": self._indent([f"s.{name} = {value}; % {unit}" for name, value, unit in self.states]),
        }

    def complete(self, text: str) -> str:
        real = [name for name, function in REAL.items() if f"{function}(" in text]
        called = [*self.code.find_functions(text), *real]
        return (text + "\n".join(self.language.definitions[each] for each in called)).rstrip() + "\n"

    def apply_operator(self, function: str, result: str, arguments: Sequence[str]) -> list[str]:
        context = [] if function == "play" else ["c"]
        return [f"{result} = {function}({', '.join(['x', *arguments, *context])});"]

    def map_input(self) -> list[str]:
        column = f"r.{self.input}"
        lines = [
            f"{column} = {map_function(signal_map)}(p, r, {column}, c);"
            for signal_map in self.given.input_maps
        ]
        if not self.given.moment_maps:
            return lines
        moments = f"r.{self.moments}"
        lines += [
            f"{moments} = zeros(3*r.samples*c.steps, 1);",
            "for step = 0:r.samples*c.steps - 1",
            "  for part = [0, 0.5, 1]",
            f"    {self.language.moment.format(moments)} = {self.interpolate(self.given.system.input)};",
            "  end",
            "end",
            "fine = r;",
            f"fine.samples = numel({moments});",
        ]
        return lines + [
            f"{moments} = {map_function(signal_map)}(p, fine, {moments}, c);"
            for signal_map in self.given.moment_maps
        ]

    def map_output(self) -> list[str]:
        return [f"y = {map_function(each)}(p, r, y, c);" for each in self.given.output_maps]

    def copy_output(self, column: str, count: int | None) -> list[str]:
        if count is None:
            return [f"y = {column};"]
        return [f"given = min({count}, r.samples);", f"y(1:given) = {column}(1:given);"]

    def read_signal(self, function: str, source: Symbol, arguments: Sequence[str]) -> str:
        record = [] if function in ("find_rate", "find_limited_rate") else ["r"]
        return self._call(function, f"@(step, part) {self.read(source)}", *record, "step", *arguments)

    def list_weights(self, weights: Sequence[Sequence[float]]) -> str:
        lines = []
        for row in weights:
            for place in range(0, len(row), 4):
                part = ", ".join(map(repr, row[place : place + 4]))
                lines.append(f"      {part}{',' if place + 4 < len(row) else ';'} ...\n")
        return "".join([*lines, "    "])
