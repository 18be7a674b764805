"""The file of a sweep: one interrupted, or of an earlier release, goes on; one that was changed is refused."""

import json
from pathlib import Path

import numpy as np
import pytest

import granular as gr
from granular.studies.sweeps import schedule
from granular.studies.sweeps.results import STATUS_CODES

xr = pytest.importorskip("xarray")


@pytest.mark.rotating
def test_an_interrupted_sweep_goes_on(tmp_path, monkeypatch):
    monkeypatch.setattr(schedule, "MAX_BATCH_SECONDS", 0.0)  # batches of one cell, whatever the machine's speed
    over, file = ["restitution=0.3:1:20", "gap=1e-6:1e-3:20:log"], tmp_path / "map.nc"
    seen = []

    def watch(reached, done):
        seen.append((reached, done))
        if done > 100 and len(seen) > 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        gr.sweep("three-balls", over, save=file, on_progress=watch)
    stopped = xr.load_dataset(file)
    left = int((stopped["status"] == STATUS_CODES["not_run"]).sum())
    assert 0 < left < 400
    again = []
    data = gr.sweep("three-balls", over, save=file, on_progress=lambda *so_far: again.append(so_far))
    assert again[0] == (pytest.approx(1.0 / left), 400 - left + 1)
    assert again[-1] == (1.0, 400)
    assert [reached for reached, _ in seen] == [done / 400 for _, done in seen]
    assert data.identical(gr.sweep("three-balls", over))
    stored = xr.load_dataset(file)
    assert all(np.array_equal(stored[name].values, data[name].values, equal_nan=True) for name in data)
    with pytest.raises(ValueError, match=r"must be a new file or a file of the same sweep, got .* of another sweep"):
        gr.sweep("three-balls", over, save=file, height=0.7)


def test_a_sweep_of_the_release_before_goes_on_and_a_later_one_is_refused(tmp_path):
    file, over = tmp_path / "older.nc", {"gap": [1e-5, 1e-4], "restitution": [0.5, 0.9]}
    file.write_bytes((Path(__file__).parents[1] / "reference" / "older_sweep.nc").read_bytes())
    solved = []
    data = gr.sweep("three-balls", over, save=file, on_progress=lambda *so_far: solved.append(so_far))
    assert not solved
    np.testing.assert_allclose(data["v_rel"], gr.sweep("three-balls", over)["v_rel"], rtol=1e-12)
    later = data.assign_attrs(provenance=json.dumps({"format": 99}))
    later.to_netcdf(file, engine="netcdf4")
    with pytest.raises(ValueError, match=r"The format of .*older\.nc must be an integer from 1 to 3, got 99\. "
                                         r"Read it with a later version of granular\."):
        gr.sweep("three-balls", over, save=file)


def test_a_map_without_an_answer_and_without_a_reason_is_refused(tmp_path):
    file = tmp_path / "map.nc"
    data = gr.sweep("three-balls", "gap=1e-5,1e-4", save=file).load()
    data["status"][:] = STATUS_CODES["misuse"]
    data.to_netcdf(file, engine="netcdf4")
    with pytest.raises(ValueError, match=r"All cells of PosixPath\('.*map\.nc'\) were refused, and the file does "
                                         r"not contain a reason\. Remove the file\."):
        gr.sweep("three-balls", "gap=1e-5,1e-4", save=file)


def test_a_map_whose_file_was_changed_is_refused_in_a_sentence(tmp_path):
    file, over = tmp_path / "map.nc", {"gap": [1e-5, 1e-4], "restitution": [0.5, 0.9]}
    data = gr.sweep("three-balls", over, save=file, results=["v_rel"]).load()
    for other, sentence in [
        (data.drop_vars("v_rel"),
            r"`save` must be a file of a sweep of shape \(2, 2\), got '.*map\.nc' without a matching v_rel\. Remove "
            r"the file\."),
        (data.assign(v_rel=data["v_rel"].astype(str)),
            r"`save` must be a file of a sweep of shape \(2, 2\), got '.*map\.nc' without a matching v_rel\. Remove "
            r"the file\."),
        (data.assign(v_rel=data["v_rel"].mean("restitution")),
            r"`save` must be a file of a sweep of shape \(2, 2\), got '.*map\.nc' without a matching v_rel\. Remove "
            r"the file\."),
        (data.assign(status=data["status"] + 50),
            "`save` must be a file whose status is one of not_run, time, until, quiet, resting, collapse, "
            r"disturbed, max_events, unstable, broken, bounded, misuse, got '.*map\.nc' with other values\. Remove the "
            r"file\."),
        (data.assign_attrs(provenance="[["), r"The format of .*map\.nc must be an integer from 1 to 3, got None\. "
                                             "The file is damaged"),
        (data.assign_attrs(provenance="[1]"), r"The format of .*map\.nc must be an integer from 1 to 3, got None\. "
                                              "The file is damaged"),
    ]:
        other.to_netcdf(file, engine="netcdf4")
        with pytest.raises(ValueError, match=sentence):
            gr.sweep("three-balls", over, save=file, results=["v_rel"])
    with pytest.raises(TypeError, match="`save` must be the name of a file, got 5"):
        gr.sweep("three-balls", over, save=5, results=["v_rel"])


def test_a_damaged_map_is_refused_in_a_sentence_and_kept(tmp_path):
    """Cut off, empty, of another kind, or with one changed byte: numbers are right, or the file is refused."""
    file, over = tmp_path / "map.nc", {"gap": [1e-5, 1e-4], "restitution": [0.5, 0.9]}
    right = gr.sweep("three-balls", over, save=file, results=["v_rel"]).load()
    whole, number = file.read_bytes(), right["v_rel"].values.tobytes()[:8]
    assert whole.count(number) == 1
    damaged = [b"", b"hello", whole[: len(whole) // 2], whole[:-1]]
    for k in range(8):
        at = whole.index(number) + k
        damaged.append(whole[:at] + bytes([whole[at] ^ 1]) + whole[at + 1 :])
    for data in damaged:
        file.write_bytes(data)
        with pytest.raises(ValueError, match=r"^`save` must be a new file or a complete file of a sweep, got '.*\.nc' "
                                             r"\(.*\)\. Give another name, or remove the file\.$"):
            gr.sweep("three-balls", over, save=file, results=["v_rel"])
        assert file.read_bytes() == data
    file.write_bytes(whole)
    assert gr.sweep("three-balls", over, save=file, results=["v_rel"]).equals(right)


@pytest.mark.rotating
def test_a_map_beside_a_driven_wall_of_the_release_before_goes_on(tmp_path):
    """Its question called the wall by the place of its class."""
    scene = gr.scenes.bouncing_ball(plate=gr.walls.Sine(1e-3, 20.0))
    case, file = gr.Case(scene, None, gr.ConstantRestitution(0.9), t_end=0.5), tmp_path / "map.nc"
    data = gr.sweep(case, {"velocity[1]": [0.0, 0.1]}, save=file, results=["hard_contacts"])
    assert '"sine"' in data.attrs["question"]
    older = data.attrs["question"].replace('"sine"', '"granular.walls.sine:Sine"')
    data.assign_attrs(question=older).to_netcdf(file, engine="netcdf4")
    solved = []
    gr.sweep(case, {"velocity[1]": [0.0, 0.1]}, save=file, results=["hard_contacts"],
             on_progress=lambda *so_far: solved.append(so_far))
    assert not solved
