"""The film of the teaching page, the guess before it and the ball that is dragged: what is shown is what is told."""

import pytest

from tests.app.page.driving import click, fresh, go, last_picture, settle, text, turn


def gauges(tab):
    """Heights of the top ball, hard and soft, as they stand beside the balls that are dragged."""
    return [text(tab, f".gauge-value.{engine}") for engine in ("hard", "soft")]


@pytest.mark.rotating
@pytest.mark.parametrize("way", ["mouse", "touch", "keyboard"])
def test_a_guess_is_dragged_and_held_against_both(page, way) -> None:
    page.media(prefers_reduced_motion="reduce")  # the film is its last picture
    turn(page, 1)
    assert page.run("document.querySelector('.run').disabled")
    assert not page.run("document.querySelector('.verdict').checkVisibility()")
    x, y = page.middle(".stage .soft")
    if way == "keyboard":
        page.run("document.querySelector('.soft .grip').focus()")
        for _ in range(20):
            page.key("ArrowUp")
        guess = 3.0
    else:
        getattr(page, way)(x, y + 100, to=(x, y))
        guess = page.run("Number(document.querySelector('.soft .grip').getAttribute('aria-valuenow'))")
        assert 3.0 < guess < 7.0
    page.mouse(*page.middle(".run"))
    settle(page)
    assert text(page, ".told") == (
        f"You guessed {guess:g} m. Hard spheres give 3.95, soft spheres 2.32. "
        f"You were nearer to the {'hard' if guess > 3.135 else 'soft'} spheres."
    )
    click(page, "[data-cause=losses]")
    assert text(page, ".why-answer").startswith("No: both models lose energy")
    click(page, "[data-cause=overlap]")
    assert text(page, ".why-answer").startswith("Yes: the upper ball presses while the floor still pushes")
    page.media()


FASTER = """
const now = performance.now.bind(performance), begin = now();
performance.now = () => begin + 6 * (now() - begin);
requestAnimationFrame = ((frame) => (f) => frame(() => f(performance.now())))(requestAnimationFrame);
window.seen = [];
new MutationObserver(() => {
  const pace = document.querySelector('.slowdown').textContent, told = document.querySelector('.told').textContent;
  if (window.seen.at(-1)?.[0] !== pace) window.seen.push([pace, told]);
}).observe(document.querySelector('.slowdown'), { childList: true, characterData: true, subtree: true });
"""  # six times


def test_the_answer_comes_when_the_film_has_ended(own) -> None:
    turn(own, 1)
    own.run(FASTER)
    x, y = own.middle(".stage .soft")
    own.mouse(x, y)
    own.mouse(*own.middle(".run"))
    own.wait("document.querySelector('.told').textContent.startsWith('You guessed')")
    paces, told = zip(*own.run("window.seen"), strict=True)
    shown = [pace.replace("\u00a0", " ") for pace in paces]
    assert [pace for pace in shown if pace != "time stands still"] == ["slowed 420 ×", "in real time"]
    assert set(told) <= {"", "Watch the film to its end."}
    assert own.run("Number(document.querySelector('.time-bar').value)") == 2000


@pytest.mark.parametrize(
    ("state", "hard", "soft"),
    [("screen=4", [0.296, 3.95], [0.529, 2.32]),
     ("scene=ball-stack", None, None),
     ("scene=real-balls&m2=0.0027&r2=0.02&t2=0.0008&e2=0.88&air2=0&bounces=2&gap=0", [None, 2.58], [None, 3.63])],
)
def test_the_last_picture_shows_how_high_each_ball_rises(page, story, state, hard, soft) -> None:
    """The soft top ball of the stack was once shown at 15.0 drop heights, and told at 1.12."""
    go(page, f"{story}#{state}")
    told = [text(page, f".figure:nth-child(2) .{engine}") for engine in ("hard", "soft")]
    seen = last_picture(page)
    for ticks, asked in zip(seen, (hard, soft), strict=True):
        assert all(want is None or tick == want for tick, want in zip(ticks, asked or [None] * 3, strict=True))
    if state.startswith("scene"):
        assert [ticks[-1] for ticks in seen] == [float(height) for height in told]
    ruler, balls = page.run(RULER), page.run(LOWEST)
    per_drop = (ruler[0][1] - ruler[-1][1]) / (ruler[-1][0] - ruler[0][0])
    shown = [(ruler[0][1] - low) / per_drop for low in balls]
    assert shown == pytest.approx([ticks[-1] for ticks in seen], abs=2.5 / per_drop)  # pixels: the rim is drawn outside


