"""Recordings: files as phyphox and Tracker export them, and velocities from positions."""

import csv
import math

import numpy as np
import pytest

import granular as gr

BALL = gr.Scene([math.inf, 0.05], [0.0, 0.02], [1.0], [0.0, 0.0], gravity=9.81)
FRAMES = np.arange(61) / 30.0
RULE = gr.ConstantRestitution(0.8)

FILES = {
    "phyphox": ('"Time (s)","Height (cm)"\n0.000000000E0,1.000000000E2\n5.000000000E-2,9.877000000E1\n',
                {"Time": [0.0, 0.05], "Height": [1.0, 0.9877]}),
    "phyphox, tabs and decimal commas": ('"Zeit (ms)"\t"Höhe [m]"\n0,0E0\t1,0E0\n5,0E1\t9,877E-1\n',
                                         {"Zeit": [0.0, 0.05], "Höhe": [1.0, 0.9877]}),
    "phyphox, semicolons": ('\ufeff"Time (s)";"Speed (cm/s)"\r\n0,5;-10\r\n1;\r\n',
                            {"Time": [0.5, 1.0], "Speed": [-0.1, math.nan]}),
    "tracker": ("t\ty\tx\n0.0\t1.0371\t0.0034\n0.0333\t\t-7.5E-4\n0.0667\t1.0106\n",
                {"t": [0.0, 0.0333, 0.0667], "y": [1.0371, math.nan, 1.0106], "x": [0.0034, -7.5e-4, math.nan]}),
    "tracker, with its title": ("mass A\nt;y / mm;x / mm;\n0,0;1037,1;3,4;\n0,5;1034,4;NaN;\n",
                                {"t": [0.0, 0.5], "y": [1.0371, 1.0344], "x": [0.0034, math.nan]}),
    "stopwatch, one column": ("Time (s)\n0,46\n0,37\n0,29\n", {"Time": [0.46, 0.37, 0.29]}),
    "stopwatch, one row": ("Time 1 (s)\tTime 2 (s)\n0.46\t0.37\n", {"Time 1": [0.46], "Time 2": [0.37]}),
    "units with a slash": ("t / s;v / cm/s;dy/dt / km/h;a / m/s²;dx/dt / (mm/s)\n0;10;36;5;1\n",
                           {"t": [0.0], "v": [0.1], "dy/dt": [10.0], "a": [5.0], "dx/dt": [0.001]}),
    "rows without numbers": ('"Interval (ms)"\n460\nNaN\n""\n298\n', {"Interval": [0.46, math.nan, 0.298]}),
    "rows of a spreadsheet": ("t;y (cm);\n0;1;\n;;\n1;2;\n;;\n;;\n", {"t": [0.0, 1.0], "y": [0.01, 0.02]}),
    "quoted decimal commas": ('t / min,v / (km/h)\n"0,5","36"\n"1","-3,6"\n', {"t": [30.0, 60.0], "v": [10.0, -1.0]}),
}


@pytest.mark.parametrize("name", FILES)
def test_a_file_is_read_in_si_units(name, tmp_path):
    text, expected = FILES[name]
    (tmp_path / "file.csv").write_text(text, encoding="utf-8")
    found = gr.read_recording(tmp_path / "file.csv")
    assert list(found) == list(expected)
    for title, values in expected.items():
        assert found[title] == pytest.approx(values, rel=1e-14, nan_ok=True)
        assert not found[title].flags.writeable


def test_the_encoding_of_western_europe_is_read(tmp_path):
    (tmp_path / "file.csv").write_bytes("Zeit (µs);Höhe (cm)\n1;2\n".encode("cp1252"))
    found = gr.read_recording(tmp_path / "file.csv")
    assert {name: values.tolist() for name, values in found.items()} == {"Zeit": [1e-6], "Höhe": [0.02]}


def test_other_writings_of_the_same_table_are_read(tmp_path):
    """A text of UTF-16, a comment sign before the names, and a typographic minus."""
    for data in ("t (s)\ty (cm)\n0\t-1\n1\t2\n".encode("utf-16"), b"# t (s)\ty (cm)\n0\t-1\n1\t2\n",
                 "t (s)\ty (cm)\n0\t\N{MINUS SIGN}1\n1\t2\n".encode()):
        (tmp_path / "file.txt").write_bytes(data)
        found = gr.read_recording(tmp_path / "file.txt")
        assert {name: values.tolist() for name, values in found.items()} == {"t": [0.0, 1.0], "y": [-0.01, 0.02]}


