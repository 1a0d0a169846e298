"""Simulations that the service accepts: extended and linear ones, but no user programs."""

import json

import pytest

from islands.simulators.specification.table import PhysicalSpec
from support.service import problem_of
from support.simulated_records import extension


def extended(core=None, **changes):
    """Return an extended simulation as a diagnosis writes it."""
    document = extension(
        PhysicalSpec(kind="second-order", parameters={"m": 1.0, "c": 2.0, "k": 30.0}),
        name="cubic-stiffness",
        site="coordinate and rate",
        parameters={"k": {"value": 2.0, "unit": "N/m^3"}},
    )
    document = {**document, "kind": "extended", "schema": "islands.extended/1", **changes}
    return document if core is None else {**document, "core": core}


def submit_diagnosis(service, order, simulation):
    return service.client.post("/v1/discrepancies", json={**order, "simulation": simulation})


ODE = {
    "kind": "ode",
    "name": "lag",
    "input": "u",
    "equations": "dx/dt = (u - x)/tau",
    "output": "x",
    "parameters": {"tau": {"value": 0.1, "unit": "s", "tolerance": 0.1}},
}

ACCEPTED = {
    "extended": extended(),
    "extended twice": extended(extended()),
    "extended linear": extended(
        {"kind": "linear", "order": 1, "numerator": [0.1, 0.0], "denominator": [0.9]}
    ),
    "in finer steps": extended(hold="zero-order", times=4),
    "linear": {"kind": "linear", "order": 2},
    "linear, delayed": {"kind": "linear", "order": 0, "delay": 3},
    "linear, given": {
        "kind": "linear",
        "order": 1,
        "numerator": [0.1, 0.0],
        "denominator": [0.9],
        "level": 1.0,
    },
    "second-order": {"kind": "second-order", "parameters": {"m": 2.0}},
    "rigid-axis": {"kind": "rigid-axis"},
    "cascaded-tanks": {"kind": "cascaded-tanks"},
    "equations": ODE,
    "extended equations": extended(ODE),
}


@pytest.mark.parametrize("case", ACCEPTED)
def test_a_built_in_simulation_is_accepted_unchanged(service, order, case):
    answer = submit_diagnosis(service, order, ACCEPTED[case])
    assert answer.status_code == 202, answer.text
    assert answer.json()["spec"]["simulation"] == ACCEPTED[case]


PROGRAM = {"kind": "python", "path": "model.py", "function": "run"}
REFUSED = {
    "a program": (PROGRAM, "/simulation: Input tag 'python'"),
    "a program in an extension": (extended(PROGRAM), "Input tag 'python'"),
    "a program two deep": (extended(extended(PROGRAM)), "Input tag 'python'"),
    "too high an order": ({"kind": "linear", "order": 11}, "/simulation/linear/order: "),
    "a delay below zero": ({"kind": "linear", "order": 1, "delay": -1}, "/simulation/linear/delay: "),
    "too few coefficients": ({"kind": "linear", "order": 2, "numerator": [1.0]}, "order 2 takes 3 and 2"),
    "too many steps": (extended(times=1000), "/simulation/extended/times: "),
    "an unknown name": ({**ODE, "output": "z"}, "output, 'z': unknown name 'z'"),
    "no number": ({**ODE, "parameters": {"tau": "1 s"}}, "/simulation/ode/parameters/tau: "),
    "code in equations": ({**ODE, "equations": "dx/dt = open('f').read()"}, "cannot read"),
    "too many equations": ({**ODE, "equations": "# \n" * 9000}, "/simulation/ode/equations: "),
    "another version": (extended(schema="islands.extended/2"), "/simulation/extended/schema: "),
    "no scales": (extended(scales={}), "/simulation/extended/scales/"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_an_unsupported_simulation_is_rejected(service, order, case):
    simulation, words = REFUSED[case]
    answer = service.client.post(
        "/v1/discrepancies",
        content=json.dumps({**order, "simulation": simulation}).encode(),
        headers={"Content-Type": "application/json"},
    )
    assert words in problem_of(answer, 422, "invalid-request")
    assert service.client.get("/v1/jobs").json()["items"] == []
