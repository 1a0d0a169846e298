"""Simulations in discrete time in C."""

from islands.export.equations.c.signals import find_unused
from islands.export.equations.equation_code import EquationCode
from islands.export.equations.extended_equations import SampledCore
from islands.export.equations.sampled_core import MEASURED, RECORDED
from islands.export.languages.c import c_name, define_functions

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
    if core.model is not None:
        return _write_model(core, u, f"r->{names[MEASURED]}")
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


def _write_model(core: SampledCore, u: str, measured: str) -> str:
    model = core.model
    assert model is not None
    lag = model.maximum_lag
    block = model.block()
    added = block.terms(0, lambda name, lag: f"{name}[k - {lag}]", c_name)
    start = f"for (size_t k = 0; k < r->samples && k < {lag}; ++k) y[k] = {measured}[k];"
    each = ["double total = 0.0;", *(f"total += {each};" for each in added), "y[k] = total;"]
    lines = [*([start] if lag else []), *_loop(str(lag), each)]
    if any(channel for item in model.regressors for channel, _ in item.lags):
        lines.insert(0, f"const double *const u = {u};")
    return define_functions(block) + _write(lines)


def _loop(first: str, lines: list[str]) -> list[str]:
    return [f"for (size_t k = {first}; k < r->samples; ++k) {{", *(f"    {line}" for line in lines), "}"]


def _write(lines: list[str]) -> str:
    unused = find_unused(lines, "p", "s")
    return _FUNCTION.format(lines="\n    ".join([*unused, *lines]))
