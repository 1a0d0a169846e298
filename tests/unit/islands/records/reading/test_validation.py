"""Validation: messages name file, row and column and say what to do."""

import numpy as np
import pytest

from islands.records.reading import read_record
from islands.records.reading.validation import MIN_SAMPLES
from support.bad_records import HEADER, changed, lines, refusal

# Values


@pytest.mark.parametrize("cell", ["nan", "NaN", "", "  ", "NA"])
@pytest.mark.parametrize(("column", "name"), [(0, "t_s"), (1, "u_V")])
def test_a_missing_time_or_input_is_refused(tmp_path, cell, column, name):
    message = refusal(tmp_path, changed(14, column, cell))
    assert message.startswith(f"bad.csv, line 14, column {name} is empty or NaN")
    assert 'gaps="interpolate"' in message
    assert 'gaps="split"' in message
    assert message.endswith("only an output, of several the first, may have empty cells")


@pytest.mark.parametrize("cell", ["nan", "NaN", "", "  ", "NA"])
def test_a_missing_output_is_read(tmp_path, cell):
    (tmp_path / "good.csv").write_text("\n".join(changed(14, 2, cell)))
    assert np.flatnonzero(np.isnan(read_record(tmp_path / "good.csv", ["u_V"], "y_um").y)).tolist() == [12]


def test_an_output_without_any_value_is_refused(tmp_path):
    rows = [line if place == 0 else line.rsplit(",", 1)[0] + "," for place, line in enumerate(lines())]
    assert "column y_um has no value from line 2 to line 61: choose another column" in refusal(tmp_path, rows)


@pytest.mark.parametrize("cell", ["1.5 V", "1_5", "1,5e", "0x1F", "--3"])
def test_a_text_cell_is_refused_and_shown(tmp_path, cell):
    rows = [line.replace(",", ";") for line in lines()]
    rows[7] = f"0.06;{cell};2.5"
    message = refusal(tmp_path, rows)
    assert message == (
        f"bad.csv, line 8, column u_V: '{cell}' is not a number: correct the cell or leave its row out"
    )


def test_a_word_is_refused_with_the_option_for_missing_values(tmp_path):
    rows = lines()
    rows[7] = "0.06,Defekt 3,2.5"
    message = refusal(tmp_path, rows)
    assert "bad.csv, line 8, column u_V: 'Defekt 3' is not a number" in message
    assert "missing" in message


@pytest.mark.parametrize(("column", "name"), [(1, "u_V"), (2, "y_um")])
def test_a_constant_channel_is_refused(tmp_path, column, name):
    rows = lines()
    for line in range(2, len(rows) + 1):
        cells = rows[line - 1].split(",")
        cells[column] = "2.5"
        rows[line - 1] = ",".join(cells)
    message = refusal(tmp_path, rows)
    assert f"column {name} is constant, 2.5 from line 2 to line 61" in message
    assert "choose a column, or rows, that vary" in message


def test_a_constant_input_is_accepted_for_a_simulation_only(tmp_path):
    rows = [HEADER, *(f"{k / 100:g},1,{k}" for k in range(60))]
    assert "column u_V is constant" in refusal(tmp_path, rows)
    (tmp_path / "hold.csv").write_text("\n".join(rows))
    assert read_record(tmp_path / "hold.csv", ["u_V"], "y_um", missing_output=True).u.max() == 1.0


# Lengths


def test_a_line_with_too_few_cells_is_refused(tmp_path):
    rows = lines()
    rows[8] = "0.07,1"
    message = refusal(tmp_path, rows)
    assert "line 9, column y_um: the line has 2 cells for 3 columns" in message
    assert "complete the line" in message


def test_a_line_with_too_many_cells_is_refused(tmp_path):
    rows = [line.replace(",", ";") for line in lines()]
    rows[8] += ";7"
    message = refusal(tmp_path, rows)
    assert "line 9, column y_um: the line has 4 cells for 3 columns" in message
    assert "delete the cells after the last column" in message
    assert "decimal comma" not in message


def test_a_decimal_comma_between_commas_is_recognised(tmp_path):
    rows = [HEADER, *(f"0,{k:02d},{k % 7},5,{k % 11},5" for k in range(60))]
    message = refusal(tmp_path, rows)
    assert "line 2" in message
    assert "6 cells for 3 columns" in message
    assert "if it is a decimal comma, save with ';' between the columns" in message


def test_an_input_that_ends_early_is_refused_as_of_unequal_length(tmp_path):
    rows = lines()
    for line in range(41, len(rows)):
        cells = rows[line].split(",")
        cells[1] = ""
        rows[line] = ",".join(cells)
    message = refusal(tmp_path, rows)
    assert "line 42, column u_V and all below, to line 61, are empty" in message
    assert "unequal lengths" in message
    assert "select the rows that are complete" in message


