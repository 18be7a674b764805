"""The driver, with an engine that knows its lines: which rows it keeps, what it hands on, how it orders the log."""

import math

import numpy as np
import pytest

import granular as gr
from granular.run.drive import End, Pause, Row, checked_request, drive

pytestmark = pytest.mark.core
HARD = np.dtype([("pair", int), ("t_begin", float), ("lower_in", float), ("upper_out", float), ("impulse", float)])
SOFT = np.dtype([("pair", int), ("t_begin", float), ("t_end", float), ("xi_max", float), ("force_max", float)])
SCENE = gr.Scene([1.0, 2.0, 1.0], [0.0] * 3, [1.0, 1.0], [0.0] * 3)
CALM = {"until": None, "log": True, "max_events": 9, "on_event": None, "on_progress": None}


class Lines:
    """An engine that pauses every second, with the contacts of a table, until `stop`."""

    law = rule = None

    def __init__(self, request, table, stop=math.inf, pause=Pause.until, in_order=False):
        self.request, self.scene, self.table, self.stop, self.pause = request, SCENE, table, stop, pause
        self.start = request.start
        self.in_order, self.adds_up, self.now, self.asked = in_order, True, request.start, []

    def to(self, time, last):
        self.asked.append((time, last))
        self.before, self.now = self.now, min(time, self.stop, self.now + 1.0)
        return self.pause if self.now == self.stop else Pause.reached if self.now == time else Pause.full

    def row(self, time):
        return Row(time, self.now - self.request.start, np.full(2, 1.0 + self.now), np.full(3, self.now))

    def rows(self):
        when = self.table["t_begin" if "t_end" not in self.table.dtype.names else "t_end"]
        return [self.table[(when > self.before) & (when <= self.now)]]

    def progress(self):
        return self.now, len(self.asked)

    def end(self, pause, seen):
        row = self.row(self.now) if self.now > seen else None
        running = self.table[~(self.table["t_end"] <= self.now)] if "t_end" in self.table.dtype.names else None
        return End(row, pause.value, "so it ended", {"looks": len(self.asked)}, {}, running)


def run(table=None, stop=math.inf, pause=Pause.until, in_order=False, start=0.0, t_end=None, samples=None, **given):
    request = checked_request(SCENE, start, t_end, samples=samples, **CALM | given)
    return drive(Lines(request, np.zeros(0, SOFT) if table is None else table, stop, pause, in_order))


@pytest.mark.parametrize(
    ("given", "times", "status"),
    [
        ({"t_end": 2.5}, [0.0, 2.5], "time"), ({"t_end": 2.5, "stop": 2.0}, [0.0, 2.0], "until"),
        ({"t_end": 2.5, "samples": 3}, [0.0, 1.25, 2.5], "time"), ({"stop": 0.0}, [0.0, 0.0], "until"),
        ({"t_end": 4.0, "samples": [0.5, 0.5, 3.0], "stop": 2.0}, [0.5, 0.5, 2.0], "until"),
        ({"samples": [0.5], "stop": 7.0, "pause": Pause.quiet}, [0.5, 7.0], "quiet"),
        ({"samples": [1.0], "stop": 0.0, "pause": Pause.work}, [0.0], "max_events"),
    ],
)
def test_rows_are_the_samples_and_the_end(given, times, status):
    made = run(**given)
    assert (made.time.tolist(), made.status.name) == (times, status)
    np.testing.assert_array_equal(made.velocity[:, 0], times)
    np.testing.assert_array_equal(made.gap, 1.0 + made.velocity[:, :2])
    assert made.force is None


def test_only_the_end_is_asked_for_last():
    engine = Lines(checked_request(SCENE, 0.0, 2.0, samples=[0.5, 1.0], **CALM), np.zeros(0, SOFT))
    assert drive(engine).stats == {"looks": len(engine.asked)}
    assert engine.asked == [(0.5, False), (1.0, False), (2.0, True)]


def test_soft_contacts_are_told_as_they_end_and_kept_by_their_onset():
    ended = [(0, 0.1, 0.2, 7.0, 8.0), (1, 0.5, 1.5, 3.0, 4.0), (0, 0.5, 2.5, 5.0, 6.0)]
    table = np.array([*ended, (1, 2.0, math.nan, 9.0, 9.0)], SOFT)
    rows, seen = [], []
    made = run(table, t_end=3.0, on_event=rows.append, on_progress=lambda *now: seen.append(now))
    assert [float(row["t_end"]) for row in rows] == [0.2, 1.5, 2.5]
    assert made.contacts[["pair", "t_begin"]].tolist() == [(0, 0.1), (0, 0.5), (1, 0.5), (1, 2.0)]
    assert made.contacts["xi_max"].tolist() == [7.0, 5.0, 3.0, 9.0]
    assert seen == [(1.0, 1), (2.0, 2), (3.0, 3)]
    assert len(run(table, t_end=3.0, log=False).contacts) == 0


def test_hard_contacts_are_instants_and_stay_in_their_order():
    table = np.array([(1, 0.5, 1.0, 2.0, 3.0), (0, 0.5, 4.0, 5.0, 6.0)], HARD)
    made = run(table, in_order=True, t_end=1.0).contacts
    assert made["pair"].tolist() == [1, 0]
    np.testing.assert_array_equal(made["t_begin"], made["t_end"])
    assert np.isnan(made["force_max"]).all()
    assert made["v_in"].tolist() == [[1.0, 0.0], [4.0, 0.0]]
    assert made["v_out"].tolist() == [[0.0, 2.0], [0.0, 5.0]]
    assert (made["duration"].tolist(), made["impulse"].tolist()) == ([0.0, 0.0], [3.0, 6.0])


@pytest.mark.parametrize("options", [{"engine": "plain"}, {"method": "verlet", "dt": 1e-5, "engine": "plain"}])
def test_who_writes_into_a_row_does_not_write_into_the_log(options):
    def spoil(row):
        row["duration"] = -1.0

    scene, law = gr.scenes.three_balls(), gr.LinearDashpot(1e6)
    one, other = (gr.md.simulate(scene, law, t_end=0.35, on_event=told, **options) for told in (None, spoil))
    assert len(one.contacts) > 1
    assert one.contacts.tobytes() == other.contacts.tobytes()