def test_columns_come_in_the_order_in_which_they_are_given(tmp_path):
    path = tmp_path / "file.csv"
    path.write_text("t,p (hPa),y (mm),x\n1,2,3,4\n")
    x, y = gr.read_recording(path, ["x", "y"]).values()
    assert (x, y) == (4.0, 0.003)
    assert list(gr.read_recording(path, "x")) == ["x"]
    with pytest.raises(TypeError, match=r"^Every entry of `columns` must be the name of a column, got 0\.$"):
        gr.read_recording(path, [0])


WRONG = {
    "": "must have a line with the names of the columns and, below it, lines of numbers only, got no line of names "
        "above numbers.",
    "0.1,0.2\n0.3,0.4\n": "must have a line with the names of the columns and, below it, lines of numbers only, got no "
                          "line of names above numbers.",
    "t,y\n1,2\n2,lost\n": "must have a line with the names of the columns and, below it, lines of numbers only, got "
                          "'2,lost'.",
    "t,y\n0,5,1,2\n": "has rows with more cells than its header ('t', 'y').",
    "t,y,y\n1,2,3\n": "has the same name ('t', 'y', 'y') for several columns. Rename them.",
    "t,y\n0,1\n1,2..5\n": "must have numbers in column 'y', got '2..5'.",
    "t,y (px)\n1,2\n": "The unit of column 'y' must be one of s, ms, µs, ",
    't,"y\n(cm)"\n0,1\n': "must have pairs of quotation marks in each line, got '(cm)\"'.",
    't,y\n0,"1\n1,2\n': "must have pairs of quotation marks in each line, got '0,\"1'.",
    "t,y\n1,2\n3,4\n2,5\n": "`t[2]` must be a time in s after the one in the row before it, got 2.0. Sort the rows by "
                            "time.",
    "t,y\n1,2\n1,4\n": "`t[1]` must be a time in s after",
    "t,y\n0,inf\n1,2\n": "must have numbers only below the names of its columns, got '0,inf'.",
    "t,y\n0,n/a\n1,2\n": "must have numbers only below the names of its columns, got '0,n/a'.",
    't,y\n0,"1,000"\n1,"2,500"\n': "must have one decimal mark and no thousands separators, got '1,000'. "
                                  "Write a decimal point.",
    't,y\n0.5,"12,000"\n': "must have one decimal mark and no thousands separators, got '12,000'.",
    "t;y\n0,5;1.000\n": "must have one decimal mark and no thousands separators, got '0,5'.",
    "t\ty\n0.5\t1,000.5\n": "must have one decimal mark and no thousands separators, got '1,000.5'.",
    "y\n1,000\n-2,000\n": "must have one decimal mark and no thousands separators, got '1,000'.",
    "t;y\n1,2\n2,4\n": "must separate columns as its header 't;y' does, got '1,2'.",
    "t,y\ns,mm\n0,1\n1,2\n": "must have each unit in the line of names, such as 't (s)', got a separate line of units "
                              "'s,mm'.",
}


@pytest.mark.parametrize("text", WRONG)
def test_a_file_that_cannot_be_read_is_one_sentence(text, tmp_path):
    (tmp_path / "file.csv").write_text(text)
    with pytest.raises(ValueError) as error:  # noqa: PT011
        gr.read_recording(tmp_path / "file.csv")
    assert WRONG[text] in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("separator", [",", ";", "\t"])
@pytest.mark.parametrize(("mark", "thousands"), [(".", ""), (",", ""), (".", ","), (",", "."), (".", "'"), (",", " ")])
def test_tables_at_random_are_read_as_written_or_refused(separator, mark, thousands, tmp_path):
    """Only numbers with thousands separators are refused. The module csv writes and quotes the cells."""
    rng, path, refused = np.random.default_rng(ord(separator)), tmp_path / "file.csv", 0
    for k in range(60):
        places = [2, *rng.integers(0, 5, 2)]
        values = 10.0 ** rng.uniform(-3.0, 6.0, (rng.integers(1, 6), 3)) * rng.choice([-1.0, 1.0], 3)
        values[:, 0] = np.arange(len(values)) + 0.25
        texts = [[f"{x:,.{n}f}" for x, n in zip(row, places, strict=True)] for row in values.tolist()]
        with path.open("w", newline="", encoding="utf-8") as file:
            table = csv.writer(file, delimiter=separator, quoting=csv.QUOTE_ALL if k % 2 else csv.QUOTE_MINIMAL)
            table.writerow(["t", "x", "y"])
            table.writerows([cell.translate({ord(","): thousands, ord("."): mark}) for cell in row] for row in texts)
        if thousands and any("," in cell for row in texts for cell in row):
            refused += 1
            with pytest.raises(ValueError, match=r"File .* must have "):
                gr.read_recording(path)
        else:
            found = np.column_stack([*gr.read_recording(path).values()])
            assert found.tolist() == [[float(cell.replace(",", "")) for cell in row] for row in texts]
    assert (refused > 30) == bool(thousands)


