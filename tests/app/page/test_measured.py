"""A recording beside the models of a bouncing ball, and the guesses of a class: both stay on the device."""

import json
import math
import re
import shutil
import subprocess
from pathlib import Path
from urllib.parse import quote

import numpy as np
import pytest

import granular as gr
from granular.app.page import assemble
from tests.app.page.driving import go, settle, text, turn

GIVEN = """
(async () => {
  const files = new DataTransfer(), input = document.querySelector('.measured-file');
  files.items.add(new File([%r], 'ball.csv'));
  input.files = files.files;
  input.dispatchEvent(new Event('change'));
  await new Promise((done) => setTimeout(done, 60));
  const note = document.querySelector('.measured-note').textContent.replaceAll('\\u00a0', ' ');
  return [note, document.querySelectorAll('.measured .body .measured-own').length];
})()
"""
DOTS = """
[...document.querySelectorAll('.stage .soft .dot')].map((dot) => [dot.cx, dot.cy].map((at) => at.baseVal.value))
"""
HEIGHTS = "[...document.querySelectorAll('.measured > svg > circle')].map((ball) => Number(ball.getAttribute('cy')))"


def test_the_shipped_recording_is_simulated_by_the_package() -> None:
    """Heights in mm of a basketball whose restitution depends on speed, with a noise of 3 mm."""
    ball, steps = gr.balls.BALLS["basketball"], np.arange(76)
    scene = gr.Scene(mass=[math.inf, ball.mass], radius=[0.0, ball.radius], gap=[1.0], velocity=[0, 0], gravity=9.81)
    rule = gr.TabulatedRestitution([0.5, 4.5], [0.86, 0.82])
    run = gr.edmd.simulate(scene, rule, t_end=3.0, samples=steps / 25, engine="sorted")
    heights = 1e3 * (run.position[:, 1] - ball.radius) + np.random.default_rng(55).normal(0.0, 3.0, len(steps))
    shipped = re.search('"([\\d ]+)"', assemble.part_text("live/recorded.mjs"))
    assert shipped is not None
    assert len(shipped[1]) <= 1000
    assert shipped[1].split() == [f"{height:.0f}" for height in heights.clip(0.0)]


def test_a_recording_is_played_beside_both_models(blank, story) -> None:
    go(blank, f"{story}#scene=three-balls&lang=en")
    assert not blank.run("document.querySelector('.measured-box').checkVisibility()")
    go(blank, f"{story}#scene=bouncing-ball&lang=en")
    assert text(blank, ".measured-note").startswith("Source: simulated, not measured.")
    assert blank.run("document.querySelectorAll('.measured .body .measured-own').length") == 76
    start = blank.run(HEIGHTS)
    assert max(start) - min(start) < 3.0  # all three are dropped together
    blank.run("document.querySelector('.measured-play').click()")
    blank.wait(f"{HEIGHTS}.every((cy, i) => cy > {start}[i] + 40)")
    assert text(blank, ".measured-play") == "pause"
    blank.run("document.querySelector('.language').value = 'es'")
    blank.run("document.querySelector('.language').dispatchEvent(new Event('change', { bubbles: true }))")
    assert text(blank, ".measured-play") == assemble.words("es")["pause"]
    blank.run("document.querySelector('.measured-play').click()")
    assert text(blank, ".measured-play") == assemble.words("es")["play"]
    blank.is_worn = True


READ = """
const { flightHeights, recordingIn } = await import("COLUMNS");
const found = JSON.parse(process.argv[1]).map(recordingIn);
console.log(JSON.stringify(found.map((one) => [one, one.bounces && flightHeights(one.bounces, 9.81)])));
"""


def read_by_the_page(files):
    """Return what the page reads from texts, and the heights between bounces."""
    node = shutil.which("node")
    if node is None:
        pytest.skip("node is not installed: the files that the page reads are not compared with the library's here")
    columns = Path(assemble.__file__).parent / "live" / "columns.mjs"
    command = [node, "--input-type=module", "-e", READ.replace("COLUMNS", columns.as_uri()), json.dumps(files)]
    return json.loads(subprocess.run(command, capture_output=True, text=True, check=True).stdout)


