"""`islands.identify` with a primitive of the user."""

import decimal

import numpy as np
import pytest

import islands
from islands.errors import ModelError, SettingsError
from islands.expressions.printing import plain
from support.own_primitive import DEAD_ZONE, LAW, SEARCH, record


@pytest.fixture(scope="module")
def states():
    return []


@pytest.fixture(scope="module")
def result(states):
    return islands.identify(record(), on_epoch=lambda state, _: states.append(state), **SEARCH)


def test_search_finds_a_law_that_needs_the_primitive(result):
    model = result.best.model
    found = {plain(item.expression): value for item, value in zip(model.regressors, model.theta, strict=True)}
    assert found == pytest.approx(LAW, rel=1e-12)
    assert result.best.simulate(record(), warm_up=1).y[1:] == pytest.approx(record().y[1:], abs=1e-12)


@pytest.mark.parametrize("kind", ["plain", "latex", "python", "c"])
def test_model_is_exported(result, kind):
    assert "dead" in result.best.export(kind)


def refused(*primitives):
    with pytest.raises(SettingsError) as caught:
        islands.identify(record(), on_epoch=pytest.fail, **{**SEARCH, "primitives": primitives})
    return str(caught.value)


def test_wrong_entries_are_refused_with_advice():
    other = islands.primitive("dead_zone", lambda a: 0.5 * a)
    assert refused(DEAD_ZONE, other) == "two primitives have the name 'dead_zone': rename one of them"
    assert refused(np.tanh).endswith("is a function: pass islands.primitive(name, function)")
    assert refused("dead_zone").startswith("unknown primitive 'dead_zone': take one of mul, ")


def test_function_that_does_not_compile_is_refused_before_the_search():
    own = islands.primitive("own", lambda a: float(decimal.Decimal(a)))
    with pytest.raises(ModelError, match="primitive 'own' does not compile; use arithmetic"):
        islands.identify(record(), on_epoch=pytest.fail, **{**SEARCH, "primitives": (own,)})
