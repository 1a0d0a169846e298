import numpy as np
import pytest
import scipy

from islands.records.inspection.column_roles import choose_columns, find_role, is_counter, is_numbering
from lab.inspection.column_roles import calibration_error
from support.known_records import delay, lag, steps, white
from support.role_records import KINDS, LOGGERS, make_logs, make_record, make_records


def make(name="a", other="b", noise=0.05, seed=0):
    u = steps(3000, seed, 10)
    y = delay(lag(u, 5.0), 2)
    return {name: u, other: y + noise * y.std() * white(3000, [seed, 5])}


def assert_right(kind, test=False, seeds=range(2)):
    for seed in seeds:
        record = make_record(kind, seed, test)
        choice = choose_columns(record.columns)
        assert record.is_right(choice), (choice, record.answers)


@pytest.mark.parametrize(
    ("name", "role"),
    [
        *[("u_V", "input"), ("u1", "input"), ("pump/V", "input"), ("run.u", "input")],
        *[("y [um]", "output"), ("level_cm", "output"), ("Temperature (degC)", "output")],
        *[
            ("H [A/m]", "input"),
            ("B [T]", "output"),
            ("y_T", "output"),
            ("u_T", "input"),
            ("h [m]", "output"),
        ],
        *[("channel_3", ""), ("k", "")],
    ],
)
def test_names_suggest_roles(name, role):
    assert find_role(name)[0] == role


def test_every_named_input_that_predicts_is_chosen():
    u, v = white(3000, 0), white(3000, 1)
    columns = {"u1": u, "u2": v, "u3": white(3000, 2), "y": lag(u, 3.0) + lag(v, 3.0)}
    assert choose_columns(columns).inputs == ("u1", "u2")


@pytest.mark.ci
@pytest.mark.parametrize("kind", ["two inputs", "static map"])
def test_every_input_that_improves_the_prediction_is_chosen(kind):
    """The second input of the static map 2 u^2 + 0.5 u x is visible in products with the first one only."""
    assert_right(kind, test=True, seeds=[0])


@pytest.mark.parametrize("kind", ["thermostat", "control loop"])
def test_the_output_of_a_controller_is_the_input_and_not_its_set_point(kind):
    assert_right(kind, test=True, seeds=[1])


@pytest.mark.ci
@pytest.mark.parametrize("kind", ["slow heating", "motor", "battery"])
def test_another_response_is_not_an_input(kind):
    assert_right(kind, test=True, seeds=[0])


def test_names_in_doubt_do_not_replace_a_response():
    unrelated = white(1000, 0), white(1000, 1)
    assert choose_columns(dict(zip(("pump", "level"), unrelated, strict=True))).output == ""
    sure = choose_columns(dict(zip(("u", "y"), unrelated, strict=True)))
    assert sure.output == "y"
    assert sure.confidence <= 0.5
    assert "no response of y to u is visible" in sure.reason


def test_a_constant_column_does_not_matter():
    choice = choose_columns(make() | {"u": np.full(3000, 0.1)}, (), "b")
    assert choice.inputs == ("a",)


