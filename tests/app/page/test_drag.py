"""What a screen is about is dragged in its picture: by mouse, finger and keyboard, and by a slider as well."""

import pytest

import granular as gr
from tests.app.page.driving import last_picture, settle, slide, text, turn

KNOB = """
(() => { const grip = document.querySelector('.%s .grip-%s');
  const b = grip.querySelector('.grip-disc').getBoundingClientRect();
  return [b.x + b.width / 2, b.y + b.height / 2, Math.min(b.width, b.height)]; })()
"""
VALUE = "document.querySelector('.%s .grip-%s').getAttribute('aria-%s')"
DRAGS = [  # screen, view, what, pixels to drag, and the setting before and within which limits it is afterwards
    (2, "hard", "height", (0, -40), "1 m", (1.1, 1.9)), (3, "hard", "m2", (25, 0), "1 g", (0.005, 0.5)),
    (4, "soft", "t1", (0, 20), "12 ms", (1e-4, 5e-3)), (4, "hard", "gap", (0, -30), "1 mm", (0.02, 0.09)),
    (3, "hard", "gap", (0, -30), "1 mm", (0.02, 0.1)), (6, "soft", "gap", (0, -30), "1 µm", (0.02, 0.09)),
]


@pytest.mark.parametrize(("way", "width", "height"), [("mouse", 1366, 768), ("touch", 390, 844)])
def test_what_is_dragged_stays_under_the_finger(page, way, width, height) -> None:
    page.size(width, height, mobile=width < 500)
    for screen, view, what, by, before, (least, most) in DRAGS:
        turn(page, screen)
        settle(page)
        assert page.run(VALUE % (view, what, "valuetext")) == before
        x, y, size = page.run(KNOB % (view, what))
        assert size >= 44.0
        getattr(page, way)(x, y, to=(x + by[0], y + by[1]))
        settle(page)
        assert least < float(page.run(VALUE % (view, what, "valuenow"))) < most, (screen, what)
        at = page.run(KNOB % (view, what))
        along = 1 if by[0] == 0 else 0
        assert at[along] - (x, y)[along] == pytest.approx(by[along], abs=1.5), (screen, what)
        assert page.run("scrollY") == 0


def test_everything_dragged_is_a_slider_for_keys_and_beside_the_picture(page) -> None:
    for screen, label, what, key, after in [
        (2, "drop height", "height", "ArrowUp", "1.05 m"), (3, "upper ball: mass", "m2", "ArrowRight", "1.1 g"),
        (4, "lower ball: contact time on the floor", "t1", "End", "30 ms"),
        (6, "gap between the balls", "gap", "Home", "0, touching"),
    ]:
        turn(page, screen)
        settle(page)
        grip = f"document.querySelector('.grip-{what}[role=slider]')"
        page.run(f"{grip}.focus()")
        assert page.run(f"{grip}.ariaLabel") == label
        page.key(key)
        settle(page)
        assert page.run(f"{grip}.getAttribute('aria-valuetext')") == after == text(page, f"output[for=slider-{what}]")
        page.wait(f"location.hash.includes('{what}=')")


def test_a_heavier_ball_is_drawn_larger_and_rises_less_as_two_collisions_say(page) -> None:
    """A real ball has the size and the mass that it has: its edge is no handle."""
    turn(page, 3)
    slide(page, "m2", 800)
    mass = float(page.run(VALUE % ("hard", "m2", "valuenow")))
    big = page.run("document.querySelectorAll('.hard .ball')[1].getBoundingClientRect().width")
    ratio = mass / gr.balls.BALLS["basketball"].mass
    rise = ((3.0 - ratio) / (1.0 + ratio)) ** 2  # of two elastic collisions, in drop heights
    assert float(text(page, ".gauge-value.hard")) == pytest.approx(rise, rel=5e-3)
    assert last_picture(page)[0][-1] == pytest.approx(rise, rel=5e-3)
    page.run("document.querySelector('[data-preset=masses]').click()")
    settle(page)
    assert page.run("document.querySelectorAll('.hard .ball')[1].getBoundingClientRect().width") < big
    assert page.run("document.querySelector('.grip-m2')") is None


def test_heights_of_one_ball_are_in_metres(page) -> None:
    """It comes back to 0.67 m of 1 m, and to twice that of 2 m."""
    turn(page, 2)
    page.run("document.querySelector('.grip-height').focus()")
    page.key("End")
    settle(page)
    hard, soft = last_picture(page)
    assert hard == pytest.approx([2 * 0.82**2], rel=5e-3)
    assert soft == pytest.approx(hard, rel=0.02)
    assert text(page, ".hard .ruler").endswith("m0: basketball at rest")


def test_the_heaviest_ball_can_be_made_lighter_again(page) -> None:
    """By the hand that still holds it, past the end and back, and by keys."""
    turn(page, 3)
    settle(page)
    x, y, _ = page.run(KNOB % ("hard", "m2"))
    hold = {"button": "left", "buttons": 1, "y": y}
    page.call("Input.dispatchMouseEvent", type="mousePressed", x=x, clickCount=1, **hold)
    masses = []
    for pixels in (400, 500, 20):
        page.call("Input.dispatchMouseEvent", type="mouseMoved", x=x + pixels, **hold)
        settle(page)
        masses.append(float(page.run(VALUE % ("hard", "m2", "valuenow"))))
    page.call("Input.dispatchMouseEvent", type="mouseReleased", x=x + 20, y=y, button="left", clickCount=1)
    assert masses[0] == masses[1] == 0.62
    assert masses[2] < 0.1
    page.run("document.querySelector('.grip-m2').focus()")
    for key in ("End", "ArrowLeft"):
        page.key(key)
        settle(page)
    assert float(page.run(VALUE % ("hard", "m2", "valuenow"))) == pytest.approx(0.62 / 1.1, rel=2e-3)


def test_a_drag_ends_with_its_screen(page) -> None:
    turn(page, 3)
    settle(page)
    x, y, _ = page.run(KNOB % ("hard", "m2"))
    page.call("Input.dispatchMouseEvent", type="mousePressed", x=x, y=y, button="left", buttons=1, clickCount=1)
    turn(page, 5)
    settle(page)
    page.call("Input.dispatchMouseEvent", type="mouseMoved", x=x + 50, y=y, button="left", buttons=1)
    page.call("Input.dispatchMouseEvent", type="mouseReleased", x=x + 50, y=y, button="left", clickCount=1)
    settle(page)
    assert page.run(VALUE % ("hard", "gap", "valuetext")) == "1 mm"
