"""Noisy recordings of a bouncing ball: intervals, heights and a video, with the models that are fitted to them."""

import math

import numpy as np

import granular as gr

G = 9.81
KINDS = ("intervals", "heights", "video")


def run(height, rule, **given):
    """A ball of radius 2 cm that falls onto a floor."""
    scene = gr.Scene([math.inf, 0.05], [0.0, 0.02], [height], [0.0, 0.0], gravity=G)
    return gr.edmd.simulate(scene, rule, collapse="merge", **given)


def intervals(height, rule):
    """Eight intervals between nine bounces, in s."""
    return np.diff(run(height, rule, until=gr.until.contact(pair=0, nth=10)).contacts["t_begin"])


def heights(height, rule):
    """The drop height and six rebound heights, in m."""
    speed = run(height, rule, until=gr.until.contact(pair=0, nth=7)).contacts["v_out"][:, 1]
    return np.append(height, speed**2 / (2.0 * G))


def video(height, rule, release, frames):
    """Heights of the lowest point in m at the times `frames`, on a clock that shows `release` at the release."""
    return run(height, rule, t_end=frames[-1] - release, samples=frames - release).gap[:, 0]


def covariance_of_intervals(n, sigma):
    """Covariance of intervals, which share times of bounces: 2 σ² on the diagonal, -σ² next to it."""
    return sigma**2 * (2.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1))


def recorded(kind, rng, rule):
    """Exact data, noisy data, and the arguments of `gr.calibrate` for a constant ε."""
    height, frames = rng.uniform(0.5, 1.5), np.arange(45) / 30.0
    parameters = {"e": (0.3, 0.7, 1.0), "height": (0.1, height + 0.05, 3.0)}
    if kind == "intervals":
        sigma, exact = 10.0 ** rng.uniform(-4.0, math.log10(2e-3)), intervals(height, rule)  # 0.1 to 2 ms
        return exact, exact + sigma * np.diff(rng.normal(size=9)), {
            "model": lambda e, height: intervals(height, gr.ConstantRestitution(e)), "parameters": parameters,
            "sigma": covariance_of_intervals(8, sigma)}
    sigma = 10.0 ** rng.uniform(-3.0, -2.0)  # 1 to 10 mm
    if kind == "heights":
        exact = heights(height, rule)
        return exact, exact + rng.normal(0.0, sigma, exact.size), {
            "model": lambda e, height: heights(height, gr.ConstantRestitution(e)), "parameters": parameters,
            "sigma": sigma}
    frames = frames[rng.random(45) > 0.01]  # lost frames
    exact = video(height, rule, -0.1, frames)
    return exact, exact + rng.normal(0.0, sigma, exact.size), {
        "model": lambda e, height, release: video(height, gr.ConstantRestitution(e), release, frames),
        "parameters": parameters | {"release": (-0.2, -0.12, -0.02)}, "sigma": sigma}
