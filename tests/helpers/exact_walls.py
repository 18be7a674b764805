"""Slow, obviously right twins of a gap beside a moving wall, for mpmath: a sine, and a path of polynomials."""

import mpmath as mp
import numpy as np

from granular.scene.walls.gap import GAP_NOISE


class Exact:
    """A gap beside a shaken wall."""

    def __init__(self, wall, side, t, tail, gap, rate, pull):
        self.a, self.omega = side * mp.mpf(wall.amplitude), 2 * mp.pi * mp.mpf(wall.frequency)
        self.theta = self.omega * (mp.mpf(t) + mp.mpf(tail)) + mp.mpf(wall.phase)
        self.height = gap + self.a * mp.sin(self.theta)
        self.drift, self.pull = rate + self.a * self.omega * mp.cos(self.theta), mp.mpf(pull)
        size = gap + wall.amplitude
        self.noise = lambda s: GAP_NOISE * (size + s * (abs(rate) + wall.amplitude * wall.omega + 0.5 * abs(pull) * s))

    def __call__(self, s):
        s = mp.mpf(s)
        angle = self.theta + self.omega * s
        rate = self.drift - self.pull * s - self.a * self.omega * mp.cos(angle)
        return self.height + s * (self.drift - self.pull * s / 2) - self.a * mp.sin(angle), rate

    def first(self, limit):
        """The first hit, by steps of a parabola with the largest acceleration of all."""
        s, most = mp.mpf(0), self.pull + abs(self.a) * self.omega**2
        for _ in range(20_000):
            if s >= limit:
                return mp.inf
            above, fall = self.height + s * (self.drift - self.pull * s / 2) - abs(self.a), self.drift - self.pull * s
            s += closes(above, fall, self.pull) if above > 0 else 0
            if s == mp.inf:
                return mp.inf
            gap, rate = self(s)
            if gap < 1e-33 and rate < 0:
                return s
            s += closes(gap, rate, most) * (1 - mp.mpf(10) ** -30)
        raise RuntimeError("the twin comes to no hit")


def closes(gap, rate, a):
    """When a gap under constant acceleration closes."""
    square = rate * rate + 2 * a * gap
    if square < 0 or (a <= 0 and rate >= 0):
        return mp.inf
    return (rate + mp.sqrt(square)) / a if rate > 0 else 2 * gap / (mp.sqrt(square) - rate)


class ExactPieces:
    """A gap beside a path of polynomials, its panels taken as exact."""

    def __init__(self, panels, side, t, gap, rate, pull):
        self.t, self.side, self.edges, self.pull = mp.mpf(t), side, [mp.mpf(float(x)) for x in panels.edges], pull
        self.series = [[side * mp.mpf(float(c)) for c in row[::-1]] for row in panels.series]
        k = np.searchsorted(panels.edges, t, side="right") - 1
        self.first_piece, (m, v) = k, self.moved(k, mp.mpf(0))
        self.height, self.drift = gap + m, rate + v
        extent = float(np.abs(panels.series).sum(axis=1).max())
        self.noise = lambda s: GAP_NOISE * (gap + 2 * extent + s * (abs(rate) + 20 * extent + 0.5 * abs(pull) * s))

    def moved(self, k, s):
        half = (self.edges[k + 1] - self.edges[k]) / 2
        m, v, x = mp.mpf(0), mp.mpf(0), (self.t + s - self.edges[k]) / half - 1
        for c in self.series[k]:
            m, v = m * x + c, v * x + m
        return m, v / half

    def on(self, k, s):
        m, v = self.moved(k, mp.mpf(s))
        return self.height + s * (self.drift - self.pull * s / 2) - m, self.drift - self.pull * s - v

    def __call__(self, s):
        last = len(self.series) - 1
        return self.on(min(last, max(k for k in range(last + 1) if self.edges[k] <= self.t + s)), mp.mpf(s))

    def first(self, limit):
        for k in range(self.first_piece, len(self.series)):
            begin, end = max(mp.mpf(0), self.edges[k] - self.t), self.edges[k + 1] - self.t
            n = len(self.series[k])
            at = [begin + (end - begin) * mp.mpf(i) / (n - 1) for i in range(n)]
            values = mp.matrix([self.on(k, s)[0] for s in at])
            powers = mp.lu_solve(mp.matrix([[s**j for j in range(n)] for s in at]), values)
            roots = mp.polyroots(list(powers)[::-1], maxsteps=500, extraprec=200)
            good = [r.real for r in map(mp.mpc, roots) if abs(r.imag) < mp.mpf(10) ** -20 and begin <= r.real <= end]
            down = [s for s in good if self.on(k, s)[1] < 0]
            if down:
                return min(down)
        return mp.inf


def assert_first(exact, s, limit):
    """Nothing is missed; what is early is within rounding of a touch there."""
    first = exact.first(limit)
    if s > first:
        slope = abs(exact(first)[1])
        assert s - first <= exact.noise(float(first)) / slope + 4 * mp.mpf(2) ** -52 * first
    elif s < first:
        gap, rate = exact(s)
        assert gap <= 3 * (exact.noise(s) + abs(rate) * mp.mpf(2) ** -52 * s)
