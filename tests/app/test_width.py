"""Output of every command fits in the terminal: in 80 columns if its width is not known."""

from __future__ import annotations

from pathlib import Path

import pytest

from granular.app.cli.output import wrap_text
from granular.app.cli.parser import COMMAND_CLASSES

LINES = {
    "scenes": ["scenes"],
    "run": ["run bouncing-ball --engine edmd", "run three-balls --engine md", "run heated-gas --n 30 --t-end 0.1"],
    "compare": ["compare three-balls", "compare three-balls -v --remedies", "compare real-balls",
                "compare bouncing-ball", "compare newtons-cradle -v", "compare ring-gas -v"],
    "sweep": ["sweep three-balls --over restitution=0.5:1:5", "sweep three-balls --over gap=1e-5:1e-4:30 --refine gap",
              "sweep ball-stack --over restitution=0.5:1:3 --over gap=1e-4:1e-3:2 --result v_rel --result v_final"],
    "threshold": ["threshold three-balls --over gap --points 8"],
    "frontier": ["frontier three-balls --methods located --methods verlet --repeats 1"],
    "stability": ["stability three-balls --axes gap --methods located verlet gear5"],
    "sensitivity": ["sensitivity three-balls", "sensitivity ball-stack --n 4 --uncertainty 1%"],
    "ensemble": ["ensemble three-balls --vary gap=1e-4,1e-5 --draws 4 --result v_rel"],
    "page": ["page three-balls"],
    "view": ["view run.npz"],
    "contacts": ["contacts list.csv --diameter 1 --particles 100"],
    "verify": ["verify", "verify touching-cradle", "verify solitary-wave"],
    "warm": [],  # prints times of compilers; one word, a kind and a number a line
    "info": ["info"],
}


def test_every_command_has_its_lines():
    assert list(LINES) == list(COMMAND_CLASSES)


@pytest.mark.rotating
@pytest.mark.parametrize("columns", ["", "60", "100"])
@pytest.mark.parametrize("name", LINES)
def test_output_fits_in_the_terminal(granular, monkeypatch, name, columns):
    granular("run three-balls --engine edmd --save run.npz")
    Path("list.csv").write_text("i,j,begin,end,overlap\n1,2,0,1,0.001\n3,4,0.5,,0.001\n", encoding="utf-8")
    monkeypatch.setenv("COLUMNS", columns)
    width = int(columns or 80)
    for line in [*LINES[name], f"{name} --help"] if columns != "60" else LINES[name]:
        code, out, err = granular(line)
        assert code == 0, err
        long = [one for one in out.splitlines() if len(one) > width and max(map(len, one.split())) < width // 2]
        tables = ("frontier", "stability") if columns == "60" else ()  # their columns need 80
        assert not long or name in tables, long


def test_wrapping_loses_no_word_and_keeps_columns(monkeypatch):
    monkeypatch.setenv("COLUMNS", "40")
    text = "  name    " + "word " * 20 + "\n\n    end\n" + "a" * 50
    wrapped = wrap_text(text)
    assert wrapped.split() == text.split()
    assert all(line.startswith(" " * 10) for line in wrapped.splitlines()[1:4])
    assert wrapped.endswith("\n\n    end\n" + "a" * 50)
    assert wrap_text("short\n\nlines") == "short\n\nlines"