RULER = """
[...document.querySelectorAll('.stage .hard .ruler-tick')].filter((t) => /^[\\d.]+$/.test(t.textContent))
  .map((t, i) => [Number(t.textContent),
                  document.querySelectorAll('.stage .hard .ruler line')[i].getBoundingClientRect().top])
"""
LOWEST = """
[...document.querySelectorAll('.stage .ball:last-child .face')].map((ball) => ball.getBoundingClientRect().bottom)
"""


@pytest.mark.parametrize("width", [1366, 390])
def test_less_motion_is_a_still_that_gives_nothing_away(page, story, width) -> None:
    """It was the last picture: the answer to the question below it."""
    page.size(width, 800)
    page.media(prefers_reduced_motion="reduce")
    go(page, f"{story}#screen=0")
    for _ in range(2):
        assert 0 < page.run("Number(document.querySelector('.time-bar').value)") < 1000
        assert page.run("document.querySelectorAll('.stage .soft .top-line').length") == 0
        low = page.run("document.querySelector('.stage .soft .ball:first-child .face').getBoundingClientRect().top")
        top = page.run("document.querySelector('.stage .soft .ball:last-child .face').getBoundingClientRect().bottom")
        assert abs(top - low) < 12  # pixels
        click(page, ".play")
    page.media()


FLAT = """
[...document.querySelectorAll('.stage .%s .ball:first-child')].map((ball) => {
  const cut = ball.querySelector('clipPath rect'), place = ball.getAttribute('transform');
  const height = Number(/ ([-\\d.]+)\\)/.exec(place)[1]);
  return [height + Number(cut.getAttribute('y')) + Number(cut.getAttribute('height')),
          Number(document.querySelector('.stage .%s .floor').getAttribute('y1')),
          height + Number(/ ([-\\d.]+)\\)/.exec(ball.querySelector('.face').getAttribute('transform'))[1])];
})[0]
"""


def test_a_ball_that_is_pressed_in_is_flat_where_it_touches(blank, story) -> None:
    go(blank, f"{story}#screen=4&at=0.45")
    cut, floor, bottom = blank.run(FLAT.replace("%s", "soft"))
    assert cut == pytest.approx(floor, abs=0.02)
    assert bottom > floor + 5.0  # pixels that are pressed in


GRIP = """
(() => { const b = document.querySelector('.hard .grip-disc').getBoundingClientRect();
         return [b.x + b.width / 2, b.y + b.height / 2]; })()
"""
HELD = "document.querySelector('.hard .grip').getAttribute('aria-valuetext')"


@pytest.mark.rotating
@pytest.mark.parametrize("way", ["mouse", "touch", "keyboard"])
def test_the_ball_is_dragged_until_both_agree(page, way) -> None:
    turn(page, 5)
    settle(page)
    told = "No: hard spheres promise the top ball 3.95 m, soft ones 2.32; the error is 24 %."
    assert text(page, ".verdict") == told
    assert text(page, ".because-line") == (
        "The push between floor and basketball lasts 12.9 ms. 88 % of it happens while basketball and tennis ball touch"
        " too.")
    assert text(page, ".soft .guess-text") == "v tc = 53 mm"
    x, y = page.run(GRIP)
    if way == "keyboard":
        page.run("document.querySelector('.hard .grip').focus()")
        page.key("End")
    else:
        getattr(page, way)(x, y, to=(x, y - 48))
    settle(page)
    assert 0.04 < float(page.run(HELD).removesuffix(" mm")) * 1e-3 < 0.08
    hard, soft = map(float, gauges(page))
    assert soft == pytest.approx(hard, rel=0.03)
    assert text(page, ".verdict").startswith("Yes: hard spheres promise")
    assert "It is over when" in text(page, ".because-line")
    page.wait("location.hash.includes('gap=')")
    go(page, page.run("location.href").replace("screen=5", "scene=real-balls"))
    assert text(page, ".verdict").startswith("Yes")


WITHIN = """
Math.max(...['.grip-disc', '.gauge-value.hard', '.gauge-value.soft', '.verdict']
  .map((selector) => document.querySelector(selector).getBoundingClientRect().bottom))
"""


@pytest.mark.rotating
@pytest.mark.parametrize(("width", "height", "most"), [(1366, 768, 700), (1280, 800, 700), (390, 844, 844)])
def test_what_is_dragged_and_what_answers_it_are_seen_together(page, width, height, most) -> None:
    page.size(width, height, mobile=width < 500)
    turn(page, 5)
    settle(page)
    assert page.run("scrollY") == 0
    assert page.run(WITHIN) <= most


def test_a_table_tennis_ball_flies_at_the_second_bounce(page) -> None:
    turn(page, 6)
    settle(page)
    assert gauges(page) == ["5.54", "0.719"]
    page.mouse(*page.middle("[data-name=bounces] label:nth-of-type(2)"))
    settle(page)
    assert gauges(page)[1] == "3.63"
    assert "100 %" not in text(page, ".because-line")  # the reason is that of the second bounce
    assert [ticks[-1] for ticks in last_picture(page)] == [float(height) for height in gauges(page)]
    page.wait("document.querySelector('.spread').textContent.replace('\u00a0', ' ').includes('3.6 to 3.8 m')")