def test_a_blank_line_between_samples_is_refused(tmp_path):
    rows = lines()
    rows.insert(20, "")
    message = refusal(tmp_path, rows)
    assert "bad.csv, line 21 is blank" in message
    assert "islands.join" in message


def test_too_few_samples_are_refused_and_just_enough_are_not(tmp_path):
    message = refusal(tmp_path, lines(MIN_SAMPLES - 1))
    assert "29 samples, from line 2 to line 30, are too few: at least 30 are needed" in message
    (tmp_path / "enough.csv").write_text("\n".join(lines(MIN_SAMPLES)))
    assert read_record(tmp_path / "enough.csv", ["u_V"], "y_um").samples == 30


@pytest.mark.parametrize(
    ("rows", "shown"),
    [
        (slice(10, 61), "10:61"),
        (slice(60, None), "60:"),
        (slice(20, 20), "20:20"),
        (slice(40, 10), "40:10"),
        (slice(-61, None), "-61:"),
        (slice(0, 60, 2), "0:60:2"),
    ],
)
def test_a_selection_that_is_empty_or_out_of_range_is_refused(tmp_path, rows, shown):
    message = refusal(tmp_path, lines(), rows=rows)
    assert f"bad.csv has samples 0 to 59: rows {shown} are not a part of it" in message
    assert "first:stop, counted from 0" in message


# Sampling


def test_a_gap_is_refused_at_the_line_after_it(tmp_path):
    rows = lines()
    del rows[30]
    message = refusal(tmp_path, rows)
    assert "line 31, column t_s follows a gap: the time changes from 0.28 to 0.3" in message
    assert 'a gap of 0.02 before line 31; give gaps="split"' in message


@pytest.mark.parametrize("missing", [2, 30, 59])
def test_a_gap_of_one_sample_is_found_anywhere_even_in_integers(tmp_path, missing):
    rows = ["t_s,u_V,y_um", *(f"{k},{k % 7},{k % 11}" for k in range(61) if k != missing)]
    assert f"line {missing + 2}, column t_s follows a gap" in refusal(tmp_path, rows)


def test_a_repeated_time_stamp_is_refused(tmp_path):
    message = refusal(tmp_path, changed(25, 0, "0.22"))
    assert "line 25, column t_s repeats the time stamp 0.22" in message
    assert "resample" in message


def test_a_jump_backwards_is_refused_as_the_start_of_another_recording(tmp_path):
    rows = [*lines(), *lines()[1:]]
    message = refusal(tmp_path, rows)
    assert "line 62, column t_s jumps back to 0 from 0.59" in message
    assert 'give gaps="split" for segments' in message


def test_jittered_sampling_is_refused(tmp_path):
    t = 0.01 * (np.arange(60) + np.random.default_rng(3).uniform(-0.1, 0.1, 60))
    rows = [HEADER, *(f"{t[k]:.6f},{k % 7},{k % 11}" for k in range(60))]
    message = refusal(tmp_path, rows)
    assert "column t_s is off the uniform grid" in message
    assert "give resample=0.01" in message
    assert "dt=0.01" in message


def test_a_change_of_the_sampling_rate_is_refused_at_its_line(tmp_path):
    t = [k * 0.01 if k < 30 else 0.3 + (k - 30) * 0.02 for k in range(60)]
    rows = [HEADER, *(f"{t[k]:.4f},{k % 7},{k % 11}" for k in range(60))]
    message = refusal(tmp_path, rows)
    assert "line 32, column t_s" in message


def test_a_time_column_and_a_sampling_time_that_disagree_are_refused(tmp_path):
    message = refusal(tmp_path, lines(), dt=0.0102)
    assert "0.01 s by column t_s and 0.0102 s by dt=" in message


@pytest.mark.parametrize("dt", [0.0, -0.01, float("nan"), float("inf")])
def test_a_sampling_time_that_is_not_a_positive_number_is_refused(tmp_path, dt):
    assert f"positive number of seconds, got {dt}" in refusal(tmp_path, lines(), dt=dt)


def test_two_possible_time_columns_are_refused(tmp_path):
    rows = [f"{line},{k}" if k else f"{line},time_ms" for k, line in enumerate(lines())]
    assert "columns t_s and time_ms may all be the time: name one by time=" in refusal(tmp_path, rows)


# Columns


def test_a_missing_column_is_refused_with_all_columns_and_the_closest(tmp_path):
    message = refusal(tmp_path, lines(), inputs=["U_v"])
    assert message == "bad.csv has no column U_v; it has t_s, u_V, y_um. Did you mean 'u_V'?"


def test_columns_of_one_name_are_refused(tmp_path):
    rows = lines()
    rows[0] = "t_s,u_V,u_V"
    message = refusal(tmp_path, rows, output="u_V")
    assert "several columns named u_V: rename them" in message