def test_a_missing_column_or_file_is_named(tmp_path):
    path = tmp_path / "file.csv"
    path.write_text("Time (s),y (px)\n1,2\n")
    with pytest.raises(ValueError, match=r"has no column `time`; did you mean `Time`\?$"):
        gr.read_recording(path, ["time"])
    with pytest.raises(ValueError, match=r"got 'px'\. To read other columns, give columns=\['Time'\]\.$"):
        gr.read_recording(path)
    assert gr.read_recording(path, ["Time"])["Time"] == [1.0]
    with pytest.raises(OSError, match=r"none\.csv"):
        gr.read_recording(tmp_path / "none.csv")


def test_the_velocities_of_exact_positions_are_exact_and_nan_at_bounces():
    run = gr.edmd.simulate(BALL, RULE, t_end=2.0, samples=FRAMES)
    found = gr.Trajectory.from_arrays(BALL, run.time, position=run.position)
    known = np.isfinite(found.velocity[:, 1])
    assert found.velocity[known, 1] == pytest.approx(run.velocity[known, 1], abs=1e-12)
    onsets = gr.edmd.simulate(BALL, RULE, t_end=2.0).contacts["t_begin"]
    crossed = [k in (0, 60) or any(FRAMES[k - 1] < t < FRAMES[k + 1] for t in onsets) for k in range(61)]
    assert np.array_equal(~known, crossed), "samples whose difference crosses a bounce, and no others"
    assert (found.velocity[1:-1, 0] == 0.0).all()
    assert found.stats["lost_frames"] == 0


def test_the_error_of_a_video_is_stated_and_is_21_mm_per_s_for_1_mm_at_30_hz():
    rng, run = np.random.default_rng(5), gr.edmd.simulate(BALL, RULE, t_end=2.0, samples=FRAMES)
    sigma, said, off = 1e-3, [], []
    for _ in range(50):
        noisy = run.position + rng.normal(0.0, sigma, run.position.shape) * [0.0, 1.0]
        found = gr.Trajectory.from_arrays(BALL, run.time, position=noisy)
        said.append([found.stats["position_error"], found.stats["velocity_error"]])
        off.append((found.velocity - run.velocity)[:, 1])
    assert sigma * math.sqrt(2.0) * 30.0 / 2.0 == pytest.approx(0.0212, rel=1e-3)
    assert np.mean(said, axis=0) == pytest.approx([sigma, 0.0212], rel=0.1)
    assert np.nanstd(off) == pytest.approx(0.0212, rel=0.1)
    assert np.nanmax(np.abs(off)) < 5.5 * 0.0212, "no difference crosses a bounce"
    assert f"standard error of {said[-1][1]:.2g} m/s (positions: {said[-1][0]:.2g} m)" in found.message


def test_lost_frames_are_left_out_whether_nan_or_missing():
    run = gr.edmd.simulate(BALL, RULE, t_end=2.0, samples=FRAMES)
    position, lost = run.position.copy(), [4, 13, 30, 31]
    position[lost, 1] = math.nan
    marked = gr.Trajectory.from_arrays(BALL, run.time, position=position)
    missing = gr.Trajectory.from_arrays(BALL, np.delete(run.time, lost), position=np.delete(position, lost, axis=0))
    assert (marked.stats["lost_frames"], missing.stats["lost_frames"]) == (4, 0)
    assert np.array_equal(marked.velocity, missing.velocity, equal_nan=True)
    difference = marked.velocity - np.delete(run.velocity, lost, axis=0)
    assert np.nanmax(np.abs(difference)) < 1e-12  # unequal steps too
    assert np.isfinite(difference[3, 1]), "a lost frame in free flight costs one sample"