def test_counters_and_parts_of_a_file_are_no_signals():
    k = np.arange(3000.0)
    counters = {"k": k, "test": np.repeat(np.arange(3.0), 1000), "second": k % 60, "run": k // 100 % 10}
    choice = choose_columns(counters | make())
    assert (choice.inputs, choice.output) == (("a",), "b")
    assert all(is_counter(name, values) or is_numbering(name, values) for name, values in counters.items())
    # A binary command and a staircase with other steps are signals.
    for levels in ([0.0, 1.0, 0.0, 1.0], [0.0, 2.0, 4.0, 0.0], [1.0, 1.0, 2.0, 2.0]):
        command = np.repeat(levels, 50)
        assert not is_counter("a", command)
        assert not is_numbering("a", command)


@pytest.mark.parametrize("levels", [[1, 2], [1, 1, 1, 2], [2, 1], [1, 2, 3, 4], [0, 1, 0]])
def test_a_step_test_is_offered(levels):
    u = np.repeat(levels, 600 // len(levels)).astype(float)
    y = (
        20.0
        + scipy.signal.lfilter([0.0, 0.4], [1.0, -0.95], u - u[0])
        + np.random.default_rng(0).normal(0, 0.02, u.size)
    )
    choice = choose_columns({"a": u, "b": y})
    assert (choice.inputs, choice.output) == (("a",), "b")


@pytest.mark.parametrize(
    ("scale", "offset", "kind"), [(1, 0, "a copy"), (1e-3, 0, "a scaled copy"), (1.8, 32, "a scaled copy")]
)
@pytest.mark.parametrize("column", ["a", "b"])
def test_a_copy_is_named_and_is_neither_input_nor_output(column, scale, offset, kind):
    columns = make()
    choice = choose_columns(columns | {"c": scale * columns[column] + offset})
    assert (choice.inputs, choice.output) == (("a",), "b")
    assert choice.reason.endswith(f"; c is {kind} of {column}.")


def test_the_multiple_of_the_only_other_column_is_a_response():
    u = steps(2000, 0, 20)
    assert choose_columns({"u": u, "y": 2.0 * u}).output == "y"


@pytest.mark.parametrize("name", ["setpoint", "sp", "target", "reference", "Sollwert", "ref_V"])
def test_the_name_of_a_set_point_makes_no_input(name):
    assert find_role(name) == ("", 0.0)


def test_the_choice_of_the_user_stays():
    columns = make()
    assert choose_columns(columns, ("b",), "a").inputs == ("b",)
    assert choose_columns(columns, ("b",)).output == "a"
    assert choose_columns(columns, (), "a").inputs == ("b",)
    assert choose_columns(columns, (), "a").confidence < 0.2


def test_a_short_record_needs_names():
    short = {name: values[:50] for name, values in make().items()}
    assert "Fewer than 80 samples" in choose_columns(short).reason
    named = {"u": short["a"], "y": short["b"]}
    assert choose_columns(named).output == "y"


@pytest.mark.ci
def test_the_stated_probability_is_the_frequency_of_right_choices():
    """Columns of other systems than those that the weights are from, in random order without names."""
    records = make_records(2, True, 5000) + make_logs(2, 5000)
    assert len(records) == 2 * (len(KINDS) + len(LOGGERS)) >= 40
    choices = [choose_columns(record.columns) for record in records]
    right = [record.is_right(choice) for record, choice in zip(records, choices, strict=True)]
    assert np.mean(right) >= 0.9
    stated = [
        (choice.confidence, each) for choice, each in zip(choices, right, strict=True) if choice.confidence
    ]
    assert calibration_error(*zip(*stated, strict=True)) <= 0.1


def test_the_charge_that_flows_is_no_output():
    """A battery cycler writes the integral of the current, which the voltage predicts as well."""
    rng = np.random.default_rng(3)
    current = np.repeat(0.5 * rng.integers(-5, 6, 60), 40)
    charge = np.cumsum(current) / 3600
    slow = scipy.signal.lfilter([0.0, 0.03 * 0.022], [1.0, -0.97], current)
    voltage = 3.8 + 0.24 * charge + 0.035 * current + slow + 0.0005 * rng.standard_normal(current.size)
    choice = choose_columns({"a": charge, "b": voltage, "c": current})
    assert choice.inputs == ("c",)
    assert choice.output == "b"
    counted = [np.cumsum(np.maximum(each, 0.0)) for each in (current, -current, current * voltage)]
    columns = dict(zip("ade", counted, strict=True)) | {"b": voltage, "c": current}
    choice = choose_columns(columns)
    assert (choice.inputs, choice.output) == (("c",), "b")
    assert "respond" not in choice.reason


def test_a_column_that_changes_together_with_an_input_is_named():
    rng = np.random.default_rng(5)
    current = np.repeat(0.5 * rng.integers(-5, 6, 60), 40) + 1e-5 * rng.standard_normal(2400)
    slow = scipy.signal.lfilter([0.0, 0.03 * 0.022], [1.0, -0.97], current)
    voltage = 3.8 + 0.035 * current + slow + 0.0002 * rng.standard_normal(current.size)
    heat = scipy.signal.lfilter([0.0, 0.003], [1.0, -0.99], current**2) + 0.02 * rng.standard_normal(2400)
    choice = choose_columns({"current_A": current, "voltage_V": voltage, "temperature": heat})
    assert choice.output == "temperature"
    assert (
        "voltage_V changes together with current_A" in choice.reason or "voltage_V responds" in choice.reason
    )


def test_computed_columns_of_a_battery_cycler_are_neither_input_nor_output():
    current = steps(3000, 3)
    voltage = 3.7 + 0.05 * current + 0.1 * lag(current, 20.0) + 1e-3 * white(3000, 4)
    columns = {
        "Step": 1.0 + (current > 0.0),
        "Voltage(V)": voltage,
        "Current(A)": current + 1e-3 * white(3000, 5),
        "Power(W)": voltage * current,
    }
    choice = choose_columns(columns)
    assert (choice.inputs, choice.output) == (("Current(A)",), "Voltage(V)")
    assert "Step only numbers groups of values of Current(A)" in choice.reason
    assert "Power(W) is the product of Voltage(V) and Current(A)" in choice.reason


def test_a_slow_disturbance_is_an_input_if_no_column_predicts_it():
    """The temperature of a room acts on a heated block; its shape is that of a response."""
    rng = np.random.default_rng(1)
    heater = np.repeat(rng.choice([0.0, 0.3, 0.6, 1.0], 60), rng.integers(20, 90, 60))
    samples = heater.size
    room = 21.0 + 3.0 * np.sin(np.arange(samples) / 300.0) + lag(0.5 * white(samples, 2), 60.0)
    block = np.full(samples, 21.0)
    for k in range(1, samples):
        block[k] = block[k - 1] + 0.02 * (room[k - 1] - block[k - 1] + 100.0 * heater[k - 1])
    columns = {
        "a": block + 0.08 * white(samples, 3),
        "b": room + 0.04 * white(samples, 4),
        "c": heater,
    }
    choice = choose_columns(columns)
    assert (choice.inputs, choice.output) == (("b", "c"), "a")