def test_times_of_bounces_are_what_the_library_makes_of_them(tmp_path) -> None:
    """The same times, heights that follow from the speeds of `from_intervals`, and the same restitutions."""
    random, path = np.random.default_rng(552), tmp_path / "knocks.csv"
    times = [np.cumsum(0.9 * 0.8 ** np.arange(count) * random.uniform(0.95, 1.0, count)) for count in (4, 7, 12)]
    rows = ["\n".join(f"{1e3 * t:.4f}".replace(".", sign) for t in each)
            for each, sign in zip(times, ",.,", strict=True)]
    files = [f"{name}\n{each}\n" for name, each in zip(("t (ms)", '"Time [ms]"', "Zeit / ms"), rows, strict=True)]
    for written, (found, heights) in zip(files, read_by_the_page(files), strict=True):
        path.write_text(written, encoding="utf-8")
        (read,) = gr.read_recording(path).values()
        np.testing.assert_allclose(found["bounces"], read, rtol=1e-14)
        table = gr.TabulatedRestitution.from_intervals(np.diff(read))
        np.testing.assert_allclose(heights[:-1], table.speed[::-1] ** 2 / (2 * 9.81), rtol=1e-10)
        np.testing.assert_allclose(np.sqrt(np.divide(heights[1:], heights[:-1])), table.restitution[::-1], rtol=1e-10)


@pytest.mark.parametrize("header", [
    "t;y", "t (s);y (m)", "Time (ms);Height (cm)", "t / s;y / mm", '"t [ms]";"y [dm]"'])
def test_units_are_those_of_the_library(header, tmp_path) -> None:
    path = tmp_path / "ball.csv"
    path.write_text(f"{header}\n0;1,5\n40;1,25\n80;0,5\n", encoding="utf-8")
    ((found, _),) = read_by_the_page([path.read_text(encoding="utf-8")])
    np.testing.assert_allclose(found["series"], np.transpose(list(gr.read_recording(path).values())), rtol=1e-14)


@pytest.mark.parametrize("written", [
    '"t (ms)","y (mm)"\n"0","1,000"\n"40","990"\n', '"t (s)","y (mm)"\n"0.0","1,000.0"\n"0.1","951.0"\n"0.2","804.0"\n',
    "t (s)\n1,000\n1,800\n2,500\n", "t (ms)\n500\n1,300\n2,000\n", "t;y\n0;1\n0,04;0.99\n", "0,5\n1,3\n2,0\n"])
def test_numbers_that_can_be_read_in_two_ways_are_refused_as_by_the_library(written, tmp_path) -> None:
    path = tmp_path / "ball.csv"
    path.write_text(written, encoding="utf-8")
    with pytest.raises(ValueError, match=r"no thousands separators|no line of names above numbers"):
        gr.read_recording(path)
    ((found, _),) = read_by_the_page([written])
    assert found == {"cell": re.search(r"\d+,[\d.]+", written)[0]}


def test_bounces_are_flights_with_numbers_beside_both_models(blank, story) -> None:
    """The first bounce is that of the models, and the ball is as high between two bounces as the time says."""
    go(blank, f"{story}#scene=bouncing-ball&lang=en")
    note, dots = blank.run(GIVEN % "t (ms)\n2000\n2740\n3350\n3850")
    assert dots == 4
    assert note == ("Source: ball.csv, 4 bounces. The file stays on this device. "
                    "The times T between bounces give the heights g T²/8, in m: 0.671; 0.456; 0.307.")
    numbers = "[...document.querySelectorAll('.measured .words .bar-value')].map((one) => one.textContent)"
    assert blank.run(numbers) == ["1", "2", "3", "4"]
    dot, hard, own = (f"document.querySelector('.measured .body .{kind}')" for kind in (
        "measured-own", "hard-line", "drop-line"))
    model, points = ([[float(x) for x in one.split()] for one in blank.run(f"{line}.getAttribute('d')")[1:].split("L")]
                     for line in (hard, own))
    lowest = max(model[:120], key=lambda point: point[1])
    assert blank.run(f"{dot}.cx.baseVal.value") == pytest.approx(lowest[0], abs=2.0)
    zero = points[0][1]
    drop = zero - min(y for _, y in model)  # 1 m
    assert (zero - min(y for _, y in points)) / drop == pytest.approx(0.671, abs=0.005)
    assert points[-1][1] == pytest.approx(zero, abs=0.1)
    blank.is_worn = True


def test_a_number_that_can_be_read_in_two_ways_is_named_and_utf_16_is_read(blank, story) -> None:
    go(blank, f"{story}#scene=bouncing-ball&lang=en")
    note, points = blank.run(GIVEN % "0,5\n1,3\n2,0")
    assert note == "“0,5” is unclear: write numbers only, with a decimal point."
    assert points == 76
    given = (GIVEN % "BYTES").replace("'BYTES'", str(list("t\ty\n0\t1\n0,1\t0,9\n".encode("utf-16"))))
    note, points = blank.run(given.replace("new File([", "new File([Uint8Array.from(").replace("], 'ball", ")], 'ball"))
    assert note.startswith("Source: ball.csv, 2 points.")
    assert points == 2
    blank.is_worn = True


