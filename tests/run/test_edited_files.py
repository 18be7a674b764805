"""An edited file of a saved run is refused in one sentence, or it is the same run. Nothing in it is ever run."""

import os
import zipfile

import numpy as np
import pytest

import granular as gr
from granular._engine import files as _files
from tests.helpers import edited_files, saved_scenes
from tests.helpers.rewritten_files import DYING, rewritten
from tests.helpers.saved_scenes import ALL

CALLS = [
    {"class": "granular._engine.describe:import_module", "fields": {"name": "payload"}},
    {"class": "granular.app.cli:main", "fields": {"argv": ["compare", "three-balls", "--json", "victim.json"]}},
    {"class": "granular.scene.walls.motion:Motion",
     "fields": {"function": {"class": "granular.app.cli:main", "fields": {}}}},
    {"class": "granular.nosuch:foo", "fields": {}}, {"class": "noclass", "fields": {}},
    {"class": "hertz", "fields": {"k": 1.0}},
]


@pytest.mark.parametrize("call", CALLS, ids=lambda call: call["class"])
@pytest.mark.parametrize("place", ["rule", "walls"])
def test_a_file_that_names_code_is_refused_and_nothing_runs(call, place, files, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "payload.py").write_text("open('ran', 'w').close()")
    described = call | {"shown": ""}
    path = rewritten(files, tmp_path, "hard_sine", **{place: described if place == "rule" else [described, None]})
    word = {"rule": "rule", "walls": "wall"}[place]
    with pytest.raises(ValueError, match=f"edited.npz' is not a valid run: The class of a {word} must be one of .*, "
                                         r"got .*\. A later version"):
        gr.Trajectory.load(path)
    assert sorted(os.listdir(tmp_path)) == ["edited.npz", "payload.py"]


@pytest.mark.parametrize(("changes", "sentence"), [
    ({"rule": {"class": "constant-restitution", "shown": "", "fields": {"restitution": 0.5, "more": 1}}},
     r"The file '.*edited\.npz' is not a valid run: The fields of a rule of class 'constant-restitution' must be "
     r"restitution, got \{'restitution': 0\.5, 'more': 1\}\."),
    ({"rule": {"class": "constant-restitution", "shown": "", "fields": {"restitution": 7.0}}},
        r"The file '.*edited\.npz' is not a valid run: `restitution` must be a number in \[0, 1\], got 7\.0\. 1 is "
        r"elastic, 0 sticks\."),
    ({"rule": {"class": "constant-restitution", "shown": "", "fields": {"restitution": [0.5] * 3}}},
        r"The length of `restitution` must be 2 \(the number of pairs\), got 3\. Give one for all pairs, or one "
        r"per pair from the bottom up\."),
    ({"rule": {"class": 5, "shown": ""}},
        r"The file '.*edited\.npz' is not a valid run: The description of a rule must be an object with the "
        r"strings 'class' and 'shown', got \{'class': 5, 'shown': ''\}\."),
    ({"rule": [{"class": "thornton-restitution", "shown": "", "fields": {"yield_speed": 1.0}}]},
        r"The file '.*edited\.npz' is not a valid run: The length of `rule` must be 2 \(the number of pairs\), got "
        r"1\. Give one for all pairs, or one per pair from the bottom up\."),
    ({"status": "fine"},
        r"The file '.*edited\.npz' is not a valid run: its status must be one of time, until, quiet, resting, "
        "collapse, disturbed, max_events, unstable, broken, bounded, got "
        r"'fine'\."), ({"stats": {"events": {}}}, "its number 'events' is"),
    ({"stats": {"first_disturbed": [1.0]}}, "its number 'first_disturbed' is"), ({"rule": None}, "both laws and rules"),
    ({"message": 5}, rf"its message is 5\. {DYING}"), ({"walls": [None]},
        r"The file '.*edited\.npz' is not a valid run: its walls must be 2, a floor and a ceiling or None, got "
        r"1\."),
    ({"time": np.array([1.0, 0.0])},
        r"The file '.*edited\.npz' is not a valid run: its times decrease or are not finite\. The file was edited "
        r"after it was saved\."),
    ({"velocity": np.full((2, 3), np.nan)},
        r"The file '.*edited\.npz' is not a valid run: its samples or contacts are not finite\. The file was "
        r"edited after it was saved\."),
    ({"position": np.zeros((3, 3, 3))},
        r"The file '.*edited\.npz' is not a valid run: position does not fit a run of 3 bodies and 2 samples, got "
        r"an array of shape \(3, 3, 3\) and kind 'f'\. The file was edited after it was saved\."),
    ({"gap": np.zeros((2, 2), "f4")},
        r"The file '.*edited\.npz' is not a valid run: gap does not fit a run of 3 bodies and 2 samples, got an "
        r"array of shape \(2, 2\) and kind 'f'\. The file was edited after it was saved\."),
    ({"state__fall_velocity": np.zeros((2, 2, 2))},
        r"The file '.*edited\.npz' is not a valid run: state\.fall_velocity does not fit a run of 3 bodies and 2 "
        r"samples, got an array of shape \(2, 2, 2\) and kind 'f'\. The file was edited after it was saved\."),
])
def test_what_a_file_says_is_checked_on_load(changes, sentence, files, tmp_path):
    path = rewritten(files, tmp_path, "hard_sine" if "walls" in changes else "hard_floor", **changes)
    with pytest.raises((TypeError, ValueError), match=sentence):
        gr.edmd.resume(gr.Trajectory.load(path), t_end=1.0)


