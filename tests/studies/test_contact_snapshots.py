"""Contacts from snapshots of a run: means for any spacing, and refused arguments."""

import math

import numpy as np
import pytest

from granular.studies import contacts


def half_sines(n, particles, length, seed=1):
    """Contacts of duration 1 with half sines of force. Contacts of a pair do not overlap in time."""
    random = np.random.default_rng(seed)
    i = random.integers(0, particles, n)
    j = (i + random.integers(1, particles, n)) % particles
    begin = np.sort(random.uniform(1.0, length - 2.0, n))
    low, high = np.minimum(i, j), np.maximum(i, j)
    order = np.lexsort((begin, high, low))
    near = (np.diff(low[order]) == 0) & (np.diff(high[order]) == 0) & (np.diff(begin[order]) < 4.0)
    kept = np.sort(order[np.append(True, ~near)])
    return i[kept], j[kept], begin[kept], random.uniform(0.5, 1.5, len(kept))


def seen_at(frames, i, j, begin, height):
    """Arguments of `snapshots` for contacts of duration 1."""
    rows = [(t, k) for t in frames.tolist() for k in np.flatnonzero((begin <= t) & (t < begin + 1.0)).tolist()]
    time, k = np.array([t for t, _ in rows]), np.array([k for _, k in rows])
    depth = height[k] * np.sin(np.pi * (time - begin[k]))
    return {"time": time, "i": i[k], "j": j[k], "force": depth, "overlap": 1e-3 * depth, "distance": 1.0,
            "frames": frames}


def test_snapshots_of_any_spacing_have_the_means_of_the_run():
    """Means over snapshots do not require close snapshots. Durations, disturbed contacts and counts of contacts do."""
    i, j, begin, height = half_sines(6000, 200, 400.0)
    exact = contacts.analyse(i, j, begin, begin + 1.0, impulse=height, overlap=1e-3 * height, distance=1.0,
                             particles=200, span=400.0)
    assert exact.occupation > 0.1
    for spacing in (0.05, 0.25, 1.7, 4.0):
        frames = np.arange(0.0, 400.0 + spacing, spacing)
        listed = contacts.snapshots(**seen_at(frames, i, j, begin, height))
        found = contacts.analyse(**listed, particles=200)
        assert found.occupation == pytest.approx(exact.occupation, rel=0.01 if spacing < 1.0 else 0.06)
        assert found.relative_overlap == pytest.approx(exact.relative_overlap, rel=0.05)
        assert found.shared_impulse == pytest.approx(exact.shared_impulse, rel=0.05 if spacing < 1.0 else 0.1)
        assert ("Snapshots too far apart" in str(found)) == (spacing > 0.5)
        if spacing < 0.5:
            assert len(found.durations) == len(begin)
            assert found.durations.mean() == pytest.approx(1.0, rel=0.01)
            # ends at midpoints between snapshots hide short overlaps in time: a known bias of about spacing/2
            assert exact.disturbed_share * (1.0 - spacing) < found.disturbed_share < exact.disturbed_share


@pytest.mark.parametrize(("changes", "match"), [
    ({"time": [1.0, 0.0, 2.0]}, r"^`time\[1\]` must be not before the time of the row above, got 0\.0\.$"),
    ({"frames": [0.0, 2.0]}, r"^`time\[1\]` must be one of `frames`, got 1\.0\.$"),
    ({"frames": [0.0, 2.0, 1.0]}, r"^`frames\[2\]` must be larger than the entry before it, got 1\.0\.$"),
    ({"time": [0.0, 0.0, 2.0], "i": [1, 2, 1], "j": [2, 1, 3]}, "^A pair must occur at most once in a snapshot"),
    ({"time": [1.0] * 3}, "^`frames` must be an array of at least 2 entries, got 1"),
    ({"force": [1.0, -1.0, 0.0]}, r"^`force\[1\]` must be a finite number of at least 0, got -1"),
    ({"overlap": [1.0, -0.5, 0.0]}, r"^`overlap\[1\]` must be a number in m of at least 0, got -0\.5\.$"),
    ({"overlap": [1.0, math.nan, 0.0]}, r"^`overlap\[1\]` must be a number in m of at least 0, got nan\.$"),
    ({"force": [1.0]}, r"^`force` must be an array of shape \(3,\)"),
    ({"distance": [1.0]}, r"^`distance` must be an array of shape \(3,\)"),
    ({"i": [1, 2]}, r"^`i` must be an array of shape \(3,\)"),
    ({"i": [1, math.nan, 1]}, r"^`i\[1\]` must be the number of a particle, got nan\.$"),
    ({"i": [1, 2, 1.5]}, r"^`i\[2\]` must be the number of a particle, got 1\.5\.$"),
    ({"i": [3, 2, 3]}, r"^`j\[2\]` must be another particle than in `i`, got 3"),
    ({"time": [0.0, math.nan, 2.0]}, r"^`time\[1\]` must be a finite time, got nan"),
])
def test_misuse_of_snapshots_is_one_sentence(changes, match):
    with pytest.raises((TypeError, ValueError), match=match):
        contacts.snapshots(**{"time": [0.0, 1.0, 2.0], "i": [1, 2, 1], "j": [2, 3, 3]} | changes)
