"""Contacts in a file while a run goes on: the rows of a log in memory, whole blocks whatever happens."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

import granular as gr
from granular.app.cli import main
from granular.run import contact_log

GAS, DROP = gr.scenes.gas(n=50), gr.scenes.three_balls()
SOFT, LOSSY, DEAD = gr.LinearDashpot(1e6, 10.0), gr.ConstantRestitution(0.9), gr.ConstantRestitution(0.1)
RUNS = {
    "hard": lambda **given: gr.edmd.simulate(GAS, LOSSY, t_end=3.0, **given),
    "hard, compiled": lambda **given: gr.edmd.simulate(GAS, LOSSY, t_end=3.0, engine="compiled", **given),
    "closer look": lambda **given: gr.edmd.simulate(DROP, DEAD, max_events=30, **given),
    "soft": lambda **given: gr.md.simulate(DROP, SOFT, t_end=0.5, **given),
    "isolated": lambda **given: gr.md.simulate(GAS, SOFT, t_end=0.5, **given),
    "one open": lambda **given: gr.md.simulate(DROP, SOFT, t_end=0.32, **given),
    "fixed steps": lambda **given: gr.md.simulate(DROP, SOFT, t_end=0.5, method="verlet", dt=1e-5, **given),
    "rows about contacts": lambda **given: gr.edmd.simulate(GAS, LOSSY, t_end=3.0, samples="contacts", **given),
    "none": lambda **given: gr.md.simulate(DROP, SOFT, t_end=0.01, **given),
}


def in_order(rows):
    return rows[np.lexsort((rows["pair"], rows["t_begin"]))].tobytes()


@pytest.mark.parametrize("name", RUNS)
def test_the_file_has_the_rows_of_a_log_in_memory_and_the_run_is_the_same(name, tmp_path) -> None:
    if name == "hard, compiled":
        pytest.importorskip("numba")
    path = tmp_path / "run.npy"
    told, also = [], []
    kept = RUNS[name](on_event=told.append)
    streamed = RUNS[name](log=path, on_event=also.append)
    assert len(streamed.contacts) == 0
    assert repr(streamed.stats) == repr({**kept.stats, "log": str(path)})  # some are nan
    assert streamed.gap.tobytes() == kept.gap.tobytes()
    assert np.array(told).tobytes() == np.array(also).tobytes()
    parts = list(streamed.contact_batches(7))
    assert [len(part) for part in parts] == [7] * (len(kept.contacts) // 7) + [len(kept.contacts) % 7] * (
        len(kept.contacts) % 7 > 0)
    found = np.concatenate([*parts, kept.contacts[:0]])
    assert found.dtype == kept.contacts.dtype
    assert in_order(found) == in_order(kept.contacts)
    assert np.concatenate([*kept.contact_batches(3), kept.contacts[:0]]).tobytes() == kept.contacts.tobytes()
    assert len(np.load(path)) == len(kept.contacts)


def test_a_disk_that_is_full_ends_the_run_and_keeps_what_was_written(tmp_path, monkeypatch) -> None:
    path, real = tmp_path / "run.npy", contact_log.LogFile.extend

    class Full:
        """A file on a disk with room for some rows."""

        def __init__(self, file) -> None:
            self.file, self.seek, self.tell = file, file.seek, file.tell
            self.close, self.truncate = file.close, file.truncate

        def write(self, data) -> int:
            room = 2048 - self.file.tell()
            if room <= 0:
                raise OSError(28, "No space left on device")
            return self.file.write(data[:room])

    def extend(self, blocks):
        self.file = self.file if isinstance(self.file, Full) else Full(self.file)
        return real(self, (block[i : i + 3] for block in blocks for i in range(0, len(block), 3)))

    monkeypatch.setattr(contact_log.LogFile, "extend", extend)
    with pytest.raises(OSError, match=r"The log '.*run\.npy' cannot grow \(No space left on device\), so the run "
                                      r"ends here\. The first 30 contacts are in the file\."):
        RUNS["hard"](log=path)
    found = np.load(path)
    assert 24 <= len(found) <= 33
    assert len(found) % 3 == 0
    np.testing.assert_array_equal(found["t_begin"], RUNS["hard"]().contacts["t_begin"][: len(found)])


ENDLESS = """import sys; import granular as gr
gr.edmd.simulate(gr.scenes.gas(n=50), gr.ConstantRestitution(1.0), max_events=10**9, engine="sorted", log=sys.argv[1])
"""


@pytest.mark.parametrize("more", [1, *(pytest.param(k, marks=pytest.mark.soak) for k in range(2, 21))])
def test_what_was_written_before_a_kill_is_read(more, tmp_path) -> None:
    path = tmp_path / "run.npy"
    process = subprocess.Popen([sys.executable, "-c", ENDLESS, str(path)])
    try:
        size, blocks = 0, 0
        while blocks < 1 + more % 4:
            assert process.poll() is None
            time.sleep(0.01 + 0.0007 * more)
            now = os.path.getsize(path) if path.exists() else 0
            blocks, size = blocks + (now > max(size, 1000)), now  # a head alone is shorter
    finally:
        process.send_signal(getattr(signal, "SIGKILL", signal.SIGTERM))
        process.wait()
    found = np.load(path, mmap_mode="r")
    assert len(found) > 0
    onset = gr.edmd.simulate(gr.scenes.gas(n=50), gr.ConstantRestitution(1.0), max_events=500).contacts["t_begin"]
    np.testing.assert_array_equal(found["t_begin"][:500], onset[: len(found)])
    assert (np.diff(found["t_begin"]) >= 0.0).all()
    assert len(found) * found.dtype.itemsize <= os.path.getsize(path)


def test_mistakes_are_told_and_nothing_is_written_over(tmp_path, capsys) -> None:
    there = tmp_path / "there.npy"
    there.write_bytes(b"kept")
    with pytest.raises(FileExistsError, match=r"`log` must be a new file, got '.*there\.npy'\. Give another name, "
                                              r"or remove the file\."):
        RUNS["hard"](log=there)
    assert there.read_bytes() == b"kept"
    with pytest.raises(ValueError, match=r"`log` must be True, False or the name of a file that ends in \.npy, got "
                                         r"'.*run\.txt'\."):
        RUNS["hard"](log=tmp_path / "run.txt")
    with pytest.raises(OSError, match=r"`log` must be writable, got '.*run\.npy' \(No such file"):
        RUNS["hard"](log=tmp_path / "no" / "run.npy")
    with pytest.raises(TypeError, match="`log` must be True or False, got 3"):
        RUNS["hard"](log=3)
    run = RUNS["hard"](log=tmp_path / "run.npy")
    with pytest.raises(ValueError, match=r"`size` must be an integer of at least 1, got 0\."):
        run.contact_batches(0)
    for bad, sentence in (
        (b"nothing at all", r"`log` must be a contact log, got '.*run\.npy' \(the magic string is not correct"),
        (b"", r"`log` must be a contact log, got '.*run\.npy' \(EOF"),
        (None, "Its columns pair and t_begin are missing"),
    ):
        (tmp_path / "run.npy").write_bytes(bad) if bad is not None else np.save(tmp_path / "run.npy", np.zeros(3))
        with pytest.raises(ValueError, match=sentence):
            run.contact_batches()
    (tmp_path / "run.npy").unlink()
    with pytest.raises(FileNotFoundError):
        run.contact_batches()
    assert main(["run", "three-balls", "--engine", "edmd", "--log", str(tmp_path / "c.npy")]) == 0
    capsys.readouterr()
    assert len(np.load(tmp_path / "c.npy")) == 2
    assert main(["run", "three-balls", "--log", str(tmp_path / "c.npy")]) == 2
    assert "c.npy'. Give another name, or remove the file." in capsys.readouterr().err


@pytest.mark.parametrize("suffix", [".npz", ".nc"])
@pytest.mark.parametrize("name", RUNS)
def test_a_saved_run_still_finds_its_contacts(name, suffix, tmp_path):
    if name == "hard, compiled":
        pytest.importorskip("numba")
    if suffix == ".nc":
        pytest.importorskip("netCDF4")
    run = RUNS[name](log=tmp_path / "run.npy")
    run.save(tmp_path / f"saved{suffix}")
    again = gr.load(tmp_path / f"saved{suffix}")
    assert again.stats["log"] == str(tmp_path / "run.npy")
    assert len(run.contacts) == len(again.contacts) == 0
    rows = [np.concatenate([*each.contact_batches(), each.contacts[:0]]).tobytes() for each in (run, again)]
    assert rows[0] == rows[1]
    assert (rows[0] == b"") is (name == "none")