def test_a_unit_that_is_not_converted_is_named_and_nothing_is_taken(blank, story) -> None:
    go(blank, f"{story}#scene=bouncing-ball&lang=en")
    blank.run(GIVEN % "0;1\n1;0\n2;1")
    note, points = blank.run(GIVEN % "t (s);y (px)\n0;300\n0,04;298")
    assert note == "“y (px)” cannot be read: give times in s or ms, heights in m, dm, cm or mm."
    assert points == 3
    blank.is_worn = True


@pytest.mark.parametrize(("written", "said", "points"), [
    ("0,0;1,0\n0,1;0,95\n0,2;0,8", "Source: ball.csv, 3 points.", 3),
    ('"t (ms)","y (cm)"\r\n0,100.0\r\n100,95.1\r\n', "Source: ball.csv, 2 points.", 2),
    ("time\theight\tnote\n0\t1\ta\n0.1\t.95\tb\n\n0.2\t0.8\tc", "Source: ball.csv, 3 points.", 3),
    ("0 1\n0.2 0.8\n0.1 0.9", "The file needs two columns", 3),
    ("no numbers", "The file needs two columns", 3),
], ids=["decimal comma", "units", "tabs and a third column", "times that decrease", "no numbers"])
def test_own_columns_are_read_with_either_decimal_sign(blank, story, written, said, points) -> None:
    """Of a file that cannot be read nothing is taken: the recording before it stays."""
    go(blank, f"{story}#scene=bouncing-ball&lang=en")
    if points == 3:
        blank.run(GIVEN % "0;1\n1;0\n2;1")
    note, drawn = blank.run(GIVEN % written)
    assert note.startswith(said)
    assert drawn == points
    assert float(blank.run("[...document.querySelectorAll('.measured .grid text')].at(-2).textContent")) <= 1.0
    blank.is_worn = True


@pytest.mark.parametrize("name", ["drop_t_1.csv", "[[eps|a]] {n}.csv", "<b>&amp.csv", "W" * 200])
def test_names_from_outside_are_shown_as_they_are(blank, story, name) -> None:
    """An underscore was a subscript, brackets were a button, and a long name made the page wider than the window."""
    blank.size(390, 844, mobile=True)
    go(blank, f"{story}#scene=bouncing-ball&lang=en&{quote(name)}=1")
    assert text(blank, ".notice") == f"There is no setting “{name}” here."
    wrong = f"t;{name} (px)\n0;1\n1;0"
    for written, said in (("t;y\n0;1\n1;0", "Source: {}, 2 points."), (wrong, "“{} (px)” cannot be")):
        note, _ = blank.run((GIVEN % written).replace("'ball.csv'", repr(name)))
        assert note.startswith(said.replace("{}", name))
        assert blank.run("document.querySelector('.measured-note').children.length") == 0
    assert blank.run("document.documentElement.scrollWidth") <= 390
    blank.is_worn = True


def test_files_that_are_short_long_below_the_floor_or_not_chosen(blank, story) -> None:
    """The clock stays within the file, all points lie within the chart, and a cancelled dialog changes nothing."""
    go(blank, f"{story}#scene=bouncing-ball&lang=en")
    blank.run("document.querySelector('.measured-play').click()")
    blank.wait("document.querySelector('.measured .playhead').x1.baseVal.value > 80")
    note, _ = blank.run(GIVEN % "0;1\n0.01;.9\n0.02;-.5")
    blank.wait("document.querySelector('.measured-play').textContent === 'play'")
    assert blank.run("document.querySelector('.measured .playhead').getAttribute('visibility')") == "visible"
    lowest = blank.run(
        "Math.max(...[...document.querySelectorAll('.measured .body circle')].map((c) => c.cy.baseVal.value))")
    zero = blank.run("Number([...document.querySelectorAll('.measured .grid text')].find((t) => t.textContent === '0'"
                     " && t.getAttribute('text-anchor') === 'end').getAttribute('y'))")
    assert zero < lowest < 225 - 38
    assert blank.run(HEIGHTS)[2] == pytest.approx(lowest - 7, abs=0.2)
    blank.run("document.querySelector('.measured-file').dispatchEvent(new Event('click'))")
    assert blank.run("document.querySelector('.measured-file').files.length") == 0
    blank.run("document.querySelector('.measured-file').dispatchEvent(new Event('change'))")
    settle(blank)
    assert text(blank, ".measured-note") == note
    rows = "Array.from({ length: 2e5 }, (_, i) => `${i};1`).join('\\n')"
    blank.run((GIVEN % "ROWS").replace("'ROWS'", rows))
    blank.wait("document.querySelector('.measured-note').textContent.includes('200000')")
    assert 1000 < blank.run("document.querySelectorAll('.measured .body .measured-own').length") <= 1500
    blank.is_worn = True