def test_flights_that_the_camera_does_not_resolve_have_a_large_error():
    """One bounce per frame at the same phase: the ball seems to be at rest."""
    ball = gr.Scene([math.inf, 0.05], [0.0, 0.02], [0.0], [0.0, 9.81 / 60.0], gravity=9.81)
    run = gr.edmd.simulate(ball, gr.ConstantRestitution(1.0), t_end=1.0, samples=np.arange(30) / 30.0 + 0.01)
    found = gr.Trajectory.from_arrays(ball, run.time, position=run.position)
    error = np.abs(found.velocity - run.velocity)[1:-1, 1]
    assert error.max() == pytest.approx(9.81 * (1.0 / 60.0 - 0.01))
    assert found.stats["velocity_error"] > error.max()


def test_collisions_of_balls_and_swings_of_pendula():
    cradle = gr.scenes.pendulum_cradle(3)
    run = gr.edmd.simulate(cradle, gr.ConstantRestitution(1.0), t_end=3.0, samples=601)
    found = gr.Trajectory.from_arrays(cradle, run.time, position=run.position)
    off = np.abs(found.velocity - run.velocity)
    assert np.isnan(off[1:-1]).sum() < 30
    assert np.nanmax(off) < 1e-4 * np.abs(run.velocity).max()  # a swing is not a parabola
    gaps = gr.Trajectory.from_arrays(cradle, run.time, gap=run.gap)
    assert np.nanmax(np.abs(gaps.velocity - found.velocity)) < 1e-9


WRONG_ROWS = [
    ({"time": [0.0, 0.1], "position": [[0.0, 1.02], [0.0, 0.97]]},
        r"`time` must be an array of at least 3 times with positions, without `velocity`, got 2\."),
    ({"time": [0.0, 0.1, 0.1]}, r"`time\[2\]` must be larger than the entry before it, without `velocity`, got 0\.1\."),
    ({"time": [0.0, 0.2, 0.1]}, r"`time\[2\]` must be a finite time in s, not before its predecessor, got 0\.1\. Sort"),
    ({"position": [[0.0, 1.0], [0.0, math.inf], [0.0, 0.8]]}, r"`position\[1, 1\]` must be a finite number, got inf\."),
    ({"position": [[0.0, math.nan]] * 3}, r"at least 3 times with positions, without `velocity`, got 0\."),
]


@pytest.mark.parametrize(("given", "sentence"), WRONG_ROWS)
def test_invalid_recordings_are_refused_in_one_sentence(given, sentence):
    valid = {"time": [0.0, 0.1, 0.2], "position": [[0.0, 1.0], [0.0, 0.9], [0.0, 0.8]]}
    with pytest.raises(ValueError, match=sentence):
        gr.Trajectory.from_arrays(BALL, **valid | given)


def test_lost_frames_are_refused_if_velocities_are_given():
    with pytest.raises(ValueError, match=r"`position\[0, 1\]` must be a finite number, got nan"):
        gr.Trajectory.from_arrays(BALL, [0.0], position=[[0.0, math.nan]], velocity=[[0.0, 0.0]])


def test_heights_of_the_lowest_point_are_refused_and_overlaps_by_noise_are_not():
    run, rng = gr.edmd.simulate(BALL, RULE, t_end=2.0, samples=121), np.random.default_rng(6)
    lowest = run.position - [0.0, 0.02]
    with pytest.raises(ValueError, match=r"^The overlap of pair floor–1 in sample \d+ must be at most half the sum of "
                                         r"its radii, 0\.01 m, got 0\.01\d+ m\. Positions are those of centres in m, "
                                         r"from the bottom up\.$"):
        gr.Trajectory.from_arrays(BALL, run.time, position=lowest)
    rests = gr.edmd.simulate(BALL, gr.ConstantRestitution(0.5), t_end=4.0, samples=121, collapse="merge")
    noisy = rests.position + rng.normal(0.0, 5e-3, rests.position.shape) * [0.0, 1.0]
    assert gr.Trajectory.from_arrays(BALL, rests.time, position=noisy).gap.min() < -0.01


def test_a_ball_at_rest_does_not_count_as_noise():
    """Two thirds of the samples are on the floor, in contact, and must not contribute to the noise."""
    rng, times = np.random.default_rng(7), np.arange(121) / 30.0
    run = gr.edmd.simulate(BALL, gr.ConstantRestitution(0.5), t_end=4.0, samples=times, collapse="merge")
    noisy = run.position + rng.normal(0.0, 1e-4, run.position.shape) * [0.0, 1.0]
    found = gr.Trajectory.from_arrays(BALL, times, position=noisy)
    assert found.stats["position_error"] == pytest.approx(1e-4, rel=0.2)
    assert np.nanmax(np.abs(found.velocity - run.velocity)) < 6.0 * found.stats["velocity_error"]
