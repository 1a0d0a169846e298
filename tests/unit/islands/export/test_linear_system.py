"""Linear systems as text, MATLAB and JSON."""

import json
import re

import numpy as np
import pytest

import islands
from islands.export.linear_system import find_notation, write_linear_system
from islands.models.state_space import FORMS, StateSpace
from support.latent_systems import make_model

SYSTEM = StateSpace(
    A=np.array([[0.9, 0.1], [-0.2, 0.7]]),
    B=np.array([[0.5, 0.0], [0.1 + 0.2, 1.0]]),
    C=np.array([[2.0, 1.0]]),
    D=np.zeros((1, 2)),
    dt=0.1,
    input_names=("u_V", "it's"),
    output_names=("y_mm",),
    input_units=("V", ""),
    output_units=("mm",),
    dead_times=(0.3, 0.0),
    operating_inputs=(1.0, 2.0),
    operating_outputs=(0.5,),
)


def test_json_has_every_bit_of_the_system():
    document = json.loads(write_linear_system(SYSTEM, "state-space", "json"))
    for name in "ABCD":
        assert np.array(document[name]).tobytes() == getattr(SYSTEM, name).tobytes()
    assert (document["dt"], document["dead_times"], document["inputs"]) == (0.1, [0.3, 0.0], ["u_V", "it's"])


def test_matlab_has_every_bit_of_the_system_and_its_dead_times_in_samples():
    text = write_linear_system(SYSTEM, "state-space", "matlab")
    for name in "ABCD":
        (matrix,) = re.findall(rf"^{name} = \[(.*)\];$", text, re.M)
        rows = [[float(value) for value in row.split()] for row in matrix.split("; ")]
        assert np.array(rows).tobytes() == getattr(SYSTEM, name).tobytes()
    assert "sys = ss(A, B, C, D, 0.1);" in text
    assert "sys.InputDelay = [3.0 0.0]';" in text
    assert "{'u_V'; 'it''s'}" in text


@pytest.mark.parametrize("notation", ["json", "matlab"])
def test_transfer_functions_have_the_response_of_the_system(notation):
    text = write_linear_system(SYSTEM, "transfer-function", notation)
    if notation == "json":
        document = json.loads(text)
        numerators, denominator = document["numerators"][0], document["denominator"]
    else:
        (cells,) = re.findall(r"num = \{(.*)\};", text)
        numerators = [[float(v) for v in each.split()] for each in re.findall(r"\[(.*?)\]", cells)]
        denominator = [float(v) for v in re.findall(r"den = \[(.*)\];", text)[0].split()]
    z = np.exp(2j * np.pi * 0.1 * 1.3)
    found = [np.polyval(each, z) / np.polyval(denominator, z) for each in numerators]
    late = [z**-3, 1.0]
    assert np.multiply(found, late) == pytest.approx(SYSTEM.respond([1.3])[0, :, 0], rel=1e-12)


@pytest.mark.parametrize("form", FORMS)
def test_the_text_states_modes_dead_times_and_gains(form):
    text = write_linear_system(SYSTEM, form)
    assert "Linear system about u_V = 1, it's = 2, sampling time 0.1 s" in text
    assert "dead time of u_V 0.3 s" in text
    assert "static gain of u_V" in text


def test_the_suffix_of_a_file_states_the_notation(tmp_path):
    names = ("a.m", "a.json", "a.txt")
    assert [find_notation(tmp_path / name) for name in names] == ["matlab", "json", "text"]
    with pytest.raises(islands.SettingsError, match="'zpk'"):
        write_linear_system(SYSTEM, "zpk")


def test_a_latent_model_is_written_at_its_operating_point():
    assert "about u_V = 0.5" in write_linear_system(make_model(operating_inputs=(0.5,)).linearise(), FORMS[0])


def test_the_text_of_a_transfer_function_has_no_coefficients_of_rounding():
    """The numerator of three lags in series has one coefficient; other formats have all bits."""
    A, B = np.array([[0.9, 0.1, 0.0], [0.0, 0.7, 0.2], [0.0, 0.0, 0.37]]), np.array([[0.0], [0.0], [0.3]])
    names = {"input_names": ("u",), "output_names": ("y",), "input_units": ("",), "output_units": ("",)}
    system = StateSpace(A=A, B=B, C=np.array([[1.0, 0.0, 0.0]]), D=np.zeros((1, 1)), dt=0.1, **names)
    assert np.count_nonzero(system.transfer_functions()[0]) > 1
    lines = write_linear_system(system, "transfer-function").splitlines()
    assert [line.strip() for line in lines[-3::2]] == ["0.006", "z^3 - 1.97 z^2 + 1.222 z - 0.2331"]
