"""Program of an extended simulation in C99."""

import re
import textwrap
from collections.abc import Iterable, Sequence

from islands.export.equations.c_language import (
    EQUATION_FUNCTIONS,
    HEAD,
    SAMPLED_FUNCTIONS,
    SIGNAL,
    C,
)
from islands.export.equations.extended_system import ExtendedEquations
from islands.export.equations.program import EquationProgram, map_function
from islands.expressions.printing import render
from islands.expressions.tree import Symbol
from islands.records.segments import MAX_RANGE_AT_REST


def c_equations(equations: ExtendedEquations) -> str:
    """Return an extended simulation of equations as C99 source in ASCII."""
    return _CProgram(equations).write()


class _CProgram(EquationProgram):
    language = C

    def __init__(self, equations: ExtendedEquations) -> None:
        super().__init__(equations)
        self.states = self.states or [("none", "0.0", "there are no states")]

    def describe_data(self) -> dict[str, str]:
        code = self.code
        signals = [(code.identifiers[render(each)], "", "") for each in code.signals]
        variables = [(code.identifiers[name], "", "") for name, _ in self.given.system.variables]
        moments = self.given.moment_maps
        parameters = code.list_parameters() or [("none", "0.0", "there are no parameters")]
        return {
            "parameters": _list_members(parameters),
            "states": _list_members(self.states),
            "signal_members": _list_members(signals or [("none", "", "")]),
            "record": "\n".join(f"    const double *{name};" for name in self.columns)
            + (f"\n    const double *{self.moments}; /* set by simulate() */" if moments else ""),
            "parameter_values": _list_values(parameters),
            "state_values": _list_values(self.states),
            "variables": "/* Variables of the equations. */\n"
            f"struct variables {{\n{_list_members(variables)}\n}};\n\n"
            if variables
            else "",
        }

    def complete(self, text: str) -> str:
        given, code = self.given, self.code
        values = (
            ("enum { STEPS = %s };", given.times * given.steps, "integration steps per sample"),
            ("enum { PART_STEPS = %s };", given.steps, "those of each part of a sample"),
            ("enum { FITTED = %s };", given.fitted, "samples of the estimation part"),
            ("static const double DT = %r;", given.dt, "sampling time in s"),
            (
                "static const double STEP = %r;",
                given.dt / (given.times * given.steps),
                "integration step in s",
            ),
            ("static const double MAX_RANGE_AT_REST = %r;", MAX_RANGE_AT_REST, "rounding"),
        )
        used = [
            f"{line % value} /* {why} */\n"
            for line, value, why in values
            if re.search(rf"\b{line.split(' = ')[0].split()[-1]}\b", text)
        ]
        head = HEAD.format(
            heading="\n".join(f" * {line}".rstrip() for line in code.describe()),
            functions=SAMPLED_FUNCTIONS if given.core else EQUATION_FUNCTIONS,
            example=", ".join(["samples", *self.columns, *["NULL"] * bool(given.moment_maps)]),
            constants="".join([*used, "\n"]),
            definitions="".join(
                f"{self.language.definitions[each]}\n\n" for each in code.find_functions(text)
            ),
        )
        return head + text

    def begin(self, lines: Sequence[str], *arguments: str) -> list[str]:
        text = "\n".join(lines)
        variables = ["struct variables w;"] if re.search(r"\bw\.", text) else []
        # Compilers warn about unused arguments.
        return variables + [f"(void){name};" for name in arguments if not re.search(rf"\b{name}\b", text)]

    def apply_operator(self, function: str, result: str, arguments: Sequence[str]) -> list[str]:
        texts = ", ".join(["x", result, "samples", *arguments])
        return [f"double *const {result} = rows + {result[1:]}*samples;", f"{function}({texts});"]

    def map_input(self) -> list[str]:
        given, lines = self.given, []
        if given.hold == "band-limited":
            lines.append("if (samples > 0 && samples <= REACH + 1) return -1; /* too short for the filter */")
        maps = [*given.input_maps, *given.output_maps]
        rows = max((len(signal_map.operators) for signal_map in maps), default=0)
        if maps:
            count = max(rows + bool(given.input_maps), 1)
            lines += [
                f"double *const rows = malloc({count}*(samples + 1)*sizeof *rows);",
                "if (rows == NULL) return -1;",
            ]
        if given.input_maps:
            lines += [
                f"double *const x = rows + {rows}*samples;",
                f"for (size_t k = 0; k < samples; ++k) x[k] = record->{self.input}[k];",
                *(
                    f"if (samples > 0) {map_function(signal_map)}(p, record, x, rows);"
                    for signal_map in given.input_maps
                ),
                f"mapped.{self.input} = x;",
            ]
        return lines + self._map_moments(has_rows=bool(maps))

    def _map_moments(self, has_rows: bool) -> list[str]:
        """Write the statements that compute the input at three moments of each step."""
        given = self.given
        if not given.moment_maps:
            return []
        value = self.interpolate(given.system.input)
        rows = max(len(signal_map.operators) for signal_map in given.moment_maps)
        failure = "{ free(rows); return -1; }" if has_rows else "return -1;"
        return [
            "struct record fine = mapped;",
            "fine.samples = 3*samples*STEPS;",
            f"double *const moments = calloc({rows + 1}*(fine.samples + 1), sizeof *moments);",
            f"if (moments == NULL) {failure}",
            "for (size_t j = 0; j < fine.samples; ++j) {",
            "    const size_t step = j/3;",
            "    const double part = 0.5*(double)(j % 3);",
            *(f"    {line}" for line in self.begin([value], "part")),
            f"    moments[j] = {value};",
            "}",
            *(
                f"if (samples > 0) {map_function(signal_map)}(p, &fine, moments, moments + fine.samples);"
                for signal_map in given.moment_maps
            ),
            f"mapped.{self.moments} = moments;",
        ]

    def map_output(self) -> list[str]:
        given = self.given
        lines = [f"if (samples > 0) {map_function(each)}(p, record, y, rows);" for each in given.output_maps]
        if given.moment_maps:
            lines.append("free(moments);")
        return [*lines, "free(rows);"] if given.input_maps or given.output_maps else lines

    def copy_output(self, column: str, count: int | None) -> list[str]:
        first = "" if count is None else f" && k < {count}"
        return [f"for (size_t k = 0; k < r->samples{first}; ++k) y[k] = {column}[k];"]

    def read_signal(self, function: str, source: Symbol, arguments: Sequence[str]) -> str:
        name = self.code.identifiers[source.name]
        return f"{function}({', '.join([f'signal_{name}', 'p', 'r', 'step', *arguments])})"

    def wrap_signals(self, sources: Iterable[Symbol]) -> str:
        found = []
        for source in sources:
            value = self.read(source)
            unused = "".join(f"{line}\n    " for line in self.begin([value], "p"))
            name = self.code.identifiers[source.name]
            found.append(SIGNAL.format(name=name, unused=unused, value=value))
        return "".join(found)

    def list_weights(self, weights: Sequence[Sequence[float]]) -> str:
        rows = [f"{{{', '.join(map(repr, row))}}}," for row in weights]
        lines = [
            line
            for row in rows
            for line in textwrap.wrap(row, 108, initial_indent=" " * 8, subsequent_indent=" " * 9)
        ]
        return "\n".join([*lines, "    "])


def _list_members(members: Sequence[tuple[str, str, str]]) -> str:
    return "\n".join(
        f"    double {name};{f' /* {comment} */' if comment else ''}" for name, _, comment in members
    )


def _list_values(members: Sequence[tuple[str, str, str]]) -> str:
    return "\n".join(
        f"    .{name} = {value},{f' /* {comment} */' if comment else ''}" for name, value, comment in members
    )
