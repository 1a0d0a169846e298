"""Simulations over REST: the list, and the check of equations."""

import pytest

from islands_service.intake import job_inputs
from support.service import problem_of

VALID = """
input = "u"
output = "x"
equations = '''
dx/dt = (u - x)/tau
'''

[parameters]
tau = { value = 0.2, unit = "s", tolerance = 0.05 }
"""


def check(service, text):
    return service.client.post("/v1/simulations/equations", json={"text": text})


def test_the_list_says_why_fmus_are_refused(service, monkeypatch):
    """A service for one user runs them, where the machine can confine them."""

    def get_refusal():
        return service.client.get("/v1/simulations").json()["items"][-1]["refusal"]

    assert get_refusal() == ""
    monkeypatch.setattr(job_inputs, "find_gaps", lambda: ("Landlock", "seccomp"))
    assert "a machine that can confine them, which needs Landlock and seccomp" in get_refusal()


def test_a_listed_default_is_the_value_of_an_absent_parameter(service):
    piezo, oscillator = service.client.get("/v1/simulations").json()["items"][:2]
    assert {each["name"]: each["default"] for each in piezo["parameters"]}["dp"] == 1.6
    assert {each["default"] for each in oscillator["parameters"]} == {None}
    assert oscillator["estimated"]


@pytest.mark.parametrize(
    ("old", "new", "detail"),
    [
        ("- x)/tau", "- x)/tua", "line 1 of the equations, 'dx/dt = (u - x)/tua': unknown name 'tua'"),
        ("(u - x)", "(u - x", "'(' was never closed"),
        ("0.2,", ",", "(at line 9, column "),
        ("input", "inputs", "inputs: Extra inputs are not permitted. Did you mean 'input'"),
        ("[parameters]", f"a = {'[' * 900}", "cannot be read as TOML"),
    ],
)
def test_a_wrong_text_is_refused_with_its_place(service, old, new, detail):
    assert detail in problem_of(check(service, VALID.replace(old, new, 1)), 422, "invalid-settings")


def test_a_long_line_is_refused_before_it_is_parsed(service):
    answer = check(service, f"{'a.' * 600}a = 1")
    problem_of(answer, 422, "invalid-request")
    assert "line 1 has 1205 characters" in answer.text
