"""Names of channels: the stem, the unit, and the mark of an input that acts at once."""

import pytest

from islands.records.channel_names import (
    PLAIN_UNITS,
    SYMBOLS,
    is_unit,
    parse_channel_name,
    parse_unit,
    simplify_unit,
)


@pytest.mark.parametrize(
    ("name", "stem", "unit"),
    [
        ("u_V", "u", "V"),
        ("u_est_V", "u_est", "V"),
        ("u [V]", "u", "V"),
        ("u (m/s2)", "u", "m/s2"),
        ("U_1/mV", "U_1", "mV"),
        ("F/N", "F", "N"),
        ("v_m/s", "v", "m/s"),
        ("omega_rad_s", "omega", "rad/s"),
        ("flow_m3_h", "flow", "m3/h"),
        ("a_m_s2", "a", "m/s2"),
        ("n [1/min]", "n", "1/min"),
        ("t_s", "t", "s"),
        ("Soll °C", "Soll", "°C"),
        ("Charge_Capacity(Ah)", "Charge_Capacity", "Ah"),
        ("E/kWh", "E", "kWh"),
    ],
)
def test_a_unit_is_the_end_of_a_name(name, stem, unit):
    for suffix in ("", "+1"):
        channel = parse_channel_name(name + suffix)
        assert (channel.base, channel.stem, channel.unit, channel.at_once) == (name, stem, unit, bool(suffix))
    assert is_unit(unit)


@pytest.mark.parametrize(
    "name",
    [
        "oven_temperature",
        "u_est",
        "u_1",
        "speed (measured)",
        "h",
        "V",
        "_V",
        "km/h",
        "l/min",
        "K/min",
        "gain, low",
        "valve",
        "°C",
        "Phase A",
    ],
)
def test_text_that_is_not_a_unit_is_a_part_of_the_name(name):
    assert parse_unit(name) == ""
    assert parse_channel_name(name).stem == name


@pytest.mark.parametrize(
    ("name", "unit"),
    [
        *(("solar_W_m2", "W/m2"), ("torque_N_m", "N m"), ("heat_kJ_kg", "kJ/kg"), ("v_m_s", "m/s")),
        *(("a_m_s2", "m/s2"), ("rho_kg_m3", "kg/m3"), ("lambda_W_mK", "W/m/K"), ("lambda_W_m_K", "W/m/K")),
        *(
            ("M_Nm", "Nm"),
            ("load_kNm", "kNm"),
            ("n_1_min", "1/min"),
            ("q_l_min", "l/min"),
            ("v_mm_per_s", "mm/s"),
        ),
        *(("c_J_kgK", "J/kg/K"), ("k_W_m2_K", "W/m2/K"), ("irradiance_W_m²", "W/m²"), ("q_µm_s", "µm/s")),
        *(
            ("sun [W/m²]", "W/m²"),
            ("sun (W·m⁻²)", "W·m⁻²"),
            ("U [W/(m² K)]", "W/(m² K)"),
            ("x_1_per_s", "1/s"),
        ),
        *(("E_V_m", "V/m"), ("grad_K_m", "K/m"), ("rate_K_min", "K/min"), ("current_A_mm2", "A/mm2")),
        *(
            ("tank_h_m", "m"),
            ("cart_m_kg", "kg"),
            ("oven_T_degC", "degC"),
            ("tank_V_l", "l"),
            ("phase_A_V", "V"),
        ),
        *(("pipe_L_mm", "mm"), ("coil_T_K", "K"), ("step_per_V", "V"), ("u_s_V", "V")),
    ],
)
def test_words_of_a_name_make_one_unit(name, unit):
    assert parse_unit(name) == unit
    assert is_unit(unit)


@pytest.mark.parametrize(
    ("name", "stem", "unit"),
    [
        ("Temp, °C (LGR S/N: 10412233, LBL: room)", "Temp (LGR S/N: 10412233, LBL: room)", "°C"),
        ("Speed, m/s", "Speed", "m/s"),
        ("q(NaOH)/mL/min", "q(NaOH)", "mL/min"),
        ("v/(m/s)", "v", "m/s"),
        ("T/s", "T", "s"),
    ],
)
def test_loggers_write_units_behind_commas_and_slashes(name, stem, unit):
    parts = parse_channel_name(name)
    assert (parts.stem, parts.unit) == (stem, unit)


@pytest.mark.ci
def test_every_unit_is_one_of_pint():
    import pint

    registry = pint.UnitRegistry()
    prefixes = "pnumcdkMGT"
    units = [*PLAIN_UNITS, *SYMBOLS, *(prefix + symbol for prefix in prefixes for symbol in SYMBOLS)]
    unknown = []
    for unit in units:
        try:
            registry.parse_units(unit)
        except pint.UndefinedUnitError:
            unknown.append(unit)
    assert unknown == []


@pytest.mark.parametrize(
    ("unit", "simple"),
    [
        ("1/1^3", ""),
        ("1/1", ""),
        ("V/1^2", "V"),
        ("1 s^2/1^2", "s^2"),
        ("1/V^3", "1/V^3"),
        ("N s/m", "N s/m"),
    ],
)
def test_the_unit_of_a_parameter_has_no_factor_one(unit, simple):
    assert simplify_unit(unit) == simple
