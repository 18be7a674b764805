"""Measure the teaching page in a headless Chromium: time to ready, slider to redraw, pictures per second.

    python tests/page/measure.py [REPETITIONS]

A redraw is measured from the slider's event until the frame that answers it is painted. Everything is in it, the
breakdown curve as a sketch; its refinement and the table of tie rules follow when nothing else is to be done. Of
several repetitions the best counts: what else the machine does only makes it slower. CPU is the time of the page's own
thread per move, p95: it hardly depends on what else runs.
"""

import sys
import tempfile
from itertools import pairwise
from pathlib import Path

from browser import Browser

from granular.page import live_page

MOVE = """
(async () => {
  const slider = document.querySelector('[data-name=NAME]');
  const top = Number(slider.max), low = Number(slider.min);
  slider.value = Math.round(low + (top - low) * (0.5 + 0.5 * Math.sin(STEP * 0.7)));
  slider.dispatchEvent(new Event('input', {bubbles: true}));
  await new Promise((done) => requestAnimationFrame(() => setTimeout(done, 0)));  // run, then painted
})()
"""
DRAG = """
(async () => {
  const slider = document.querySelector('[data-name=NAME]'), spent = [];
  const top = Number(slider.max), low = Number(slider.min);
  for (let i = 0; i < 40; i++) {
    slider.value = Math.round(low + (top - low) * (0.5 + 0.5 * Math.sin(i * 0.7)));
    const start = performance.now();
    slider.dispatchEvent(new Event('input', {bubbles: true}));
    await new Promise((done) => requestAnimationFrame(() => setTimeout(done, 0)));  // run, then painted
    spent.push(performance.now() - start);
    await new Promise((done) => setTimeout(done, 30));
  }
  return spent.sort((a, b) => a - b);
})()
"""
PLAY = """
(async () => {
  document.querySelector('.restart').click();
  document.querySelector('.play').click();
  const times = [];
  const start = performance.now();
  while (performance.now() - start < 3000) times.push(await new Promise(requestAnimationFrame));
  document.querySelector('.restart').click();
  return times;
})()
"""
SCENES = {
    "real-balls": ("gap", "t2", "e1"),
    "three-balls": ("gap", "eps", "ratio", "k"),
    "ball-stack&n=8": ("gap", "eps", "n"),
    "newtons-cradle&n=9": ("gap", "eps", "n"),
    "bouncing-ball": ("t1", "e1"),
}


def main(repetitions):
    with tempfile.TemporaryDirectory() as folder, Browser() as tab:
        path = Path(folder) / "page.html"
        live_page(path)
        tab.call("Performance.enable", timeDomain="threadTicks")
        print(f"size {path.stat().st_size / 1000:.1f} kB; best of {repetitions} repetitions")
        for throttle in (1, 6):
            tab.call("Emulation.setCPUThrottlingRate", rate=throttle)
            for scene, sliders in SCENES.items():
                measure(tab, path.as_uri(), scene, sliders, throttle, repetitions)


def measure(tab, url, scene, sliders, throttle, repetitions):
    runs = [measured(tab, url, scene, sliders) for _ in range(repetitions)]
    best = zip((min, min, min, min, max, min), zip(*runs, strict=True), strict=True)
    ready, middle, most, cpu, rate, step = (pick(column) for pick, column in best)
    print(
        f"CPU / {throttle}  {scene:20} ready {ready:4.0f} ms   slider to redraw p50 {middle:4.0f}, p95 {most:4.0f} ms "
        f"({', '.join(f'{run[2]:.0f}' for run in runs)}), CPU {cpu:.0f} ms   {rate:.0f} pictures/s, p95 {step:.1f} ms",
        flush=True,
    )


def measured(tab, url, scene, sliders):
    """Return times to ready, of redraws (p50, p95, CPU p95) in ms, pictures/s, p95 of their distance in ms."""
    tab.open("about:blank")
    tab.open(f"{url}#scene={scene}")
    tab.wait("performance.getEntriesByName('drawn').length > 0")
    ready = tab.run("performance.getEntriesByName('drawn')[0].startTime")
    spent = [x for name in sliders for x in tab.run(DRAG.replace("NAME", name))]
    cpu = [cpu_of(tab, MOVE.replace("NAME", name).replace("STEP", str(i))) for name in sliders for i in range(40)]
    tab.run("new Promise((done) => setTimeout(done, 1500))")
    times = tab.run(PLAY)
    steps = [b - a for a, b in pairwise(times)]
    rate = 1000 * (len(times) - 1) / (times[-1] - times[0])
    return ready, share(0.5, spent), share(0.95, spent), share(0.95, cpu), rate, share(0.95, steps)


def share(part, values):
    return sorted(values)[int(part * len(values))]


def cpu_of(tab, expression):
    before = cpu_time(tab)
    tab.run(expression)
    return cpu_time(tab) - before


def cpu_time(tab):
    metrics = tab.call("Performance.getMetrics")["metrics"]
    return 1000 * next(x["value"] for x in metrics if x["name"] == "TaskDuration")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 5)
