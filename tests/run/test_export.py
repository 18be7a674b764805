"""Runs in files and tables that others read, and back."""

import io
import math
import sys

import numpy as np
import pytest

import granular as gr
from granular.app.cli import main
from tests.helpers.saved_scenes import FLOOR, HARD, LINE, RING, SOFT

xarray, pandas = pytest.importorskip("xarray"), pytest.importorskip("pandas")


def solved(kind, name, **options):
    scene, physics, middle, _, given = (HARD if kind == "hard" else SOFT)[name]
    engine = gr.edmd if kind == "hard" else gr.md
    return engine.simulate(scene, physics, t_end=middle, **given, **options)


def resumed(run, physics, end):
    return (gr.md if run.rule is None else gr.edmd).resume(run, t_end=end)


@pytest.mark.rotating
@pytest.mark.parametrize(("kind", "name"), [("hard", n) for n in HARD] + [("soft", n) for n in SOFT])
@pytest.mark.usefixtures("interpreted")
def test_npz_and_netcdf_bring_back_the_same_bits_and_go_on_alike(kind, name, tmp_path):
    rng = np.random.default_rng(len(name))
    many = (HARD if kind == "hard" else SOFT)[name][2] is not None
    samples = [None, int(rng.integers(2, 40)), "contacts"][rng.integers(3)] if many else None
    run = solved(kind, name, samples=samples, log=bool(rng.integers(4)))
    own = {"law": run.law[0]} if name == "own-law" else {"rule": run.rule[0]} if name == "own-rule" else {}
    back = []
    for ending in ("npz", "nc"):
        run.save(tmp_path / f"run.{ending}", compressed=bool(rng.integers(2)))
        back.append(gr.load(tmp_path / f"run.{ending}", **own))
    for other in back:
        for part in ("time", "position", "velocity", "gap", "force", "ledger", "contacts"):
            one, two = getattr(run, part), getattr(other, part)
            assert (one is two is None) or (one.dtype == two.dtype and one.tobytes() == two.tobytes()), part
        assert (other.status, other.message) == (run.status, run.message)
        assert other.state.keys() == run.state.keys() or not run.state
    end = (HARD if kind == "hard" else SOFT)[name][3]
    if run.state and end is not None and run.status is gr.Status.time:
        one, two = (resumed(other, None, end) for other in back)
        assert one.contacts.tobytes() == two.contacts.tobytes()
        assert one.velocity.tobytes() == two.velocity.tobytes()


RUN = gr.md.simulate(FLOOR, gr.LinearDashpot(1e5, 300.0), t_end=0.4, samples=9)
HARD_RUN = gr.edmd.simulate(FLOOR, gr.ConstantRestitution(0.9), t_end=0.4, samples=9)


def test_data_set_names_units_and_comes_from():
    data = RUN.to_xarray()
    assert data.position.dims == ("time", "body")
    assert data.v_in.dims == ("contact", "side")
    assert {data[name].attrs["units"] for name in data.data_vars} == {"m", "m/s", "N", "1", "s", "N s"}
    assert data.attrs["law"] == repr(RUN.law[0])
    assert "granular" in data.attrs["versions"]
    assert "command" in data.attrs
    assert np.array_equal(data.contact_pair, RUN.contacts["pair"])
    assert "force" not in HARD_RUN.to_xarray()


def test_csv_has_all_digits(tmp_path):
    for k, run in enumerate((RUN, HARD_RUN, gr.edmd.simulate(FLOOR, gr.ConstantRestitution(0.9), t_end=0.0))):
        run.save(tmp_path / f"{k}.csv")
        text = (tmp_path / f"{k}.csv").read_text()
        names, *lines = [line for line in text.splitlines() if not line.startswith("#")]
        read = np.loadtxt(io.StringIO("\n".join(lines)), delimiter=",", ndmin=2) if lines else np.zeros((0, 11))
        table = dict(zip(names.split(","), read.T, strict=True))
        assert text.startswith("# scene: Scene(")
        assert "\n# units: SI\n" in text
        assert len(read) == len(run.contacts)
        for name in ("t_begin", "t_end", "impulse", "force_max"):
            assert np.array_equal(table[name], run.contacts[name], equal_nan=True)
        assert np.array_equal(table["v_in_lower"], run.contacts["v_in"][:, 0])
    rows = RUN.to_frame("samples")
    assert np.array_equal(rows.velocity_2, RUN.velocity[:, 2])
    assert np.array_equal(rows.force_0, RUN.force[:, 0])


