"""What reports share: tables in words, numbers with units, and strict JSON."""

import json
import math

import numpy as np
import pytest

from bench.stability.report import markdown
from granular._engine.reports import Report, aligned, duration, number, unit_of

ROWS = [["name", "error"], ["verlet", "1e-3"], ["é", ""]]


def test_columns_are_as_wide_as_their_widest_word():
    assert aligned(ROWS, "<>") == "name    error\nverlet   1e-3\né"
    assert aligned(ROWS, indent="  ").splitlines()[1] == "  verlet   1e-3"
    assert markdown(ROWS).splitlines() == ["| name | error |", "|---|---|", "| verlet | 1e-3 |", "| é |  |"]


def test_numbers_in_words():
    assert [number(x, ".1e") for x in (0.012, math.nan, -math.inf)] == ["1.2e-02", "–", "–"]
    assert [duration(x) for x in (2.0, 3.1e-3, 5e-9, 3e-12)] == ["2 s", "3.1 ms", "5 ns", "0.003 ns"]
    assert [unit_of(x, "m") for x in (2.0, 1.9, 0.0)] == [(1.0, "m"), (1e-3, "mm"), (1e-9, "nm")]


class Found(Report):
    def _numbers(self):
        return {"error": math.nan, "list": (np.float64(0.5), np.inf), "array": np.arange(2), "flag": np.True_}


def test_json_is_strict_and_has_provenance(tmp_path):
    Found().to_json(tmp_path / "found.json")
    text = (tmp_path / "found.json").read_text(encoding="utf-8")
    read = json.loads(text, parse_constant=lambda word: pytest.fail(f"{word} is not JSON"))
    assert read.pop("provenance")["versions"]["numpy"] == np.__version__
    assert read == {"error": None, "list": [0.5, None], "array": [0, 1], "flag": True}
