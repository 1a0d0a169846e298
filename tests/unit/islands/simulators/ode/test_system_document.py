"""Documents of systems: they are complete, terms are added to an equation, mistakes have messages."""

from typing import Any

import pytest

from islands.errors import ModelError
from islands.expressions.printing import render
from islands.simulators.ode.system import OdeParameter
from islands.simulators.ode.system_document import describe_system, make_system, render_equations

DOCUMENT: dict[str, Any] = {
    "name": "two-mass",
    "summary": "Two masses with a coupling",
    "input": "F",
    "channels": ["T"],
    "equations": """
        dx1/dt = v1
        dv1/dt = (F - c*v1 - coupling - force)/m1   # first mass
        dx2/dt = v2
        coupling = k*(1 + a*T)*(x1 - x2)            # used above and below
        dv2/dt = (coupling - c*v2)/m2
    """,
    "output": "x2 + 0.1",
    "parameters": {
        "m1": {"value": 2.0, "unit": "kg", "tolerance": 0.05},
        "m2": {"value": 1.0, "unit": "kg", "fixed": True},
        "c": {"value": 0.7, "lower": 0.0, "upper": 5.0},
        "k": 300.0,
        "a": {"value": 0.0, "lower": -1.0, "upper": 1.0},
    },
    "states": {"x1": {"unit": "m", "initial": 0.5, "fixed": True}, "x2": {"lower": -1.0, "upper": 1.0}},
    "force": {"coordinate": "x1", "rate": "v1", "unit": "N", "drive": "coupling"},
    "input_unit": "N",
    "steps": 2,
}


def change(**fields: Any) -> dict[str, Any]:
    return {**DOCUMENT, **fields}


def test_the_document_of_a_system_makes_the_same_system() -> None:
    system = make_system(DOCUMENT)
    assert make_system(describe_system(system)) == system
    assert [each.name for each in system.states] == ["x1", "v1", "x2", "v2"]


def test_a_term_is_added_to_one_equation() -> None:
    system = make_system(DOCUMENT)
    extended = system.with_term("v2", "-k3*x2**3", [OdeParameter("k3", 1e3)])
    by_hand = change(
        equations=str(DOCUMENT["equations"]).replace(
            "(coupling - c*v2)/m2", "(coupling - c*v2)/m2 + -k3*x2**3"
        ),
        parameters={**DOCUMENT["parameters"], "k3": 1e3},
    )
    assert extended == make_system(by_hand)
    assert system == make_system(DOCUMENT)
    assert render(system.with_term("output", "0.5*t").output) == "x2 + 0.1 + 0.5*t"
    assert "coupling = k*(1 + a*T)*(x1 - x2) + F" in render_equations(system.with_term("coupling", "F"))


