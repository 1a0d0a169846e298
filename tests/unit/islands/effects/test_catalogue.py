"""Plain names of the effects of the catalogue."""

from islands.effects.catalogue import CATALOGUE, OF_EACH, get_title
from islands.effects.interface.context import Parameter
from islands.effects.scale import wrong_parameter


def test_every_effect_has_another_plain_name() -> None:
    titles = [get_title(name) for name in (*CATALOGUE, *OF_EACH)]
    assert all(titles)
    assert len(set(titles)) == len(titles)
    assert not any(title in (*CATALOGUE, *OF_EACH) and "-" in title for title in titles)


def test_the_plain_name_of_an_effect_on_a_state_contains_the_state() -> None:
    assert get_title("input-offset:upper") == "offset of the input at upper"
    assert get_title("input-offset") == "offset of the input"
    assert get_title("core-shape:x") == get_title("core-shape") == "wrong form of the model"
    assert get_title(wrong_parameter(Parameter("m", "kg", 1.0, 0.01)).name) == "wrong parameter m"


def test_an_effect_outside_of_the_catalogue_has_no_plain_name() -> None:
    assert get_title("own-effect") == ""
