"""Reference answers for other codes: told set-ups give told answers, and a wrong digit is found and named."""

from __future__ import annotations

import csv
import json
import math

import numpy as np
import pytest

import granular as gr
from bench import make_verification as maker
from granular.app.cli import main
from granular.studies import verification

pytestmark = pytest.mark.core
LAWS = {"LinearDashpot": gr.LinearDashpot, "Hertz": gr.Hertz}
RUNS = [(name, run) for name, (_, _, runs) in maker.CASES.items() for run in runs]
WAVE = "solitary-wave"


def told(name: str, run: str) -> maker.Run:
    """A run as the file tells it, with what the maker asks of it."""
    given = dict(verification.case(name)["runs"][run]["set-up"])
    laws = tuple(LAWS[law.pop("type")](**law) for law in map(dict, given.pop("law")))
    t_end = given.pop("t_end")
    return maker.Run(gr.Scene(**given), laws, t_end, maker.CASES[name][2][run].kind)


@pytest.mark.parametrize(("name", "run"), RUNS)
def test_the_engine_gives_the_told_answers_from_the_told_set_up(name, run) -> None:
    found = told(name, run).by_engine()
    answers = [one for one in verification.answers(name) if one.run == run]
    assert [(one.quantity, one.unit) for one in answers] == [(key, unit) for key, (unit, _) in found.items()]
    for one in answers:
        value, near = float(one.value), 100.0 if one.unit == "%" else 1.0  # a difference of heights that are near
        assert found[one.quantity][1] == pytest.approx(value, rel=4e-15 * near * (1.0 + one.condition), abs=0.0), one


@pytest.mark.soak
@pytest.mark.parametrize(("name", "run"), RUNS)
def test_the_solver_of_34_digits_gives_the_told_answers(name, run) -> None:
    mpmath = pytest.importorskip("mpmath")
    found = told(name, run).by_reference()
    for one in verification.answers(name):
        if one.run == run:
            assert abs(mpmath.mpf(one.value) / found[one.quantity][1] - 1) < 2 * 10.0 ** (1 - one.digits)


def test_published_numbers_are_met() -> None:
    """MFIX's DEM02 and DEM03, English & Pego's wave, Herrmann & Schmälzle's cradle: digits of independent programs."""
    value = {(name, one.run, one.quantity): float(one.value)
             for name in verification.names() for one in verification.answers(name)}
    low = "height less that of an instantaneous bounce"
    percent = [-2.5259, -1.8799, -1.2992, -0.7958, -0.3659]
    for eps, known in zip((0.5, 0.6, 0.7, 0.8, 0.9), percent, strict=True):
        assert value["bouncing-sphere", f"k 5e5, restitution {eps}", low] == pytest.approx(known, abs=5e-5)
    assert value["bouncing-sphere", "k 5e4, restitution 0.5", low] == pytest.approx(-8.14195797846283, rel=1e-14)
    assert value["squeezed-balls", "after 1 ms", "velocity of ball 2"] == pytest.approx(0.0758305198655192, rel=1e-14)
    quarter = value[WAVE, "exponent 3/2", "speed (balls a second) over (largest overlap)^(1/4)"]
    assert quarter == pytest.approx(0.90551577641912, rel=1e-13)
    front = value["touching-cradle", "Hertz", "velocity of ball 4 after it"]
    assert front == pytest.approx(0.988777424147367, rel=1e-14)
    v_rel = [value["three-balls", "restitution 0.7", f"pair 1, contact 4: velocity of the {side} body after it"]
             for side in ("upper", "lower")]
    assert v_rel[0] - v_rel[1] == pytest.approx(0.177282410691079905, rel=1e-14)


def test_the_wave_is_that_of_the_package() -> None:
    stored = {one.quantity: one.value for one in verification.answers(WAVE)}
    for row in maker.wave():
        assert float(row["value"]) == pytest.approx(float(stored[row["quantity"]]), rel=2e-13)


def edited(path, change) -> None:
    """Write a table anew with the values of its rows changed."""
    with path.open(encoding="utf-8", newline="") as file:
        table = list(csv.DictReader(line for line in file if not line.startswith("#")))
    for i, row in enumerate(table):
        row["value"] = change(i, row)
    with path.open("w", encoding="utf-8", newline="") as file:
        out = csv.DictWriter(file, table[0])
        out.writeheader()
        out.writerows(table)


