"""Files are written whole or not at all; links, devices and pipes are written into, never replaced."""

import json
import os
import stat
import subprocess
import sys
import threading

import numpy as np
import pytest

import granular as gr

SCENE = gr.scenes.bouncing_ball()


@pytest.fixture(scope="module")
def report():
    return gr.compare(SCENE, gr.LinearDashpot(1e6, 10.0), t_end=0.5)


def test_a_link_stays_a_link_and_its_file_keeps_its_mode(tmp_path, report):
    real, link = tmp_path / "real.json", tmp_path / "link.json"
    real.write_text("old")
    real.chmod(0o640)
    link.symlink_to(real.name)
    report.to_json(link)
    assert link.is_symlink()
    assert json.loads(real.read_text())["verdict"] == report.verdict
    assert stat.S_IMODE(real.stat().st_mode) == 0o640
    assert sorted(os.listdir(tmp_path)) == ["link.json", "real.json"]


def test_a_new_file_has_the_usual_mode(tmp_path, report):
    before = os.umask(0o027)
    try:
        report.to_json(tmp_path / "new")
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / "new").stat().st_mode) == 0o640


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="the system has no named pipes")
def test_a_pipe_is_written_into(tmp_path, report):
    pipe, got = tmp_path / "pipe", []
    os.mkfifo(pipe)
    reader = threading.Thread(target=lambda: got.append(pipe.read_text()), daemon=True)
    reader.start()
    report.to_json(pipe)
    reader.join(10.0)
    assert json.loads(got[0])["verdict"] == report.verdict
    assert stat.S_ISFIFO(pipe.stat().st_mode)


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="the system has no /dev/full")
def test_devices_are_written_into_and_stay(report):
    gr.edmd.simulate(SCENE, gr.ConstantRestitution(0.5)).save("/dev/null")
    with pytest.raises(OSError, match=r"The output path must be writable, got '/dev/full' \(No space left on "
                                      r"device\)\."):
        report.to_json("/dev/full")
    for device in ("/dev/null", "/dev/full"):
        assert stat.S_ISCHR(os.stat(device).st_mode)


@pytest.mark.rotating
@pytest.mark.skipif(not os.path.exists("/dev/stdout"), reason="the system has no /dev/stdout")
@pytest.mark.parametrize(("name", "redirected"), [("-", False), ("/dev/stdout", False), ("/dev/stdout", True)])
def test_json_on_standard_output_is_all_there_is_on_it(tmp_path, name, redirected):
    command = [sys.executable, "-m", "granular", "compare", "bouncing-ball", "--json", name]
    with open(tmp_path / "out", "w+") as file:
        out = file if redirected else subprocess.PIPE
        done = subprocess.run(command, stdout=out, stderr=subprocess.PIPE, text=True, check=True)
    text = (tmp_path / "out").read_text() if redirected else done.stdout
    assert json.loads(text)["verdict"] in done.stderr


@pytest.mark.parametrize(("name", "ending"), [("picture", "''"), ("picture.foo", "'foo'")])
def test_a_picture_without_a_format_is_refused_and_leaves_nothing(tmp_path, report, name, ending, monkeypatch):
    pytest.importorskip("matplotlib")
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ValueError, match=rf"The suffix of {name} must be one of .*png.*, got {ending}\."):
        report.plot(name)
    assert os.listdir(tmp_path) == []


def test_what_fails_under_way_leaves_the_old_file_and_nothing_else(tmp_path, monkeypatch):
    (tmp_path / "old.npz").write_text("old")

    def half(file, **arrays):
        file.write(b"half")
        raise KeyboardInterrupt

    monkeypatch.setattr(np, "savez", half)
    with pytest.raises(KeyboardInterrupt):
        gr.edmd.simulate(SCENE, gr.ConstantRestitution(0.5)).save(tmp_path / "old.npz")
    assert os.listdir(tmp_path) == ["old.npz"]
    assert (tmp_path / "old.npz").read_text() == "old"


@pytest.mark.parametrize("path", ["a.txt", "a", "", 5, None, b"a.npz", "a\0.npz"])
def test_the_ending_tells_the_format_of_a_run(tmp_path, monkeypatch, path):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ValueError, match=r"`path` must be the name of a file that ends in \.npz.*, got .*"):
        gr.edmd.simulate(SCENE, gr.ConstantRestitution(0.5)).save(path)
    assert os.listdir(tmp_path) == []


def test_a_full_disk_is_called_so_whatever_netcdf_says(tmp_path):
    xarray, resource = pytest.importorskip("xarray"), pytest.importorskip("resource")
    from granular.studies.sweeps import plan

    plan.write(xarray.Dataset({"a": ("x", np.zeros(3))}), tmp_path / "small.nc")
    data, limits = xarray.Dataset({"a": ("x", np.random.default_rng(1).random(200_000))}), resource.RLIMIT_FSIZE
    before = resource.getrlimit(limits)
    resource.setrlimit(limits, (1_000_000, before[1]))  # as a quota does, with words of its own
    try:
        with pytest.raises(OSError, match=r"The output path must be writable, got '.*large\.nc' \(File too large\)\."):
            plan.write(data, tmp_path / "large.nc")
    finally:
        resource.setrlimit(limits, before)
    assert os.listdir(tmp_path) == ["small.nc"]


def test_threads_that_write_leave_the_mask_of_the_process_alone(tmp_path, report):
    mask = os.umask(0o022)
    os.umask(mask)
    threads = [threading.Thread(target=report.to_json, args=(tmp_path / str(i % 3),)) for i in range(24)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert os.umask(mask) == mask
    assert sorted(os.listdir(tmp_path)) == ["0", "1", "2"]


def test_a_run_comes_back_from_a_file_with_an_equal_scene(tmp_path):
    run = gr.edmd.simulate(SCENE, gr.ConstantRestitution(0.5))
    run.save(tmp_path / "run.npz")
    back = gr.Trajectory.load(tmp_path / "run.npz")
    assert back.scene == run.scene
    assert np.array_equal(back.position, run.position)


def test_arrays_in_any_order_and_numbers_of_any_type_are_saved_and_loaded(tmp_path):
    scene, path = gr.scenes.three_balls(), tmp_path / "run.npz"
    hard = gr.edmd.simulate(scene, gr.ConstantRestitution(0.7), t_end=1.0)
    hard.save(path)
    with np.load(path) as file:
        arrays = {name: np.asfortranarray(array) if array.ndim > 1 else array for name, array in file.items()}
    np.savez(path, **arrays)
    assert gr.Trajectory.load(path).contacts.tobytes() == hard.contacts.tobytes()
    gr.md.simulate(scene, gr.LinearDashpot(np.int64(12_500_000), np.float32(2.0)), t_end=0.1, engine="plain").save(path)
    assert gr.Trajectory.load(path).law[0] == gr.LinearDashpot(1.25e7, 2.0)
