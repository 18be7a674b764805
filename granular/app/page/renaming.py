"""Short names for the scripts of the pages.

All modules of a page share one scope. Two kinds of variables get other names:

- names that a module defines at its top level, by one name in the whole script,
- names of parameters and constants, by a name of their own in each statement at the top level and in each method.

Names that differ in a statement differ afterwards, so every name keeps its binding, whatever the scopes are. Names that
are declared nowhere belong to the browser and are kept, as are all properties. A shorthand ``{ name }`` becomes
``{name:a}``.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import chain, count, islice, pairwise, product
from string import ascii_letters

from granular.app.page.script import CLASS, KEYWORDS, Token

SINGLE_LETTERS = 40
"""Number of one-letter names for the whole script."""
COLON = 2
"""Number of characters that a shorthand grows by."""
CONTINUING = frozenset(("else", "catch", "finally", "in", "instanceof", "of"))
"""Words that continue a statement after a closing brace."""
HIDDEN = frozenset(("print", "history", "location", "performance", "document", "window"))
"""Names of the browser. Variables with the same names are kept."""


def renamed(parts: Sequence[Token]) -> list[Token]:
    """Return the tokens of a script with short names of its variables."""
    statements = list(_statements(parts))
    top = {name for part in statements if part[0].depth == 0 for name in _top_names(part)}
    declared = [_declared(part) | top for part in statements]
    free = {token.text for part, names in zip(statements, declared, strict=True) for token in part
            if token.is_variable and token.text not in names}
    uses = Counter(token.text for token in parts if token.is_variable and token.text in top)
    names = chain(islice(_short_names(free), SINGLE_LETTERS), _short_names(free, 2))
    whole = dict(zip((name for name, _ in uses.most_common()), names, strict=False))
    return [token for part, local in zip(statements, declared, strict=True)
            for token in _with_names(part, local - top - HIDDEN, whole)]


def _statements(parts: Sequence[Token]) -> Iterator[list[Token]]:
    """Yield the statements at the top level; of a class its methods one by one."""
    statement: list[Token] = []
    for token, after in zip(parts, [*parts[1:], None], strict=True):
        statement.append(token)
        is_block_end = token.text == "}" and token.kind == "sign"
        first = statement[0].text
        begins = after is not None and after.kind == "name" and not (
            after.text in CONTINUING or (after.text == "while" and first == "do"))
        if (token.depth == 0 and (token.text == ";" or (is_block_end and first in ("function", "async", "class", "}"))
                                  or (is_block_end and (begins or statement[0].depth == 1)))) or (
                is_block_end and token.depth == 1 and token.within == CLASS):
            yield statement
            statement = []
    if statement:
        yield statement


def _declared(part: Sequence[Token]) -> set[str]:
    """Return the constants, functions and parameters that a statement declares."""
    names: set[str] = set()
    closing = _partners(part)
    for i, token in enumerate(part):
        if token.role == "keyword" and token.text in ("const", "let"):
            names |= _after_keyword(part, i, closing)
        elif token.role == "keyword" and token.text in ("function", "class"):
            names |= _name_after(part, i)
            start = next((j for j in range(i + 1, min(i + 4, len(part))) if part[j].text == "("), None)
            if start is not None and token.text == "function":
                names |= _bound(part[start : closing[start] + 1])
        elif token.text == "=>" and part[i - 1].role == "variable":
            names.add(part[i - 1].text)
        elif token.text == "(" and i in closing and part[i - 1].text != "if" and _has_body(part, i, closing[i]):
            names |= _bound(part[i : closing[i] + 1])
    return names


def _name_after(part: Sequence[Token], i: int) -> set[str]:
    """Return the name, if any, of the function or class whose keyword is at `i`."""
    at = i + 2 if part[i + 1].text == "*" else i + 1
    return {part[at].text} if part[at].role == "variable" else set()


def _has_body(part: Sequence[Token], start: int, end: int) -> bool:
    """Whether parentheses contain parameters of a function, a method or `catch`."""
    after = part[end + 1].text if end + 1 < len(part) else ""
    before = part[start - 1]
    return after == "=>" or before.text == "catch" or (after == "{" and before.role == "property")


def _after_keyword(part: Sequence[Token], i: int, closing: dict[int, int]) -> set[str]:
    """Return the names that a declaration with `const` or `let` at `i` declares."""
    names, depth, j, is_name = set(), part[i].depth, i + 1, True
    while j < len(part) and part[j].depth >= depth and part[j].text != ";" and not (
            part[j].text == "of" and part[j].role == "keyword"):
        if is_name and part[j].text in ("{", "["):
            names |= _bound(part[j : closing[j] + 1])
        elif is_name and part[j].role == "variable":
            names.add(part[j].text)
        is_name = part[j].text == "," and part[j].depth == depth
        j = closing.get(j, j) + 1
    return names


def _bound(part: Sequence[Token]) -> set[str]:
    """Return the names that parameters or a pattern bind, without default values."""
    names: set[str] = set()
    value = -1  # depth of the default value that is skipped, if any
    for before, one in pairwise(part):
        if value >= 0 and (one.depth < value or (one.depth == value and one.text == ",")):
            value = -1
        if value < 0 and one.text == "=" and one.kind == "sign":
            value = one.depth
        elif value < 0 and one.is_variable and before.text in ("(", ",", "{", "[", "...", ":"):
            names.add(one.text)
    return names


def _partners(part: Sequence[Token]) -> dict[int, int]:
    """Return the index of the closing bracket by that of the opening one."""
    stack: list[int] = []
    partners: dict[int, int] = {}
    for i, token in enumerate(part):
        if token.closes and stack:
            partners[stack.pop()] = i
        if token.opens:
            stack.append(i)
    return partners


def _top_names(part: Sequence[Token]) -> set[str]:
    """Return the names that a statement declares at the top level."""
    if part[0].text in ("const", "let"):
        return _after_keyword(part, 0, _partners(part))
    start = 1 if part[0].text == "async" and len(part) > 1 else 0
    return _name_after(part, start) if part[start].text in ("function", "class") else set()


def _short_names(taken: set[str], length: int = 1) -> Iterator[str]:
    """Yield names, the shortest first, without those that are taken."""
    for size in count(length):
        for first, *rest in product(ascii_letters + "$_", *[ascii_letters + "$_0123456789"] * (size - 1)):
            name = "".join([first, *rest])
            if name not in taken and name not in KEYWORDS and name not in ("of", "get", "set", "do", "if", "in"):
                yield name


def _with_names(part: list[Token], local: set[str], whole: dict[str, str]) -> Iterator[Token]:
    """Yield the tokens of a statement with short names.

    Names in `whole` get those names. Names in `local` get the shortest that are left, unless shorthands of them cost
    more.
    """
    uses = Counter(token.text for token in part if token.is_variable)
    shorthands = Counter(token.text for token in part if token.role == "shorthand")
    taken = {whole.get(name, name) for name in uses.keys() - local}
    gain = {name: (n - shorthands[name]) * (len(name) - 1) - COLON * shorthands[name] for name, n in uses.items()}
    chosen = [name for name, _ in uses.most_common() if name in local and (gain[name] > 0 or name in taken)]
    taken |= (local & uses.keys()) - set(chosen)
    short = whole | dict(zip(chosen, _short_names(taken), strict=False))
    for token in part:
        name = short.get(token.text, token.text)
        if not token.is_variable or name == token.text:
            yield token
            continue
        if token.role == "shorthand":
            yield replace(token, role="property")
            yield replace(token, kind="sign", text=":", role="")
        yield replace(token, text=name, role="variable")
