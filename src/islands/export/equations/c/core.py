"""Simulations in discrete time in C."""

from functools import partial

from islands.export.equations.c.signals import find_unused
from islands.export.equations.extended_system import SampledCore
from islands.export.equations.sampled_core import MEASURED, RECORDED
from islands.export.equations.statements import EquationCode
from islands.export.languages.c import c_name, define_functions
from islands.models.block import Block

_FUNCTION = """\
/* Write the simulated output. */
static void simulate_core(
    const struct parameters *p, const struct states *s, const struct record *r, double *y)
{{
    {lines}
}}

"""


def write_c_core(core: SampledCore, code: EquationCode) -> str:
    """Return the function ``simulate_core``, and the functions that it calls."""
    names = code.identifiers
    u = f"r->{names[code.equations.system.input]}"
    if core.block is not None:
        return _write_model(core.block, u, f"r->{names[MEASURED]}")
    if core.output is None:
        return _write([f"for (size_t k = 0; k < r->samples; ++k) y[k] = r->{names[RECORDED]}[k];"])
    local = {"x": "x", "y": "y[k]", **{name: name for name, _ in core.after}}
    delayed = f"{u}[k < {core.delay} ? 0 : k - {core.delay}]" if core.delay else f"{u}[k]"
    each = [
        f"const double x = {delayed};",
        *code.assign([("y[k]", core.output), *core.after], local),
    ]
    return _write(
        [
            *(f"double {name} = {code.write(right, {'x': f'{u}[0]'})};" for name, right in core.before),
            *_loop("0", each),
        ]
    )


def _write_model(block: Block, u: str, measured: str) -> str:
    lag, states = block.maximum_lag, block.signals[block.outputs : block.computed]

    def read(name: str, lag: int) -> str:
        if name in states:
            return f"{name}_{lag}"
        return f"{name}[k - {lag}]" if lag else f"{name}[k]"

    start = f"for (size_t k = 0; k < r->samples && k < {lag}; ++k) y[k] = {measured}[k];"
    lines, each = [start] if lag else [], []
    for place, name in enumerate(states, start=block.outputs):
        # The past samples of a state are variables, the newest one with the number 1.
        for back in range(1, block.depths[place] + 1):
            first = block.start_text(place - block.outputs, partial(_read_first, lag - back), c_name)
            lines.append(f"double {name}_{back} = r->samples < {lag} ? 0.0 : {first};")
        added = block.terms(place, read, c_name)
        each += [f"double {name}_0 = 0.0;", *(f"{name}_0 += {term};" for term in added)]
    added = block.terms(0, read, c_name)
    each += ["double total = 0.0;", *(f"total += {term};" for term in added), "y[k] = total;"]
    for place, name in enumerate(states, start=block.outputs):
        each += [f"{name}_{back} = {name}_{back - 1};" for back in range(block.depths[place], 0, -1)]
    lines += _loop(str(lag), each)
    if any(name == "u" for name, _ in block.samples_read):
        lines.insert(0, f"const double *const u = {u};")
    return define_functions(block) + _write(lines)


def _read_first(sample: int, signal: str, _lag: int) -> str:
    return f"{signal}[{sample}]"


def _loop(first: str, lines: list[str]) -> list[str]:
    return [f"for (size_t k = {first}; k < r->samples; ++k) {{", *(f"    {line}" for line in lines), "}"]


def _write(lines: list[str]) -> str:
    unused = find_unused(lines, "p", "s")
    return _FUNCTION.format(lines="\n    ".join([*unused, *lines]))
