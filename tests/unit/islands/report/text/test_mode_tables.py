"""Tables of modes and gains: a resonance is one row, and values end at the digits that are known."""

from islands.report.text.mode_tables import GAINS, MODES, align, list_gains, list_modes


def quantity(name, value, error=None, unit="", of=(None, None)):
    fields = {"name": name, "value": value, "standard_error": error, "unit": unit}
    return {**fields, "input": of[0], "output": of[1]}


QUANTITIES = [
    quantity("time constant", 12.3456, None, "s"),
    quantity("frequency", 819.4312, 0.123, "Hz"),
    quantity("damping ratio", 0.011926, 0.000096),
    quantity("static gain", -2.62651, 0.0072, of=(1, 2)),
    quantity("static gain", None, None, of=(2, 1)),
]


def test_a_resonance_has_its_damping_ratio_in_its_row():
    assert list_modes(QUANTITIES) == [
        ("time constant", "12.346 s", ""),
        ("resonance", "819.43 +- 0.12 Hz", "0.011926 +- 0.000096"),
    ]


def test_gains_name_the_input_and_the_output():
    rows = list_gains(QUANTITIES, ("u_V", "w_A"), ("x_um", "y_um"))
    assert rows == [
        ("static gain of u_V on y_um", "-2.6265 +- 0.0072"),
        ("static gain of w_A on x_um", "infinite"),
    ]
    assert len({len(line) for line in align(GAINS, rows)}) == 1


def test_columns_of_a_table_have_one_width():
    head, first, second = align(MODES, list_modes(QUANTITIES))
    assert head.index("value") + len("value") == second.index(" Hz") + len(" Hz")
    assert first.startswith("time constant")
