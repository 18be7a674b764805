"""Contact lists from LAMMPS and from CSV files, and the traps of these files."""

import json
import math
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from granular.studies import contacts

TRACKER = Path(__file__).parents[1] / "reference" / "tracker.local.gz"
NAMES = "f_seen[1] f_seen[2] f_seen[3] f_seen[4] f_seen[5]"
PAIRS = "c_p[1] c_p[2] c_q[1] c_q[2]"


def dump(path, frames, names=NAMES):
    """Write a dump local with rows of text by step."""
    text = "".join(f"ITEM: TIMESTEP\n{step}\nITEM: NUMBER OF ENTRIES\n{len(rows)}\nITEM: BOX BOUNDS pp pp pp\n"
                   f"0 1\n0 1\n0 1\nITEM: ENTRIES {names}\n" + "".join(f"{row} \n" for row in rows)
                   for step, rows in frames.items())
    Path(path).write_text(text, encoding="utf-8")
    return path


def test_a_tracker_is_read_in_steps_and_its_gaps_are_stated(tmp_path):
    path = dump(tmp_path / "seen", {0: [], 100: ["3 1 5 15 0.99", "2 3 90 100 0.98"], 200: ["1 2 101 111 0.97"]})
    found = contacts.read_lammps(path, 0.5, diameter=1.0)
    assert found["begin"].tolist() == [2.5, 45.0, 50.5]
    assert found["end"].tolist() == [7.5, 50.0, 55.5]
    assert found["span"] == (0.0, 100.0)
    assert found["overlap"] == pytest.approx([0.01, 0.02, 0.03], rel=1e-12)
    report = str(contacts.analyse(**found, particles=10))
    assert "Contacts that had not ended are missing in the file. In a heap at rest these are almost all" in report
    assert "Contacts with walls are not in the file." in report
    assert "twice" not in report


def test_without_an_empty_first_snapshot_the_run_begins_with_the_first_contact(tmp_path):
    path = dump(tmp_path / "seen", {100: ["3 1 45 60 0.99"], 200: ["1 2 101 111 0.97"]})
    found = contacts.read_lammps(path, 2.0)
    assert found["span"] == (90.0, 400.0)
    assert not {"overlap", "distance"} & found.keys()


def test_contacts_across_a_boundary_count_once(tmp_path):
    """With `newton off`, LAMMPS lists them in both orders."""
    rows = ["31 1 5 15 0.99", "1 31 5 15 0.99", "1 2 7 17 0.98", "1 31 16 26 0.99"]
    path = dump(tmp_path / "seen", {0: [], 100: rows})
    found = contacts.read_lammps(path, 1.0, diameter=1.0)
    assert [found[name].tolist() for name in ("i", "j", "begin")] == [[1, 1, 1], [31, 2, 31], [5.0, 7.0, 16.0]]
    assert "Contacts across a boundary are listed twice and counted once." in str(contacts.analyse(**found))


def test_diameters_of_particles(tmp_path):
    path = dump(tmp_path / "seen", {0: [], 100: ["1 2 5 15 1.4", "2 3 7 17 1.9"]})
    found = contacts.read_lammps(path, 1.0, diameter=[1.0, 2.0, 2.0])
    assert found["distance"].tolist() == [1.5, 2.0]
    assert found["overlap"] == pytest.approx([0.1, 0.1], rel=1e-12)


def test_columns_have_names(tmp_path):
    rows = {0: [], 9: ["0.5 1 4 6 2"]}
    path = dump(tmp_path / "seen", rows, "a b c d e")
    found = contacts.read_lammps(path, 1.0, columns="r_ave id2 created broken id1")
    assert [found[name].tolist() for name in ("i", "j", "begin", "end")] == [[1], [2], [4.0], [6.0]]
    path = dump(tmp_path / "named", rows, "r_ave id2 created broken id1")
    assert contacts.read_lammps(path, 1.0)["j"].tolist() == [2]


