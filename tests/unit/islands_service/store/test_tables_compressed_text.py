"""Column type of long texts."""

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st
from sqlalchemy import Column, Integer, MetaData, Table, create_engine, insert, select, text

from islands_service.store.tables import CompressedText

TABLE = Table(
    "texts", MetaData(), Column("id", Integer, primary_key=True), Column("document", CompressedText)
)


@pytest.fixture(scope="module")
def connection():
    engine = create_engine("sqlite://")
    with engine.connect() as opened:
        TABLE.metadata.create_all(opened)
        yield opened
    engine.dispose()


def stored(connection, document):
    """Store a text; return it as it is read, and as it is in the database."""
    (number,) = connection.execute(insert(TABLE).values(document=document)).inserted_primary_key
    read = connection.execute(select(TABLE.c.document).where(TABLE.c.id == number)).scalar_one()
    raw = connection.execute(text(f"SELECT document FROM texts WHERE id = {number}")).scalar_one()
    return read, raw


@given(st.recursive(st.text() | st.floats(allow_nan=False), st.lists, max_leaves=50), st.integers(1, 100))
def test_every_document_is_read_as_it_was_stored_and_takes_no_more_room(connection, part, times):
    document = json.dumps([part] * times)
    read, raw = stored(connection, document)
    assert read == document
    assert len(raw) <= len(document)


def test_a_document_of_an_earlier_version_is_read(connection):
    document = json.dumps({"a": "x" * 10_000})
    connection.execute(
        text("INSERT INTO texts (id, document) VALUES (999999, :document)"), {"document": document}
    )
    assert connection.execute(select(TABLE.c.document).where(TABLE.c.id == 999999)).scalar_one() == document
