"""No figure or table of the docs goes stale unseen: its data is computed again at few points and compared."""

import importlib.util
import json
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FIGURES = ROOT / "docs" / "figures"


def load(name):
    sys.path.insert(0, str(ROOT / "bench"))
    try:
        spec = importlib.util.spec_from_file_location(name, ROOT / "bench" / f"{name}.py")
        module = sys.modules[name] = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
    finally:
        sys.path.remove(str(ROOT / "bench"))
    return module


docs_data = load("docs_data")


@pytest.mark.rotating
@pytest.mark.parametrize("name", [
    name if entry.quick else pytest.param(name, marks=pytest.mark.soak)
    for name, entry in docs_data.DATA_ENTRIES.items()
])
def test_data_of_a_figure_or_table_is_what_is_stored(name, monkeypatch):
    monkeypatch.syspath_prepend(ROOT / "bench")
    entry = docs_data.DATA_ENTRIES[name]
    stored = json.loads((docs_data.DATA_FOLDER / f"{name}.json").read_text(encoding="utf-8"))
    found = docs_data.differences(stored, json.loads(json.dumps(entry.compute())), entry)
    assert not found, f"{name} is stale; draw it anew (bench/regenerate.py):\n" + "\n".join(found[:20])


def test_every_figure_has_its_data():
    drawn = {path.stem for path in FIGURES.glob("*.png")}
    assert drawn <= docs_data.DATA_ENTRIES.keys() | docs_data.TIMES_ONLY
    assert {path.stem for path in docs_data.DATA_FOLDER.glob("*.json")} == (
        docs_data.DATA_ENTRIES.keys() | docs_data.TIMES_ONLY)


def test_what_differs_is_named():
    entry = docs_data.Entry(lambda: None, relative=1e-3, absolute=1e-9)
    stored = {"a": [1.0, None, "x", True], "b": {"c": 0.0}}
    assert docs_data.differences(stored, {"a": [1.0001, None, "x", True], "b": {"c": 1e-10}}, entry) == []
    for change in ({"a": [1.01, None, "x", True]}, {"a": [1.0, 2.0, "x", True]}, {"a": [1.0, None, "y", True]},
                   {"a": [1.0, None, "x", False]}, {"a": [1.0]}, {"b": {"d": 0.0}}, {"b": {"c": 1e-3}}):
        assert len(docs_data.differences(stored, stored | change, entry)) == 1
    assert docs_data.differences(stored, {"a": stored["a"]}, entry)
