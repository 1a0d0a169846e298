"""`make_note`: the options that a text names are those with which it was made."""

import copy
import pickle
import re

import pytest

from islands.errors import AdvisedText, RecordError, command_line_names, get_options, join_text, name_option
from islands.records.inspection.record_note import OPTIONS, AdvisedOption, make_note
from islands.records.reading.preview import preview

VALUES = [("gaps", "split"), ("resample", 0.01), ("resample", 1e-06), ("dt", 12.5), ("missing", "no value")]


@pytest.mark.parametrize(("option", "value"), VALUES)
def test_a_note_advises_the_options_of_its_text(option: str, value: object) -> None:
    advice = (AdvisedOption(option, value),)  # type: ignore[arg-type]
    assert make_note(join_text("give ", name_option(option, value), " to do so")).advice == advice
    with command_line_names():
        assert make_note(join_text("give ", name_option(option, value))).advice == advice


def test_a_message_keeps_its_options_in_an_error_and_in_copies() -> None:
    text = join_text("give ", name_option("gaps", "split"))
    assert get_options(RecordError(text).message) == (("gaps", "split"),)
    for same in (copy.deepcopy(text), pickle.loads(pickle.dumps(text))):
        assert isinstance(same, AdvisedText)
        assert (same, same.options) == (text, text.options)


def write(header: str, *times: str, mark: str = ",") -> str:
    """Return a table with a time, an input and an output."""
    rows = (f"{time}{mark}{k % 7}{mark}{k % 5}" for k, time in enumerate(times))
    return "\n".join([header, *rows, ""])


SAMPLES = range(200)

#: Files with a problem or a remark whose text names options.
FILES = {
    "gap": write("t_s,u_V,y_um", *(f"{0.1 * (k + 30 * (k > 50)):.1f}" for k in SAMPLES)),
    "backward": write("t_s,u_V,y_um", *(f"{0.1 * (k % 90):.1f}" for k in SAMPLES)),
    "repeated": write("t_s,u_V,y_um", *(f"{0.1 * (k // 2):.1f}" for k in SAMPLES)),
    "irregular": write("t_s,u_V,y_um", *(f"{0.1 * k + 0.03 * (k % 3):.2f}" for k in SAMPLES)),
    "without time": write("w_V,u_V,y_um", *(f"{k % 3}" for k in SAMPLES)),
    "unknown unit": write("time,u_V,y_um", *(f"{k * k}" for k in SAMPLES)),
    "dates": write("date,u_V,y_um", *(f"0{1 + k % 2}/0{1 + k % 3}/2024" for k in SAMPLES)),
    "decimals": write("t_s;u_V;y_um", *(f"{k},5" if k % 2 else f"{k}.5" for k in SAMPLES), mark=";"),
}


@pytest.mark.parametrize("name", FILES)
def test_every_option_that_a_note_on_a_file_names_is_advised(name: str, tmp_path) -> None:
    (tmp_path / "record.csv").write_text(FILES[name])
    notes = [make_note(text) for text in preview(tmp_path / "record.csv").warnings]
    named = {note.text: set(re.findall(r"(?<![\w-])(\w+)=", note.text)) & OPTIONS for note in notes}
    assert {note.text: {each.option for each in note.advice} for note in notes} == named
    assert any(named.values()), notes
