"""The voice of the story: few words per screen, everyday names first, and no words of the laboratory."""

import re

import pytest

from granular.app.page import assemble
from tests.app.test_page_sentences import jargon

MOST_WORDS, MOST_CHARACTERS = 60, 120
EVERYDAY = {
    "en": ("take no time", "hard spheres", "take time", "soft spheres"),
    "de": ("keine Zeit brauchen", "harte Kugeln", "die Zeit brauchen", "weiche Kugeln"),
    "fr": ("ne durent pas", "sphères dures", "chocs qui durent", "sphères molles"),
    "es": ("no duran nada", "esferas duras", "choques que duran", "esferas blandas"),
    "tr": ("zaman almayan", "sert küreler", "zaman alan", "yumuşak küreler"),
    "zh": ("不需要时间", "硬球", "碰撞需要时间", "软球"),
}
"""Per language: the everyday name of each model, and its name in physics."""


def screen_text(language, screen):
    """The title and the paragraphs of a screen, without marks."""
    words = assemble.words(language)
    keys = [f"s{screen}-{part}" for part in ("title", "a", "b", "c")]
    text = " ".join(words[key] for key in keys if key in words)
    return re.sub(r"\[\[[\w-]+\|([^\]]*)\]\]", r"\1", text)


def length(text, language):
    """Number of words; in Chinese the number of characters and of numbers or foreign words."""
    if language == "zh":
        return len(re.findall(r"[\u3400-\u9fff]|[^\W\u3400-\u9fff]+(?:\.\d+)?", text))
    return sum(bool(re.search(r"\w", word)) for word in text.split())


@pytest.mark.parametrize("language", assemble.LANGUAGES)
def test_a_screen_is_told_in_sixty_words(language) -> None:
    most = MOST_CHARACTERS if language == "zh" else MOST_WORDS
    lengths = [length(screen_text(language, screen), language) for screen in range(7)]
    assert min(lengths) > 10
    assert max(lengths) <= most, lengths


@pytest.mark.parametrize("language", assemble.LANGUAGES)
def test_models_have_everyday_names_first(language) -> None:
    """The screen of the guess names them, before the answer and the labels of the stage do."""
    told = "\n".join(screen_text(language, screen) for screen in range(7))
    words = assemble.words(language)
    for everyday, name, key in zip(EVERYDAY[language][::2], EVERYDAY[language][1::2], ("hard-", "soft-"), strict=True):
        assert words[f"{key}spheres"] == name
        assert everyday in screen_text(language, 1)
        assert 0 <= told.index(everyday) < told.lower().index(name.lower())


@pytest.mark.parametrize("language", assemble.LANGUAGES)
def test_words_of_the_laboratory_are_not_in_the_story(language) -> None:
    told = "\n".join(screen_text(language, screen) for screen in range(7))
    assert [word for word in jargon(language) if word in told] == []
    assert [word for word in jargon("en") if word in told] == []
