"""Simulations in discrete time in MATLAB."""

from islands.export.equations.equation_code import EquationCode
from islands.export.equations.extended_equations import SampledCore
from islands.export.equations.sampled_core import MEASURED, RECORDED
from islands.export.languages.matlab import matlab_definition, matlab_name

_FUNCTION = """\
function y = simulate_core(p, s, r)
% Simulated output.
  {lines}
end

"""


def write_matlab_core(core: SampledCore, code: EquationCode) -> str:
    """Return the function ``simulate_core``, and the functions that it calls."""
    names = code.identifiers
    u = f"r.{names[code.equations.system.input]}"
    if core.model is not None:
        return _write_model(core, u, f"r.{names[MEASURED]}")
    if core.output is None:
        return _write([f"y = r.{names[RECORDED]};"])
    local = {"x": "x", "y": "y(k)", **{name: name for name, _ in core.after}}
    each = [
        f"x = {u}(max(k - {core.delay}, 1));" if core.delay else f"x = {u}(k);",
        *code.assign([("y(k)", core.output), *core.after], local),
    ]
    before = [f"{name} = {code.write(right, {'x': f'{u}(1)'})};" for name, right in core.before]
    return _write(["y = zeros(r.samples, 1);", *before, *_loop("1", each)])


def _write_model(core: SampledCore, u: str, measured: str) -> str:
    model = core.model
    assert model is not None
    lag = model.maximum_lag
    block = model.block()
    added = block.terms(0, lambda name, lag: f"{name}(k-{lag})", matlab_name)
    each = ["total = 0;", *(f"total = total + {each};" for each in added), "y(k) = total;"]
    lines = [
        f"u = {u};",
        "y = zeros(r.samples, 1);",
        f"given = min({lag}, r.samples);",
        f"y(1:given) = {measured}(1:given);",
        *_loop(str(lag + 1), each),
    ]
    return _write(lines) + "".join(f"{matlab_definition(each)}\n" for each in block.primitives)


def _loop(first: str, lines: list[str]) -> list[str]:
    return [f"for k = {first}:r.samples", *(f"  {line}" for line in lines), "end"]


def _write(lines: list[str]) -> str:
    return _FUNCTION.format(lines="\n  ".join(lines))