@pytest.mark.parametrize(
    ("target", "term", "parameters", "message"),
    [
        ("v3", "1", [], "there is no equation of 'v3': known are "),
        ("v1", "q*x1", [], "unknown name 'q'"),
        ("v1", "F", [OdeParameter("k", 1.0)], "'k' has a meaning already"),
        ("coupling", "coupling", [], "depend on each other: coupling -> coupling"),
        ("v1", "rate(x1)", [], "x1 is not measured: take the input or a channel"),
    ],
)
def test_a_wrong_term_is_refused(
    target: str, term: str, parameters: list[OdeParameter], message: str
) -> None:
    with pytest.raises(ModelError, match=message):
        make_system(DOCUMENT).with_term(target, term, parameters)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"equations": "dx1/dt = v7"}, "line 1 of the equations, 'dx1/dt = v7': unknown name 'v7'"),
        ({"equations": "dx1/dt = coupling2\ncoupling = x1"}, "Did you mean 'coupling'"),
        ({"equations": "dx1/dt = a1\na1 = a2\na2 = 2*a1"}, "depend on each other: a1 -> a2 -> a1"),
        ({"equations": "dx1/dt = x1\ndx1/dt = F"}, "'x1' is defined 2 times"),
        ({"equations": "dx1/dt = F\nm1 = x1"}, "line 2 .*'m1' is defined 2 times"),
        ({"equations": "dx1/dt = F\noutput = x1"}, "'output' already has a meaning"),
        ({"equations": "dx1/dt = delay(F, x1)", "force": None}, "has to be a parameter or a number"),
        ({"force": None}, r"force needs a table \[force\]"),
        ({"force": {"coordinate": "x3", "rate": "v1"}}, "unknown name 'x3'"),
        ({"force": {"coordinate": "x1", "rate": "v1", "drive": "k*x1"}}, "give the unit of a force"),
        ({"force": {"coordinate": "x1"}}, "give coordinate and rate, or the input as the coordinate"),
        ({"force": {"coordinate": "F", "rate": "v1"}}, "give coordinate and rate, or the input"),
        ({"gain": "x1"}, "gain: there is no parameter 'x1'"),
        ({"states": {"x1": {"spills_into": "x1"}}}, "spills_into has to be another state"),
        ({"effects": {"relaxation": {"term": "-value*x1"}}}, "give equation and term, or neither"),
        ({"effects": {"state-clip:x9": {}}}, "give equation and term, or the name of a state"),
        ({"effects": {"relaxation": {"equation": "x1", "term": "-x1"}}}, "the term has to contain value"),
        ({"effects": {"relaxation": {"equation": "x1", "term": "value*x9"}}}, "unknown name 'x9'"),
        ({"effects": {"relaxation": {"equation": "x9", "term": "value"}}}, "there is no equation of 'x9'"),
        ({"output": "x9"}, "output, 'x9': unknown name 'x9': known are "),
        ({"states": {"x5": {}}}, r"there is no equation dx5/dt = \.\.\."),
        ({"states": {"x1": {"fixed": True}}}, "a fixed state needs a value"),
        ({"states": {"x1": {"initial": 2.0, "upper": 1.0}}}, "lower, initial and upper"),
        ({"parameters": {**DOCUMENT["parameters"], "z": 1.0}}, "no equation reads the parameter z"),
        ({"parameters": {**DOCUMENT["parameters"], "a": 0.0}}, "the value 0 does not tell a typical size"),
        ({"parameters": {**DOCUMENT["parameters"], "a": {"value": 2.0, "upper": 1.0}}}, "not between"),
        ({"parameters": {**DOCUMENT["parameters"], "k": {"value": 2.0, "tolerance": 2.0}}}, "such as 0.02"),
        ({"input": "t"}, "'t' already has a meaning"),
        ({"channels": ["rate"]}, "'rate' already has a meaning"),
        ({"channels": ["output"]}, "'output' already has a meaning"),
        ({"channels": ["room temperature"]}, "is not a name"),
        ({"channels": ["F", "T"]}, "'F' is defined 2 times"),
        ({"channels": ["T"], "input": "G"}, "unknown name 'F'"),
        ({"equations": "".join(f"dx{i}/dt = F\n" for i in range(41))}, "41 states, and 40 is the most"),
        ({"equations": "".join(f"a{i} = a{i + 1}\n" for i in range(999))}, "999 variables, and 200"),
    ],
)
def test_a_mistake_in_a_document_is_reported(fields: dict[str, Any], message: str) -> None:
    document = change(
        **({"states": {}, "parameters": {}, "force": None, "output": "x1"} if "equations" in fields else {})
    )
    if "equations" in fields and "m1 =" in fields["equations"]:
        document["parameters"] = {"m1": 1.0}
    with pytest.raises(ModelError, match=message):
        make_system({**document, **fields})


def test_an_input_that_no_equation_reads_is_refused() -> None:
    with pytest.raises(ModelError, match="no equation reads the input F"):
        make_system({"name": "n", "input": "F", "equations": "dx/dt = -x", "output": "x"})