def test_of_two_files_the_one_chosen_last_is_shown(blank, story) -> None:
    """A long file that was read later replaced the one that was chosen after it."""
    go(blank, f"{story}#scene=bouncing-ball&lang=en")
    late = "new Promise((done) => setTimeout(() => done(new TextEncoder().encode('0;1\\n1;0\\n2;1').buffer), 150))"
    slow = f"[{{ name: 'slow.csv', arrayBuffer: () => {late} }}]"
    blank.run("(() => { const input = document.querySelector('.measured-file');"
              f" Object.defineProperty(input, 'files', {{ configurable: true, value: {slow} }});"
              " input.dispatchEvent(new Event('change')); delete input.files; })()")
    note, points = blank.run(GIVEN % "0;1\n1;0")
    blank.run("new Promise((done) => setTimeout(done, 250))")
    assert (text(blank, ".measured-note"), points) == (note, 2)
    assert note.startswith("Source: ball.csv, 2 points.")
    blank.is_worn = True


@pytest.mark.parametrize(("typed", "guesses"), [
    ("1,2,3", "1+2+3"), ("1,5 2,5", "1.5+2.5"), ("1.5, 2.5; 3", "1.5+2.5+3"), ("-4 5", "5"),
    ("Ana: 3, Bo: 4.5", "3+4.5"),
    ("https://a.example/p.html#screen=1&lang=en", ""), ("https://a.example/p.html#screen=1&guess=1e9", ""),
    ("#screen=1&guess=-1 #screen=1&guess=2.5", "2.5"), ("#screen=1&guess=3&lang=en 7", "3")])
def test_guesses_of_a_class_are_what_was_typed_or_sent(blank, story, typed, guesses) -> None:
    """1,2,3 was 1.2 and 3, -4 was 4, and a link without a guess was the 1 of its screen."""
    go(blank, f"{story}#screen=1&lang=en")
    blank.run(f"{{ const box = document.querySelector('.class-guesses'); box.value = {typed!r};"
              " box.dispatchEvent(new Event('input', { bubbles: true })); }")
    settle(blank)
    assert len(blank.run(DOTS)) == (guesses.count("+") + 1 if guesses else 0)
    if guesses:
        blank.wait(f"location.hash.includes('guesses={guesses}&')")
    blank.is_worn = True


def test_thirty_links_are_thirty_dots_and_nothing_is_sent_or_stored(own) -> None:
    """Equal links come from different pupils. Junk and impossible heights are ignored, without a network too."""
    turn(own, 1)
    own.call("Network.emulateNetworkConditions", offline=True, latency=0, downloadThroughput=0, uploadThroughput=0)
    own.requests.clear()
    guesses = [1, 2, 2, 2.5, 9, 0.5, *[4] * 18, 3.26, 7, 7, 8, 1.75, 10]
    links = [f"https://school.example/page.html#screen=1&guess={guess}&lang=en" for guess in guesses]
    pasted = " ".join([*links, "https://school.example/", "guess=", "guess=11", "guess=1.2.3", "hello 5"])
    own.run("document.querySelector('.class-box').open = true; document.querySelector('.class-guesses').focus()")
    own.call("Input.insertText", text=pasted)
    settle(own)
    places = own.run(DOTS)
    assert len({tuple(place) for place in places}) == len(guesses) == 30
    width = own.run("document.querySelector('.stage .soft').clientWidth")
    assert all(width / 2 < x < width for x, _ in places)
    own.wait("location.hash.includes('guesses=')")
    assert own.requests == []
    assert own.run("[localStorage.length, sessionStorage.length, document.cookie]") == [0, 0, ""]
    own.call("Network.emulateNetworkConditions", offline=False, latency=0, downloadThroughput=-1, uploadThroughput=-1)
    bundle = assemble.bundle(assemble.LIVE_PARTS[1])
    ways_out = r"\b(?:localStorage|sessionStorage|indexedDB|cookie|fetch|XMLHttpRequest|sendBeacon|WebSocket|caches)\b"
    assert re.findall(ways_out, bundle) == []