@pytest.mark.parametrize("columns", [5, ["id1", "id2", "created", "broken", "r_min"]])
def test_names_of_columns_are_one_text(columns, tmp_path):
    with pytest.raises(TypeError, match=r"^`columns` must be the names of all columns in one text, got "):
        contacts.read_lammps(dump(tmp_path / "seen", {0: [], 9: ["1 2 4 6 0.9"]}), 1.0, columns=columns)


@pytest.mark.parametrize("distance", ["nan", "-0.9"])
def test_distances_of_a_run_that_is_unstable_are_refused(distance, tmp_path):
    """A distance of nan was left out like that of a pair that does not touch."""
    path = dump(tmp_path / "seen", {0: [], 9: ["1 2 0.9 5", f"1 3 {distance} 5"]}, "id1 id2 distance force")
    with pytest.raises(ValueError, match=r"^`distance\[1\]` must be a number in m of at least 0, got "):
        contacts.read_lammps(path, 1.0, diameter=1.0)


REFUSED = {  # rows by step, and the sentence
    "steps without all digits": ({0: [], 3000000: ["17 22 2.00182e+06 2.002e+06 0.9"]},
                                 r"must be integers with all digits \(.*\)\. Use `dump_modify ID format float %\.15g`"),
    "local ids in a wrong format": ({0: [], 2000: ["1040870720 1 1 1 0.9", "1040870720 2 1 1 0.9"]},
                                    "^Columns created and broken must be steps at which contacts began and ended, at "
                                    r"most TIMESTEP, got others\. Use `dump_modify ID format float %\.15g`"),
    "ids of zero": ({0: [], 100: ["0 3 5 15 0.9"]}, r"^Every particle in .* must be a number from 1 on, got 0\. U"),
    "times beyond the step": ({0: [], 100: ["1 3 5 150 0.9"]}, "^Columns created and broken must be steps"),
    "end before begin": ({0: [], 100: ["1 3 15 5 0.9"]}, "^Columns created and broken must be steps"),
    "a dump less frequent than the tracker": ({0: [], 100: [f"{k} {k + 1} 5{k % 9} 70 0.9" for k in range(1, 30)]},
                                              "^Tracker and dump must have the same interval N, got no contact that "),
    "steps that do not increase": ({100: ["1 3 15 50 0.9"], 50: ["1 2 15 40 0.9"]}, r"^`TIMESTEP\[1\]` must be larger"),
    "no contacts": ({0: [], 100: []}, "^`path` must be a dump local of LAMMPS with contacts, got .* without any"),
    "three columns": ({0: [], 100: ["1 3 5"]}, "must be integers with all digits"),
    "a word": ({0: [], 100: ["1 three 5 15 0.9"]}, "must be integers with all digits"),
    "too large a distance": ({0: [], 100: ["1 3 5 15 1.1"]}, r"^`r_min\[0\]` must be at most R₁ \+ R₂, got 1.1. Ch"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_a_trap_of_a_tracker_is_refused_in_one_sentence(name, tmp_path):
    frames, match = REFUSED[name]
    with pytest.raises(ValueError, match=match):
        contacts.read_lammps(dump(tmp_path / "seen", frames), 1.0, diameter=1.0)


def test_files_of_another_kind_are_refused(tmp_path):
    atoms = dump(tmp_path / "atoms", {0: []}).read_text().replace("ITEM: ENTRIES", "ITEM: ATOMS id x")
    for text in (atoms, "i,j,begin,end\n1,2,3,4\n", "", "\x00\x01\x02\n"):
        (tmp_path / "other").write_text(text)
        with pytest.raises(ValueError, match=r"^`path` must be a dump local of LAMMPS"):
            contacts.read_lammps(tmp_path / "other", 1.0)
    path = dump(tmp_path / "cut", {0: [], 100: ["1 3 5 15 0.9", "1 2 5 15 0.9"]})
    path.write_text(path.read_text()[: -len("1 2 5 15 0.9 \n")])
    with pytest.raises(ValueError, match=r"complete file, got .* which ends within a snapshot"):
        contacts.read_lammps(path, 1.0)
    for text in ("ITEM: TIMESTEP\n", "ITEM: TIMESTEP\nten\n", "ITEM: TIMESTEP\n10\nITEM: NUMBER OF ENTRIES\n-1\n"):
        (tmp_path / "other").write_text(text)
        with pytest.raises(ValueError, match=r"^The line after ITEM: .* in .* must be an integer, got '.*'\.$"):
            contacts.read_lammps(tmp_path / "other", 1.0)
    with pytest.raises(FileNotFoundError):
        contacts.read_lammps(tmp_path / "none", 1.0)
    (tmp_path / "half.gz").write_bytes(TRACKER.read_bytes()[: TRACKER.stat().st_size // 2])
    with pytest.raises(ValueError, match=r"complete file, got .* which ends too early\.$"):
        contacts.read_lammps(tmp_path / "half.gz", 1.0)
    packed = TRACKER.read_bytes()
    for data in (b"ITEM: TIMESTEP", packed[:40] + b"\x00\x01" + packed[42:], packed[:-8] + bytes(8)):
        (tmp_path / "no.gz").write_bytes(data)
        with pytest.raises(ValueError, match=r"^`path` must be a complete .*no\.gz', which is damaged \(.*\)\.$"):
            contacts.read_lammps(tmp_path / "no.gz", 1.0)


@pytest.mark.filterwarnings("error")
def test_a_dump_that_ends_within_its_last_row_is_refused(tmp_path):
    """A killed run leaves such a file; its last number could have lost digits or its exponent."""
    text = dump(tmp_path / "whole", {0: [], 100: ["1 3 5 15 0.9", "1 2 5 15 9.375e-01"]}).read_text()
    start = text.index("1 2 5 15")
    for end in range(start, len(text)):
        (tmp_path / "cut").write_text(text[:end])
        with pytest.raises(ValueError, match=r"complete file, got .* which ends within a snapshot\.$"):
            contacts.read_lammps(tmp_path / "cut", 1.0)
    (tmp_path / "cut").write_text(text)
    assert contacts.read_lammps(tmp_path / "cut", 1.0, diameter=1.0)["overlap"].tolist() == [1.0 - 0.9, 0.0625]


@pytest.mark.parametrize("label", ["ENTRIES", "CONTACTS"])
def test_lines_of_dump_modify_are_read_over(label, tmp_path):
    """Options units, time and label of dump_modify: the first two write lines before each time step."""
    path = dump(tmp_path / "seen", {0: [], 100: ["3 1 5 15 0.99", "2 3 90 100 0.98"], 200: ["1 2 101 111 0.97"]})
    plain = contacts.read_lammps(path, 0.5, diameter=1.0)
    text = path.read_text().replace("ITEM: TIMESTEP", "ITEM: TIME\n0.25\nITEM: TIMESTEP").replace("ENTRIES", label)
    path.write_text("ITEM: UNITS\nlj\n" + text)
    assert repr(contacts.read_lammps(path, 0.5, diameter=1.0)) == repr(plain)


@pytest.mark.parametrize(("more", "match"), [
    ({"time_step": 0.0}, "^`time_step` must be a finite number above 0"),
    ({"diameter": -1.0}, r"^`diameter\[0\]` must be positive and finite"),
    ({"diameter": [1.0, 1.0]}, r"^`diameter` must be one number or 3 numbers, got 2\."),
    ({"columns": "id1 id2"}, r"^`columns` must be 5 different names with id1, id2, got \['id1', 'id2'\]\. The file"),
    ({"columns": "id1 id2 created r r_min"}, "with id1, id2, created, broken"),
    ({"columns": "id1 id2 x x r"}, "^`columns` must be 5 different names"),
])
def test_misuse_of_the_reader_is_one_sentence(more, match, tmp_path):
    path = dump(tmp_path / "seen", {0: [], 100: ["1 3 5 15 0.9"]})
    with pytest.raises(ValueError, match=match):
        contacts.read_lammps(path, **{"time_step": 1.0} | more)


def test_pairs_that_do_not_touch_are_left_out(tmp_path):
    rows = ["1 2 0.99 10", "2 3 0.98 20", "4 5 1.0 0", "5 6 1.01 3", "7 8 0.97 -5"]
    found = contacts.read_lammps(dump(tmp_path / "pairs", {0: rows, 100: []}, PAIRS), 1.0, diameter=1.0)
    assert list(zip(found["i"], found["j"], strict=True)) == [(1, 2), (2, 3), (7, 8)]
    assert found["impulse"].tolist() == [1000.0, 2000.0, 0.0]  # attractive forces do not count
    assert found["overlap"] == pytest.approx([0.005 * math.pi * x for x in (1, 2, 3)], rel=1e-12)
    report = contacts.analyse(**found, particles=10)
    assert report.occupation == pytest.approx(6 / 10 / 2, rel=1e-12)
    assert report.shared_impulse == pytest.approx(1.0, rel=1e-12)
    assert "Snapshots too far apart: on average, a contact is seen in 1 of them" in str(report)
    assert "Contacts with walls are not in the file." in str(report)


def test_a_csv_file_has_named_columns(tmp_path):
    path = tmp_path / "list.csv"
    path.write_text('"i", j,kind,begin,end,impulse\n0,1,x,0.0,1.0,2.0\n1,2,x,0.5,1.5,1.0\n3,4,y,0.0,,1.0\n')
    found = contacts.read_csv(path)
    assert {name: values.tolist() for name, values in found.items() if name != "end"} == {
        "i": [0.0, 1.0, 3.0], "j": [1.0, 2.0, 4.0], "begin": [0.0, 0.5, 0.0], "impulse": [2.0, 1.0, 1.0]}
    report = contacts.analyse(**found, particles=5, span=1.5)
    assert (report.n_open, report.durations.tolist()) == (1, [1.0, 1.0, 1.5])
    path.write_text("a,b,t0,t1\n1,2,0.0,1.0\n")
    named = contacts.read_csv(path, {"i": "a", "j": "b", "begin": "t0", "end": "t1"})
    assert [named[name].tolist() for name in ("i", "j", "begin", "end")] == [[1.0], [2.0], [0.0], [1.0]]
    path.write_text("time,i,j,force\n0.0,1,2,5.0\n1.0,1,2,4.0\n1.0,2,3,4.0\n")
    assert contacts.read_csv(path)["impulse"].tolist() == [9.0, 4.0]


@pytest.mark.filterwarnings("error")
def test_a_csv_file_without_rows_has_empty_columns(tmp_path):
    (tmp_path / "list.csv").write_text("i,j,begin,end\n")
    assert {name: len(values) for name, values in contacts.read_csv(tmp_path / "list.csv").items()} == {
        "i": 0, "j": 0, "begin": 0, "end": 0}


@pytest.mark.parametrize(("text", "columns", "match"), [
    ("i,j,begin\n1,2,3\n", None, r"^The first line of .* must be names of columns with end, got i, j, begin\. Name "),
    ("1,2,3,4\n1,2,3,4\n", None, "must be names of columns with begin, end, i, j, got 1, 2, 3, 4"),
    ("i,j,begin,end\n1,2,x,4\n", None, "^The entries of .* must be numbers"),
    ("i,j,begin,end\n1,2,0,later\n", None, "^The entries of .* must be numbers"),
    ("i,j,begin,end\n1,2,0\n", None, "^The entries of .* must be numbers"),
    ("i,j,begin,end,i\n1,2,0,1,5\n", None, r"^The first line of .* must be different names of .*, got i 2 times\."),
    ("i,j,begin,end\n1,2,0,1\n", {"impulse": "push"}, "must be names of columns with impulse"),
    ("i,j,begin,end\n1,2,0,1\n", {"radius": "i"}, "^unknown parameter radius"),
    ("i,j,begin,end\n1,2,0,1\n", ["i"], "^`columns` must be a mapping"),
])
def test_misuse_of_a_csv_file_is_one_sentence(text, columns, match, tmp_path):
    (tmp_path / "list.csv").write_text(text)
    with pytest.raises((TypeError, ValueError), match=match):
        contacts.read_csv(tmp_path / "list.csv", columns)


def test_the_command_prints_one_paragraph(granular, tmp_path):
    shutil.copy(TRACKER, tmp_path / "seen.gz")
    code, out, _ = granular("contacts seen.gz --time-step 1e-3 --diameter 1 --particles 1000 --json found.json")
    assert code == 0
    assert out.startswith("Means differ from hard spheres by up to about 5.2 %. Z = 0.0894 contacts per particle, s = "
                          "0.00773, B = s + Z/2 = 0.0524.\n24 % of 2660 contacts of 1000 particles are disturbed, ")
    assert json.loads((tmp_path / "found.json").read_text())["deviation"] == pytest.approx(0.0524307, rel=1e-6)
    code, _, err = granular("contacts seen.gz")
    assert (code, err) == (2, "granular: contacts requires --time-step for a dump of LAMMPS, whose times are "
                                "numbers of steps.\n")
    for more in ("--time-step 1e-3", "--columns id1"):
        (tmp_path / "list.csv").write_text("i,j,begin,end\n1,2,0,1\n")
        code, out, err = granular(f"contacts list.csv {more}")
        assert (code, out) == (2, "")
        assert err.startswith(f"granular: {more.split()[0]} must be left out for a CSV file")
    (tmp_path / "list.csv").write_text("i,j,begin,end,overlap\n1,2,0,1,0.001\n3,4,0.5,1.5,0.001\n1,3,2,3,0.001\n")
    code, out, _ = granular("contacts list.csv --diameter 1 --particles 100")
    assert (code, out.partition(" Z = ")[0]) == (0, "Means differ from hard spheres by up to about 1.3 %.")


PAGE = Path(__file__).parents[2] / "docs" / "guide" / "your-own-3d-run.md"


@pytest.mark.soak
def test_a_run_of_lammps_from_its_input_to_the_paragraph(granular, tmp_path):
    """The input and the command of the page, word for word, and snapshots of the same run."""
    if shutil.which("lmp") is None:
        pytest.skip("LAMMPS is not installed")
    blocks = re.findall(r"^```text\n(.*?)^```", PAGE.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
    deck, command, snapshots = (block for block in blocks if not block.startswith("Means"))
    (tmp_path / "in.gas").write_text(deck.replace("run 10000\n", snapshots + "run 10000\n"), encoding="utf-8")
    subprocess.run(["lmp", "-in", "in.gas"], cwd=tmp_path, check=True, capture_output=True)
    code, out, _ = granular(command.strip().removeprefix("granular "))
    assert code == 0
    assert re.match(r"Means differ from hard spheres by up to about 1\d %\. Z = 0\.[23]", out), out
    assert "Contacts that had not ended are missing in the file" in out
    tracked = contacts.analyse(**contacts.read_lammps(tmp_path / "seen.local", 2e-4, diameter=1.0), particles=216)
    seen = contacts.analyse(**contacts.read_lammps(tmp_path / "snapshots.local", 2e-4, diameter=1.0), particles=216)
    assert seen.occupation == pytest.approx(tracked.occupation, rel=0.15)
    assert seen.deviation == pytest.approx(tracked.deviation, rel=0.15)
    assert "Snapshots too far apart" in str(seen)
