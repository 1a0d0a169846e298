"""Simulations in discrete time in MATLAB."""

from islands.export.equations.extended_system import SampledCore
from islands.export.equations.sampled_core import MEASURED, RECORDED
from islands.export.equations.statements import EquationCode
from islands.export.languages.matlab import matlab_definition, matlab_name
from islands.models.block import Block

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
    if core.block is not None:
        return _write_model(core.block, u, f"r.{names[MEASURED]}")
    if core.output is None:
        return _write([f"y = r.{names[RECORDED]};"])
    local = {"x": "x", "y": "y(k)", **{name: name for name, _ in core.after}}
    each = [
        f"x = {u}(max(k - {core.delay}, 1));" if core.delay else f"x = {u}(k);",
        *code.assign([("y(k)", core.output), *core.after], local),
    ]
    before = [f"{name} = {code.write(right, {'x': f'{u}(1)'})};" for name, right in core.before]
    return _write(["y = zeros(r.samples, 1);", *before, *_loop("1", each)])


def _write_model(block: Block, u: str, measured: str) -> str:
    lag, states = block.maximum_lag, block.signals[block.outputs : block.computed]
    lines = [
        f"u = {u};",
        "y = zeros(r.samples, 1);",
        f"given = min({lag}, r.samples);",
        f"y(1:given) = {measured}(1:given);",
    ]
    each = []
    for place, name in enumerate(states):
        start = block.start_text(place, _read, matlab_name)
        lines += [f"{name} = zeros(r.samples, 1);", f"for k = 1:given, {name}(k) = {start}; end"]
        added = block.terms(place + block.outputs, _read, matlab_name)
        each += [f"{name}(k) = 0;", *(f"{name}(k) = {name}(k) + {term};" for term in added)]
    added = block.terms(0, _read, matlab_name)
    each += ["total = 0;", *(f"total = total + {term};" for term in added), "y(k) = total;"]
    lines += _loop(str(lag + 1), each)
    return _write(lines) + "".join(f"{matlab_definition(each)}\n" for each in block.primitives)


def _read(name: str, lag: int) -> str:
    return f"{name}(k-{lag})" if lag else f"{name}(k)"


def _loop(first: str, lines: list[str]) -> list[str]:
    return [f"for k = {first}:r.samples", *(f"  {line}" for line in lines), "end"]


def _write(lines: list[str]) -> str:
    return _FUNCTION.format(lines="\n  ".join(lines))