@pytest.mark.parametrize("scene", [FLOOR, LINE, RING])
def test_extended_xyz_has_all_digits(scene, tmp_path):
    run = gr.edmd.simulate(scene, gr.ConstantRestitution(0.9), t_end=0.05, samples=5)
    run.save(tmp_path / "run.extxyz")
    lines, balls = (tmp_path / "run.extxyz").read_text().splitlines(), ~scene.is_wall
    size = int(balls.sum()) + 2
    assert len(lines) == 5 * size
    for k in range(5):
        count, head, *rows = lines[k * size : (k + 1) * size]
        read = np.array([row.split()[1:] for row in rows], float)
        assert int(count) == size - 2
        assert f"Time={float(run.time[k])!r}" in head
        assert np.array_equal(read[:, 0], run.position[k, balls])
        assert np.array_equal(read[:, 3], run.velocity[k, balls])
        assert np.array_equal(read[:, 6:].T, [scene.radius[balls], scene.mass[balls]])
        assert ('pbc="T F F"' in head) is scene.ring
        assert head.count('"') % 2 == 0
        assert ("floor=" in head) is math.isinf(scene.mass[0])


@pytest.mark.soak
@pytest.mark.parametrize("scene", [FLOOR, LINE, RING])
def test_ase_reads_extended_xyz(scene, tmp_path):
    ase = pytest.importorskip("ase.io")
    run = gr.edmd.simulate(scene, gr.ConstantRestitution(0.9), t_end=0.05, samples=5)
    run.save(tmp_path / "run.extxyz")
    frames, balls = ase.read(tmp_path / "run.extxyz", index=":", format="extxyz"), ~scene.is_wall
    assert len(frames) == len(run.time)
    for k, frame in enumerate(frames):
        assert frame.info["Time"] == run.time[k]
        assert frame.pbc.tolist() == [scene.ring, False, False]
        assert np.array_equal(frame.positions[:, 0], run.position[k, balls])
        assert np.array_equal(frame.arrays["velo"][:, 0], run.velocity[k, balls])
        assert not frame.positions[:, 1:].any()
        assert np.array_equal(frame.arrays["radius"], scene.radius[balls])
        assert np.array_equal(frame.arrays["mass"], scene.mass[balls])


@pytest.mark.parametrize("name", ["run.txt", "run", "run.npz.bak", "run\0.nc"])
def test_an_unknown_ending_is_refused(name, tmp_path):
    with pytest.raises(ValueError, match=r"`path` must be the name of a file that ends in \.npz, \.nc, \.csv, "
                                         r"\.extxyz, got '.*"):
        RUN.save(str(tmp_path / name))
    assert not list(tmp_path.iterdir())


def test_files_of_others_and_changed_ones_are_refused(tmp_path):
    path = tmp_path / "run.nc"
    xarray.Dataset({"a": ("x", [1.0])}).to_netcdf(path)
    with pytest.raises(ValueError, match=r"`path` must be a complete file written by Trajectory\.save, got "
                                         r"'.*run\.nc'\."):
        gr.load(path)
    path.write_bytes(b"no netCDF")
    with pytest.raises(ValueError, match=r"`path` must be a complete file written by Trajectory\.save, got "
                                         r"'.*run\.nc'\."):
        gr.load(path)
    RUN.save(path)
    with xarray.load_dataset(path) as data:
        data.velocity[3, 1] += 1.0
        data.to_netcdf(tmp_path / "changed.nc")
    with pytest.raises(ValueError, match=r"The file '.*changed\.nc' is not a valid run: its numbers do not match "
                                         r"its digest\. The file was edited after it was saved\."):
        gr.load(tmp_path / "changed.nc")


