"""The writer: whatever it writes, tomllib reads back the same."""

import math
import tomllib
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from legato.config.toml import dumps

TEXTS = st.text(st.characters(blacklist_categories=["Cs"]), max_size=12)
SCALARS = st.one_of(
    st.booleans(), st.integers(-(2**63), 2**63 - 1), st.floats(allow_nan=False), TEXTS
)
LISTS = st.recursive(SCALARS, lambda inner: st.lists(inner, max_size=4), max_leaves=10)
TABLES = st.recursive(
    st.dictionaries(TEXTS, LISTS, max_size=4),
    lambda inner: st.dictionaries(TEXTS, st.one_of(LISTS, inner), max_size=4),
    max_leaves=10,
)


@given(TABLES)
def test_tables_read_back(document: dict[str, Any]) -> None:
    """Any table of numbers, texts, lists and tables comes back as it was."""
    assert tomllib.loads(dumps(document)) == document


def test_what_has_no_value_is_left_out_and_comments_stand_on_top() -> None:
    """None is no value in TOML; a comment is one however many lines it has."""
    text = dumps({"a": None, "b": 1}, "first\nsecond")
    assert text.startswith("# first\n# second\n")
    assert tomllib.loads(text) == {"b": 1}


def test_not_a_number_is_written_as_such() -> None:
    """TOML has nan; whoever reads it decides."""
    assert math.isnan(tomllib.loads(dumps({"x": math.nan}))["x"])


def test_what_toml_cannot_say_is_refused() -> None:
    """An object is no TOML, wherever it stands."""
    with pytest.raises(TypeError, match="object"):
        dumps({"x": [object()]})