def test_a_file_that_was_changed_by_hand_is_refused(files, tmp_path):
    words, arrays = edited_files.stored(files / "hard_floor.npz")
    path = rewritten(files, tmp_path, signed=False, state__noise=arrays["state.noise"] + 1e-9)
    with pytest.raises(ValueError, match=rf"its numbers do not match its digest\. {DYING}"):
        gr.Trajectory.load(path)
    words, arrays = words | {"format": 2}, {**arrays, "state.noise": arrays["state.noise"] + 1e-9}
    path.write_bytes(edited_files.packed(words, arrays, False))
    with pytest.raises(ValueError, match=rf"its numbers do not match its digest\. {DYING}"):
        gr.Trajectory.load(path)


def test_sizes_are_known_before_memory_is_taken(files, tmp_path, monkeypatch):
    """An array of 10¹² entries, one of more bytes than its head says, of objects, of another shape, and one twice."""
    with zipfile.ZipFile(files / "hard_floor.npz") as archive:
        whole = {info.filename: archive.read(info) for info in archive.infolist()}
    head = whole["time.npy"]
    for name, data in {
        "time": head.replace(b"(2,), }             ", b"(1000000000000,), }"), "gap": whole["gap.npy"] + bytes(1 << 22),
        "velocity": head.replace(b"<f8", b"|O8").replace(b"|O8", b"|O "), "state.fall_velocity": b"", "words": head,
    }.items():
        with zipfile.ZipFile(tmp_path / "bomb.npz", "w", zipfile.ZIP_DEFLATED) as archive:
            for member, bytes_ in (whole | {f"{name}.npy": data}).items():
                archive.writestr(member, bytes_)
        monkeypatch.setattr(_files, "read_arrays", lambda file: pytest.fail("read"))
        sentence = (r"' is not a valid run: words does not fit a run of 3 bodies and 2 samples, got an array of shape "
                    r"\(2,\) and kind 'f'\." if name == "words" else
                    r"`path` must be a complete file written by Trajectory\.save, got '.*bomb\.npz'\.")
        with pytest.raises(ValueError, match=sentence):
            gr.Trajectory.load(tmp_path / "bomb.npz")


def batch(seeds, files, tmp_path):
    """What became of edited files, by kind of edit."""
    fates, ends = {}, {}
    for kind, name in {ALL[seed % len(ALL)] for seed in seeds}:
        whole = (files / f"{kind}_{name}.npz").read_bytes()
        edited_files.fate(kind, name, whole, tmp_path / "run.npz", ends)
    for seed in seeds:
        kind, name = ALL[seed % len(ALL)]
        how, data = edited_files.edited(np.random.default_rng([8, seed]), files / f"{kind}_{name}.npz")
        end, _ = edited_files.fate(kind, name, data, tmp_path / "run.npz", ends)
        assert end != "another run" or how.endswith("signed"), seed
        fates[how, end] = fates.get((how, end), 0) + 1
    return fates


@pytest.mark.rotating
@pytest.mark.parametrize("third", range(3))
def test_edited_files_are_refused_in_a_sentence_or_are_the_same_run(third, files, tmp_path):
    quick = {("hard", name) for name in saved_scenes.HARD} | {("soft", name) for name in ("thermal", "ring", "pendula")}
    seeds = [seed for seed in range(900) if ALL[seed % len(ALL)] in quick]
    fates = batch(seeds[third:120:3], files, tmp_path)
    assert sum(fates.values()) == 40
    assert sum(n for (_, end), n in fates.items() if end.startswith("refused")) > 26


@pytest.mark.soak
@pytest.mark.parametrize("first", range(0, 10_000, 500))
def test_ten_thousand_edited_files(first, files, tmp_path):
    batch(range(first, first + 500), files, tmp_path)