@pytest.mark.parametrize("name", verification.names())
def test_one_wrong_digit_is_found_and_named(name, tmp_path, capsys) -> None:
    path, rng = tmp_path / "theirs.csv", np.random.default_rng(len(name))
    rows = verification.answers(name)
    assert main(["verify", name, "-o", str(path)]) == 0
    assert main(["verify", name, "--check", str(path)]) == 0
    assert f"{len(rows)} right." in capsys.readouterr().out
    where = int(rng.integers(len(rows)))
    edited(path, lambda i, row: f"{float(row['value']) * (1.0 + 3e-9 * (i == where)):.10g}")
    assert main(["verify", name, "--check", str(path)]) == 1
    said = capsys.readouterr().out
    assert f"{len(rows) - 1} right, 1 wrong." in said
    assert f"First wrong: {rows[where].run}: {rows[where].quantity}: " in said
    assert main(["verify", name, "--check", str(path), "--tolerance", "1e-8"]) == 0


def test_words_of_verdicts(tmp_path) -> None:
    path, rows = tmp_path / "theirs.csv", verification.answers("three-balls")
    bad = max(range(len(rows)), key=lambda i: rows[i].condition)
    verification.write("three-balls", path)
    tiny = 8.0 * rows[bad].condition * 2.0**-52
    edited(path, lambda i, row: f"{float(row['value']) * (1.0 + tiny):.17g}" if i == bad else
           {0: "0", 1: "", 2: f"{float(row['value']):.5g}"}.get(i, row["value"]))
    found = verification.check("three-balls", path)
    assert {i: one.word for i, one in enumerate(found) if one.word != "right"} == {
        0: "wrong", 1: "missing", bad: "ill-conditioned"}
    assert found[0].off == 1.0
    assert math.isnan(found[1].off)
    assert found[bad].off == pytest.approx(tiny, rel=0.1)


def test_all_of_a_case_is_written(tmp_path, capsys) -> None:
    path = tmp_path / "case.json"
    assert main(["verify", "squeezed-balls", "-o", str(path)]) == 0
    stored = json.loads(path.read_text("utf-8"))
    assert stored["case"] == "squeezed-balls"
    assert stored["conventions"] == maker.CONVENTIONS
    assert list(stored["runs"]) == ["after 1 ms"]
    assert main(["verify"]) == 0
    assert main(["verify", "ring-of-two"]) == 0
    said = capsys.readouterr().out
    assert all(name in said for name in verification.names())
    assert "more; granular verify ring-of-two -o FILE.json writes all" in said


HEAD = "run,quantity,value\n"
ROW = '"after 1 ms","velocity of ball 1",0.0266\n'


@pytest.mark.parametrize(("text", "sentence"), [
    ("a" * 200_000, r"The file '.*theirs\.csv' must be a table of answers, got a line of more than 10000 characters\."),
    ("a,b\n1,2\n",
        r"The file '.*theirs\.csv' must have the columns run, quantity, value, but 'run' is missing\. Write such a "
        r"table with granular verify CASE -o FILE\.csv\."),
    (HEAD + "x,y,1\n", r"Line 2 of '.*theirs\.csv' is 'x', 'y', which is not an answer of case squeezed-balls\."),
    (HEAD + ROW + ROW, r"Line 3 of '.*theirs\.csv' is 'after 1 ms', 'velocity of ball 1', which occurred before\."),
    ("# words\n" + HEAD + ROW.replace("0.0266", "fast"),
        r"The value in line 3 of '.*theirs\.csv' must be empty or a finite number, got 'fast'\."),
    (HEAD + ROW.replace("0.0266", "nan"),
        r"The value in line 2 of '.*theirs\.csv' must be empty or a finite number, got 'nan'\."),
    (HEAD + ROW.replace("0.0266", "1e999999999999999"),
        r"The value in line 2 of '.*theirs\.csv' must be empty or a finite number, got '1e999999999999999'\."),
    (HEAD + ROW.replace("0.0266", "1e-999999999999999"),
        r"The value in line 2 of '.*theirs\.csv' must be empty or a finite number, got '1e-999999999999999'\."),
    ((HEAD + ROW).encode("utf-16"), r"The file '.*theirs\.csv' must be a \.csv file in UTF-8\."),
])
def test_tables_that_are_none(text, sentence, tmp_path) -> None:
    path = tmp_path / "theirs.csv"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(ValueError, match=sentence):
        verification.check("squeezed-balls", path)


@pytest.mark.parametrize(("given", "sentence"), [
    (["nothing"], "`case` must be one of three-balls, "),
    (["--check", "x.csv"], "--check requires a case: one of three-balls"),
    (["-o", "x.csv"], "-o requires a case: one of three-balls"),
    (["three-balls", "-o", "x.txt"], "`path` must be a name that ends in .csv or .json, got 'x.txt'"),
    (["three-balls", "--check", "nowhere.csv"], "nowhere.csv"),
])
def test_mistakes_are_told(given, sentence, capsys, tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["verify", *given]) == 2
    assert sentence in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
