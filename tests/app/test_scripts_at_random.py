"""Scripts of the pages are shortened without a change of meaning, or refused: random modules, and each known trap."""

import shutil
from functools import cache

import pytest

from granular.app.page import assemble, renaming, script
from tests.helpers.scripts_at_random import Writer, outputs

NODE = shutil.which("node")
needs_node = pytest.mark.skipif(NODE is None, reason="node is not installed: scripts are not run here")

TRAPS = [
    "const { sqrt } = Math, box = { wide: 2 * sqrt(4), low: 1, high: 3 * sqrt(9) }; tell(box);",
    "tell([1, , ].length, [, ].length, [, 2, ].length);",
    "const zero = 0; tell(!Infinity, typeof Infinity, ~Infinity);",
    "let count = 6; const half = 2; tell(count++ / half, count-- / half);",
    "const box = { of: 6, in: 8 }, two = 2; tell(box.of / two, box.in / two);",
    "if (1) /wide ;}/.test('a') || tell(1); const wide = 3; tell(wide);",
    "tell(/wide/ instanceof RegExp, 8 / /2/.source);",
    "const height = 1, other = { get height() { return height; }, set wide(height) { tell(height); } }; "
    "other.wide = 2; tell(other.height);",
    "const height = 1, other = { async height() { return 1; }, *wide() { yield height; } }; tell([...other.wide()]);",
    "const other = (height) => tell(height); switch (1) { case 1: { other(2); break; } }",
    "const other = (height) => tell(height); label: { other(3); break label; }",
    "function fall(height) { try { throw 1; } catch { tell(height); height = 2; } return height; } tell(fall(3));",
    "class Wide extends Array { get height() { return this.length; } } tell(new Wide(3).height);",
    "const Low = class extends Array { }; tell(new Low(2).length);",
    "const get = 2, wide = 1; class Low extends class { } { get wide() { return wide; } } tell(new Low().wide, get);",
    "tell(1); innerWidth = 3; tell(innerWidth);",
    "const fall = (height, wide = [height, innerWidth, 1]) => wide; tell(fall(1));",
    "if (1) { tell(1); } const wide = 2; function fall() { return wide; } tell(fall());",
    "for (const one of [1]) tell(one); { tell(2); } let wide = 3; const fall = () => wide; tell(fall());",
    "function fall(count) { while (count-- > 0) ; } tell(fall(2)); if (0) tell(1); else ; { if (1) ; }",
    "const two = 2, of = 4; tell(of / two, of / 4);",
    "const box = { true() { return 1; }, delete(height) { return height; } }; tell(box.true(), box.delete(2));",
    "const height = 2; tell(1 <! height, height - -height, `a${{ height }.height}b`);",
]


def shortened(*modules):
    bare = [assemble.EXPORT_PATTERN.sub("", assemble.IMPORT_PATTERN.sub("", module)) for module in modules]
    return script.joined(renaming.renamed(script.tokens("\n".join(bare))))


@needs_node
@pytest.mark.parametrize("seeds", [range(20), pytest.param(range(20, 220), marks=pytest.mark.soak)], ids=["20", "200"])
def test_random_modules_print_the_same_after_they_are_shortened(seeds):
    modules = [Writer(seed).modules() for seed in seeds]
    cases = [[*each, shortened(*each)] for each in modules]
    found = outputs(NODE, cases)
    assert [seed for seed, (before, after) in zip(seeds, found, strict=True) if before != after] == []
    whole = [before for before, _ in found if before and before[-1].startswith("[")]
    assert len(whole) == len(cases)  # none ends with an error
    assert sum(map(len, whole)) > 8 * len(cases)
    assert sum(len(short) for *_, short in cases) < 0.85 * sum(len(text) for each in modules for text in each)


@needs_node
@pytest.mark.parametrize("number", range(len(TRAPS)))
def test_a_trap_is_kept(number):
    before, after = traps()[number]
    assert before == after
    assert before[-1].startswith("[")


@cache
def traps():
    return outputs(NODE, [["", source, shortened(source)] for source in TRAPS])


@pytest.mark.parametrize("source", [
    "const a = 1n;", "const a = 1_000;", "const a = 0b1;", "class A { field = 1; }", "class A { #own() { } }",
    "var a = 1;", "const a = b\nc = 2;", "const f = () => { return\n1; };", "{ } /a/.test(b);", "a = b 2;",
])
def test_what_is_not_understood_is_refused(source):
    with pytest.raises(ValueError, match="A script must "):
        script.tokens(source)
