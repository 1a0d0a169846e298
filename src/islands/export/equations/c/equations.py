"""Program of an extended simulation in C99."""

import re

from islands.data.segments import MAX_RANGE_AT_REST
from islands.export.equations.c.core import write_c_core
from islands.export.equations.c.operators import C_OPERATORS
from islands.export.equations.c.signals import find_unused, write_signals
from islands.export.equations.c.templates import (
    ADVANCE,
    BODY,
    DEFINITIONS,
    DERIVATIVES,
    EQUATION_FUNCTIONS,
    FORCE_SLOPES,
    FORCE_STEPS,
    FORCES,
    HEAD,
    MAP,
    MOVE,
    SAMPLE,
    SAMPLED_FUNCTIONS,
    STEP,
)
from islands.export.equations.collection import CHANNEL_OPERATORS
from islands.export.equations.extended_system import ExtendedEquations, SignalMap
from islands.export.equations.statements import EquationCode, make_step
from islands.expressions.printing import render
from islands.expressions.tree import Symbol
from islands.simulators.ode.output_system import SIMULATED


def c_equations(equations: ExtendedEquations) -> str:
    """Return an extended simulation of equations as C99 source in ASCII."""
    return _CWriter(equations).write()


def make_c_code(equations: ExtendedEquations) -> EquationCode:
    """Return the writer of expressions and statements in C."""
    return EquationCode(
        equations, "->", {"abs": "fabs"}, "const double ", "", lambda base, power: f"pow({base}, {power})"
    )


def _indent(lines: list[str], columns: int = 4) -> str:
    return f"\n{' ' * columns}".join(lines)


