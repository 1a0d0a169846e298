"""The table of inner products behaves as a dictionary, even if nearly full."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from islands.kernels.pair_table import FREE, PLACE_BYTES, Pairs, find_pair, pair_key, pair_table

term = st.integers(0, 2**31 - 1)
#: Small indices form the same pair more often, and their keys differ in few bits.
pair = st.tuples(st.integers(0, 6), st.integers(0, 6)) | st.tuples(term, term)


def table(places):
    return Pairs(np.full(places, FREE), np.zeros(places), np.zeros(1, np.int64))


def put(pairs, key, number):
    at = find_pair(pairs, key)
    pairs.taken[0] += pairs.keys[at] != key
    pairs.keys[at], pairs.values[at] = key, number


@given(pair, pair)
def test_pair_key_identifies_an_unordered_pair_of_terms(one, other):
    assert pair_key(*one) == pair_key(*reversed(one))
    assert (pair_key(*one) == pair_key(*other)) == (sorted(one) == sorted(other))
    assert pair_key(*one) != FREE


@pytest.mark.parametrize("places", [2, 16, 64])
@given(st.data())
def test_table_behaves_as_a_dictionary_even_if_nearly_full(places, data):
    pairs, known = table(places), {}
    for number, drawn in enumerate(data.draw(st.lists(pair, max_size=3 * places))):
        key = pair_key(*drawn)
        if key not in known and len(known) == places - 1:
            continue  # one place is always free
        known[key] = float(number)
        put(pairs, key, float(number))
    assert pairs.taken[0] == len(known) == np.count_nonzero(pairs.keys != FREE)
    assert {key: pairs.values[find_pair(pairs, key)] for key in known} == known
    for absent in data.draw(st.lists(pair, max_size=10)):
        if (key := pair_key(*absent)) not in known:
            assert pairs.keys[find_pair(pairs, key)] == FREE


@pytest.mark.parametrize(("terms", "places"), [(128, 1 << 14), (360, 1 << 17)])
def test_pairs_of_a_search_rarely_collide(terms, places):
    """At half load a key is found after less than one step on average, for every size of the table."""
    pairs, steps = table(places), []
    empty = table(places)
    for key in (pair_key(one, other) for one in range(terms) for other in range(one, terms)):
        at = find_pair(pairs, key)
        pairs.keys[at] = key
        steps.append((at - find_pair(empty, key)) % places)
    assert len(steps) > 0.45 * places
    assert np.mean(steps) < 1.0


@pytest.mark.parametrize("limit", [0, 15, 16, 1000, 16 * 1024, 16 * 1025, 10**6, 1 << 20])
def test_table_has_a_power_of_two_of_places_within_the_limit(limit):
    pairs = pair_table(limit)
    places = pairs.keys.size
    assert places & (places - 1) == 0
    assert places == 1024 or places * PLACE_BYTES <= limit < 2 * places * PLACE_BYTES
    assert pairs.values.size == places
    assert (pairs.keys == FREE).all()
    assert pairs.taken.tolist() == [0]