def test_missing_packages_are_named(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(ImportError, match=r"to_frame requires pandas, which is not installed\. Install it with: "
                                          r"pip install 'granular-collisions\[sweep\]'"):
        RUN.to_frame()
    with pytest.raises(ImportError, match=r"a file that ends in \.csv requires pandas, which is not installed\. "
                                          r"Install it with: pip install 'granular-collisions\[sweep\]'"):
        RUN.save(tmp_path / "run.csv")


ENGINES = {
    "hard": lambda scene, **o: gr.edmd.simulate(scene, gr.ConstantRestitution(0.7), **o),
    "located": lambda scene, **o: gr.md.simulate(scene, gr.LinearDashpot(1e5, 100.0), **o),
    "verlet": lambda scene, **o: gr.md.simulate(scene, gr.LinearDashpot(1e5, 100.0), method="verlet", **o),
    "rk4": lambda scene, **o: gr.md.simulate(scene, gr.Hertz(1e6), method="rk4", **o),
}


@pytest.mark.rotating
@pytest.mark.parametrize("engine", ENGINES)
def test_rows_whose_times_the_run_tells(engine):
    told, end = [], gr.until.contact(1, 2)
    plain = ENGINES[engine](FLOOR, until=end, t_end=1.0)
    assert plain.status is gr.Status.until
    known = ENGINES[engine](FLOOR, until=end, t_end=1.0, samples=np.linspace(0.0, plain.time[-1], 7))
    run = ENGINES[engine](FLOOR, until=end, samples=7, on_event=lambda row: told.append(row.copy()))
    about = ENGINES[engine](FLOOR, until=end, samples="contacts", log=False)
    assert len(run.time) == 7
    assert len(told) == len(plain.contacts)
    assert not len(about.contacts)
    for part in ("time", "position", "velocity", "gap"):
        rows = getattr(run, part)
        assert rows[:-1].tobytes() == getattr(known, part)[:-1].tobytes()
        assert rows[-1].tobytes() == getattr(plain, part)[-1].tobytes()  # its end, not a sample at that instant
    assert run.contacts.tobytes() == plain.contacts.tobytes() == known.contacts.tobytes()
    log = plain.contacts
    assert np.isin([*log["t_begin"], *log["t_end"][~np.isnan(log["t_end"])]], about.time).all()
    for row in log[~np.isnan(log["t_end"])]:
        inside = (about.time > row["t_begin"]) & (about.time < row["t_end"])
        before = about.time[np.searchsorted(about.time, row["t_begin"]) - 1]
        assert inside.sum() >= 7 if engine != "hard" else before == np.nextafter(row["t_begin"], 0.0)


def test_rows_about_contacts_of_a_run_that_goes_on():
    for engine, physics in ((gr.edmd, gr.ConstantRestitution(0.9)), (gr.md, gr.LinearDashpot(1e5, 100.0))):
        half = engine.simulate(FLOOR, physics, t_end=0.2)
        run, plain = (engine.resume(half, t_end=0.6, samples=samples) for samples in ("contacts", None))
        assert run.contacts.tobytes() == plain.contacts.tobytes()
        assert run.time[0] >= 0.2
        assert len(run.time) > 2 * len(run.contacts)


def test_rows_that_cannot_be_told(monkeypatch):
    with pytest.raises(ValueError, match="`samples` must be one of contacts, got 'impacts'"):
        ENGINES["hard"](FLOOR, t_end=1.0, samples="impacts")
    monkeypatch.setattr("granular._engine.check.MAX_REQUESTED_COUNT", 20)
    with pytest.raises(ValueError, match="`samples` must give at most 20 samples, got 'contacts' with 183 "
                                         r"contacts\. Give a number of samples, or stop earlier with t_end= or "
                                         r"until=\."):
        ENGINES["hard"](FLOOR, t_end=1.0, samples="contacts")


def test_the_command_keeps_rows_about_contacts(tmp_path, capsys) -> None:
    path = tmp_path / "run.npz"
    assert main(["run", "three-balls", "--samples", "contacts", "--save", str(path)]) == 0
    assert main(["run", "three-balls", "--samples", "words"]) == 2
    assert "`samples` must be one of contacts, got 'words'." in capsys.readouterr().err
    run = gr.load(path)
    assert set(run.contacts["t_begin"]) <= set(run.time)