def test_a_pair_of_balls_offers_the_gap_that_is_enough(page) -> None:
    turn(page, 6)
    for pair in ("golf ball+table-tennis ball", "steel ball+small steel ball"):
        page.run(f"document.querySelector('[data-preset=\"{pair}\"]').click()")
        settle(page)
        assert text(page, ".verdict").startswith("No: hard spheres promise")
        page.mouse(*page.middle(".apart"))
        settle(page)
        assert text(page, ".verdict").startswith(("Yes: hard spheres promise", "No, but nearly"))


HEARD = """
window.heard = [];
const start = OscillatorNode.prototype.start;
OscillatorNode.prototype.start = function (when) {
  window.heard.push(this.frequency.value);
  return start.call(this, when);
};
"""


@pytest.mark.rotating
def test_four_clicks_are_heard_against_one(own, story) -> None:
    go(own, f"{story}#scene=newtons-cradle&eps=1&gap=0&n=5&k=1e7&lang=en")
    own.run(HEARD)
    own.run(FASTER)
    click(own, ".play")
    own.wait("document.querySelector('.time-bar').value === '2000'")
    assert own.run("window.heard") == []  # silent until it is asked for
    own.mouse(*own.middle(".sound-button"))
    assert text(own, ".notice").startswith("Hard on the left, soft on the right")
    click(own, ".restart")
    click(own, ".play")
    own.wait("document.querySelector('.time-bar').value === '2000'")
    assert own.run("window.heard.filter((pitch) => pitch > 1000).length") == 4
    assert own.run("window.heard.length") == 5
    own.mouse(*own.middle(".sound-button"))
    assert text(own, ".notice") == ""


def test_a_guess_stays_in_the_link_on_every_screen(own, story) -> None:
    """It was lost with the next screen, so a class sent links without guesses."""
    turn(own, 1)
    x, y = own.middle(".stage .soft")
    own.mouse(x, y + 100, to=(x, y))
    guess = own.run("Number(document.querySelector('.soft .grip').getAttribute('aria-valuenow'))")
    for state in ("screen=2", "screen=6", "scene=real-balls"):
        turn(own, state.removeprefix("screen=") if "screen" in state else 7)
        own.wait(f"location.hash.startsWith('#{state}') && location.hash.includes('&guess={guess:g}')")
    sent = own.run("location.hash")
    click(own, ".predict-button")  # a guess in the laboratory is another one
    own.run("{ const bar = document.querySelector('.guess'); bar.value = 100; bar.dispatchEvent(new Event('input')); }")
    settle(own)
    own.wait(f"location.hash.includes('&guess={guess:g}')")
    fresh(own, f"{story}#screen=3&guess={guess:g}&lang=en")
    turn(own, 1)
    settle(own)
    assert own.run("document.querySelector('.run').disabled") is False
    assert own.run("Number(document.querySelector('.soft .grip').getAttribute('aria-valuenow'))") == guess
    assert text(own, ".stage .soft .guess-text") == f"your guess: {guess:g}"
    own.run("document.querySelector('.class-box').open = true; document.querySelector('.class-guesses').focus()")
    own.call("Input.insertText", text=f"https://school.example/page.html{sent} guess=11")
    settle(own)
    assert own.run("document.querySelectorAll('.stage .soft .dot').length") == 1
    go(own, f"{story}#screen=1&guess=eleven&lang=en")
    assert own.run("document.querySelector('.run').disabled")


COVERED = """
[...document.querySelectorAll('.stage > svg')].flatMap((view) => {
  const boxes = (kind) => [...view.querySelectorAll(kind)].map((one) => one.getBoundingClientRect());
  const meet = (a, b) => a.left < b.right && b.left < a.right && a.top < b.bottom && b.top < a.bottom;
  return boxes('.ball-name, .face, .top-value').filter((one) => boxes('.dot').some((dot) => meet(one, dot)));
}).length
"""


def test_the_guesses_of_a_class_stay_beside_the_ball(page, story) -> None:
    """Eight dots at one height covered the name of the ball, when two pictures stood side by side."""
    page.size(1366, 768)
    page.media(prefers_reduced_motion="reduce")
    go(page, f"{story}#screen=1&guess=3&guesses={'4 ' * 30}&lang=en")
    page.mouse(*page.middle(".run"))
    settle(page)
    assert page.run("document.querySelectorAll('.stage .dot').length") == 60
    assert page.run(COVERED) == 0
    page.media()
