"""Plain names of the effects of the catalogue, and the order in which they act."""

from islands.effects.catalogue import ACTUATOR_MAPS, CATALOGUE, OF_EACH, catalogue_order, get_title
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


def test_known_effects_keep_their_order_where_another_one_acts() -> None:
    dead_zone, saturation, _, quantiser, backlash, *_ = ACTUATOR_MAPS
    known = (backlash, dead_zone)
    assert catalogue_order((dead_zone, backlash)) == (dead_zone, backlash)
    assert catalogue_order((dead_zone, backlash), known) == known
    offset = CATALOGUE["offset"]
    added = catalogue_order((dead_zone, offset, saturation, backlash, quantiser), known)
    assert added == (backlash, saturation, quantiser, dead_zone, offset)