class _CWriter:
    def __init__(self, equations: ExtendedEquations) -> None:
        self.given, self.code = equations, make_c_code(equations)

    def write(self) -> str:
        given, code = self.given, self.code
        maps = [*given.input_maps, *given.output_maps]
        names = {name for each in maps for name, _ in each.operators}
        columns = [code.identifiers[name] for name in given.columns]
        states = code.list_states() or [("none", "0.0", "there are no states")]
        text = BODY.format(
            parameters=_list_members(code.list_parameters()),
            states=_list_members(states),
            signals=_list_members([(code.identifiers[render(each)], "", "") for each in code.signals])
            or "    double none;",
            record="\n".join(f"    const double *{name};" for name in columns),
            parameter_values=_list_values(code.list_parameters()),
            state_values=_list_values(states),
            reading=write_signals(given, code),
            variables=self._variables(),
            derivatives="" if given.core else DERIVATIVES.format(derivatives=_indent(self._derivatives())),
            output=_indent(self._output()),
            integration=self._integration([name for name, _, _ in states]),
            operators="".join(f"{C_OPERATORS[name]}\n" for name in C_OPERATORS if name in names),
            maps="".join(self._map(each) for each in maps),
            forces=self._forces(),
            core=write_c_core(given.core, code) if given.core else "",
            loop=SAMPLE.format(simulated=code.identifiers[SIMULATED]) if given.core else STEP,
            before=self._before(),
            after=self._after(),
        )
        head = HEAD.format(
            heading="\n".join(f" * {line}".rstrip() for line in code.describe()),
            functions=SAMPLED_FUNCTIONS if given.core else EQUATION_FUNCTIONS,
            example=", ".join(["samples", *columns]),
            constants=self._constants(text),
            definitions="".join(f"{DEFINITIONS[each]}\n\n" for each in code.find_functions(text)),
        )
        return head + text

    def _constants(self, text: str) -> str:
        given = self.given
        values = (
            ("enum { STEPS = %s };", given.times * given.steps, "integration steps per sample", "STEPS"),
            ("enum { PART_STEPS = %s };", given.steps, "those of each part of a sample", "PART_STEPS"),
            ("enum { FITTED = %s };", given.fitted, "samples of the estimation part", "FITTED"),
            ("static const double DT = %r;", given.dt, "sampling time in s", "DT"),
            (
                "static const double STEP = %r;",
                given.dt / (given.times * given.steps),
                "integration step in s",
                "STEP",
            ),
            (
                "static const double MAX_RANGE_AT_REST = %r;",
                MAX_RANGE_AT_REST,
                "rounding",
                "MAX_RANGE_AT_REST",
            ),
        )
        used = [(line % value, why) for line, value, why, name in values if re.search(rf"\b{name}\b", text)]
        return "".join(f"{line} /* {why} */\n" for line, why in used) + "\n"

    def _variables(self) -> str:
        names = [self.code.identifiers[name] for name, _ in self.given.system.variables]
        if not names:
            return ""
        members = "\n".join(f"    double {name};" for name in names)
        return f"/* Variables of the equations. */\nstruct variables {{\n{members}\n}};\n\n"

    def _derivatives(self) -> list[str]:
        code, right_sides = self.code, self.given.system.derivatives
        lines = code.assign_variables([right for _, right in right_sides])
        targets = [(f"slope.{code.identifiers[name]}", right) for name, right in right_sides]
        found = code.assign(targets)
        return _declare(lines) + find_unused(lines + found, "p", "s", "in") + lines + found

    def _output(self) -> list[str]:
        code, output = self.code, self.given.system.output
        lines = code.assign_variables([output])
        found = code.assign([("const double y", output)])
        return [*_declare(lines), *find_unused([*lines, *found], "p", "s", "in"), *lines, *found, "return y;"]

    def _integration(self, states: list[str]) -> str:
        """Write the functions that advance the states; forces on the output may have states too."""
        given, code = self.given, self.code
        moves = _indent([f"next.{name} += time*slope->{name};" for name in states])
        move = MOVE.format(moves=moves) if not given.core or any(each.state for each in given.forces) else ""
        if given.core:
            return move
        own = [code.identifiers[name] for name, _ in given.system.derivatives]
        steps = make_step(code, "s->", own, "STEP") + self._limits() or ["(void)fourth;"]
        return move + ADVANCE.format(advances=_indent(steps))

    def _limits(self) -> list[str]:
        code, own, lines, clips = self.code, self.code.identifiers, [], []
        for name, limit in self.given.limits.items():
            state = f"s->{own[name]}"
            if limit.caught is not None and limit.upper is not None:
                upper = code.write(limit.upper)
                gain = f"s->{own[limit.receiver]} += {code.write(limit.caught)}*({state} - {upper});"
                lines.append(f"if ({state} > {upper}) {gain}")
            for expression, comparison in ((limit.lower, "<"), (limit.upper, ">")):
                if expression is not None:
                    bound = code.write(expression)
                    clips.append(f"if ({state} {comparison} {bound}) {state} = {bound};")
        return lines + clips

    def _map(self, given: SignalMap) -> str:
        local, before = self._read_operators(given)
        statements = self.code.assign([("x[k]", given.equation)], local)
        text = "\n".join([*before, *statements])
        if re.search(r"\bt\b", text):
            statements = ["const double t = (double)k*DT;", *statements]
        before = find_unused([text], "p", "rows") + before
        return MAP.format(
            summary=f"{given.effect}: {given.summary}".replace("*/", "* /"),
            name=f"apply_{_identify(given.effect)}",
            operators=_indent([*before, ""]) if before else "",
            statements=_indent(statements, 8),
        )

    def _read_operators(self, given: SignalMap) -> tuple[dict[str, str], list[str]]:
        """Return the texts of the results of operators, and the statements that compute them."""
        local, lines = {"x": "x[k]", "t": "t"}, []
        for index, (name, arguments) in enumerate(given.operators):
            result = f"z{index}"
            if name in CHANNEL_OPERATORS:
                assert isinstance(arguments[0], Symbol)
                column = f"r->{self.code.identifiers[arguments[0].name]}"
                first = f" - {column}[0]" if CHANNEL_OPERATORS[name] else ""
                local[result] = f"({column}[k]{first})"
            elif name in ("first", "rests"):
                lines.append(f"const double {result} = {'x[0]' if name == 'first' else 'rests(x, samples)'};")
            else:
                function = "interpolate_at" if name == "interpolate" else name.replace("-", "_")
                texts = ", ".join([f"x, {result}, samples", *map(self.code.write, arguments)])
                lines += [f"double *const {result} = rows + {index}*samples;", f"{function}({texts});"]
                local[result] = f"{result}[k]"
        return local, lines

    def _forces(self) -> str:
        given, code = self.given, self.code
        if not given.forces:
            return ""
        local = {"x": "x", "v": "v"}
        with_state = [each for each in given.forces if each.slope is not None]
        forces = code.assign(
            [(f"const double force_{place}", each.force) for place, each in enumerate(given.forces)], local
        )
        total = " + ".join(f"force_{place}" for place in range(len(given.forces)))
        slopes = [
            (f"slope.{code.identifiers[each.state]}", each.slope)
            for each in with_state
            if each.slope is not None
        ]
        changes = code.assign(slopes, local)
        own = [code.identifiers[each.state] for each in with_state]
        unused = find_unused(changes, "p", "s", "x", "v")
        return FORCES.format(
            forces=_indent(find_unused(forces, "p", "s", "x", "v") + forces),
            total=total,
            input=code.identifiers[given.system.input],
            states="struct" if own else "const struct",
            slopes=FORCE_SLOPES.format(slopes=_indent(unused + changes)) if own else "",
            steps=FORCE_STEPS.format(advances=_indent(make_step(code, "s.", own, "time"), 8)) if own else "",
        )

    def _before(self) -> str:
        given, lines = self.given, []
        if given.hold == "band-limited":
            lines.append("if (samples > 0 && samples <= REACH + 1) return -1; /* too short for the filter */")
        maps = [*given.input_maps, *given.output_maps]
        rows = max((len(each.operators) for each in maps), default=0)
        if maps:
            own = rows + bool(given.input_maps)
            count = max(own, 1)
            lines += [
                f"double *const rows = malloc({count}*(samples + 1)*sizeof *rows);",
                "if (rows == NULL) return -1;",
            ]
        if given.input_maps:
            column = self.code.identifiers[given.system.input]
            lines += [
                f"double *const x = rows + {rows}*samples;",
                f"for (size_t k = 0; k < samples; ++k) x[k] = record->{column}[k];",
                *(
                    f"if (samples > 0) apply_{_identify(each.effect)}(p, record, x, rows);"
                    for each in given.input_maps
                ),
                f"mapped.{column} = x;",
            ]
        if given.core:
            lines += ["if (samples > 0) simulate_core(p, initial, r, y);", *self._add_forces()]
        return _indent([*lines, ""]) if lines else ""

    def _add_forces(self) -> list[str]:
        return ["if (samples > 1) add_forces(p, initial, r, y);"] if self.given.forces else []

    def _after(self) -> str:
        given = self.given
        lines = [] if given.core else self._add_forces()
        lines += [
            f"if (samples > 0) apply_{_identify(each.effect)}(p, record, y, rows);"
            for each in given.output_maps
        ]
        if given.input_maps or given.output_maps:
            lines.append("free(rows);")
        return _indent([*lines, ""]) if lines else ""


def _identify(effect: str) -> str:
    return effect.replace("-", "_")


def _list_members(members: list[tuple[str, str, str]]) -> str:
    return "\n".join(
        f"    double {name};{f' /* {comment} */' if comment else ''}" for name, _, comment in members
    )


def _list_values(members: list[tuple[str, str, str]]) -> str:
    return "\n".join(
        f"    .{name} = {value},{f' /* {comment} */' if comment else ''}" for name, value, comment in members
    )


def _declare(lines: list[str]) -> list[str]:
    return ["struct variables w;"] if lines else []
