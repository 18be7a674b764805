"""The tournament tree of both engines, and records for two speeds."""

import math

import numpy as np
import pytest

from granular._engine.kernels import compiled
from granular._engine.records import (
    EMPTY_KEY,
    NODE,
    column,
    copied,
    leaf,
    one,
    plain,
    record_array,
    set_event_time,
    tournament,
    update_tournament,
)

FIELDS = np.dtype([("x", float), ("hits", int), ("series", float, (3,))], align=True)


@pytest.mark.parametrize("engine", ["plain", "compiled"])
@pytest.mark.parametrize("n", [1, 2, 3, 8, 21])
def test_the_first_is_the_least_time_and_of_equal_times_the_least_key(n, engine) -> None:
    """Against a search through all owners, with many equal times and keys in any order."""
    how = lambda function: function  # noqa: E731
    if engine == "compiled":
        pytest.importorskip("numba")
        how = compiled
    random, tree = np.random.default_rng(n), tournament(n)
    tree = plain(tree) if engine == "plain" else tree
    due, key = [math.inf] * n, list(range(n))
    for turn in range(300):
        if turn % 3:
            c = int(random.integers(n))
            due[c] = float(random.choice([0.0, 1.0, 2.0, math.inf]))
            how(set_event_time)(tree, c, due[c])
        else:
            first, last = sorted(int(c) for c in random.integers(0, n, 2))
            for c in range(first, last + 1):
                due[c], key[c] = float(random.integers(3)), int(random.integers(1 << 20)) * n + c
                if engine == "plain":
                    node = leaf(tree, c)
                    node.due, node.key = due[c], key[c]
                else:
                    tree[len(tree) // 2 + c] = due[c], key[c]
            how(update_tournament)(tree, first, last)
        if n > 1 or turn > 2:
            got = (tree[1].due, tree[1].key) if engine == "plain" else tree[1].tolist()
            assert tuple(got) == min(zip(due, key, strict=True))


def test_nobody_is_due_at_first() -> None:
    tree = tournament(5)
    assert len(tree) == 16
    assert np.isinf(tree["due"]).all()
    assert tree["key"].tolist() == [EMPTY_KEY] * 8 + [0, 1, 2, 3, 4] + [EMPTY_KEY] * 3


def test_records_become_plain_objects_and_come_back() -> None:
    records = np.zeros(4, FIELDS)
    records["x"], records["hits"] = [0.1, -0.0, math.inf, 5e-324], range(4)
    records["series"] = np.arange(12).reshape(4, 3)
    objects = plain(records)
    assert [type(value) for value in (objects[1].x, objects[1].hits, objects[1].series)] == [float, int, list]
    assert record_array(objects, FIELDS).tobytes() == records.tobytes() == copied(records).tobytes()
    assert column(objects, "hits").tolist() == column(records, "hits").tolist()
    copies = copied(objects)
    copies[0].x = 7.0
    assert objects[0].x == 0.1
    assert column(copies, "x")[0] == 7.0


def test_one_record_is_written_through_and_refuses_names_that_would_hide() -> None:
    records = np.zeros(1, NODE)
    one(records).due = 3.0
    assert records["due"][0] == 3.0
    with pytest.raises(AssertionError):
        one(np.zeros(1, np.dtype([("base", float)])))
