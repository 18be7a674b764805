"""Tokens of the scripts of the pages.

`tokens` reads a script, `joined` writes it with the fewest characters. The reader covers the scripts of this package:
statements end with a semicolon or a brace, and a slash after an operand is a division.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

SPACE = re.compile(r"(?:\s+|//[^\n]*|/\*[\s\S]*?\*/)+")
TOKEN = re.compile(
    r"(?P<name>[A-Za-z_$][\w$]*)|(?P<number>(?:0x[\da-fA-F]+|(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?))"
    r"|(?P<text>\"(?:[^\"\\\n]|\\.)*\"|'(?:[^'\\\n]|\\.)*')"
    r"|(?P<sign>\.\.\.|=>|\?\.(?!\d)|\?\?=?|\*\*=?|&&=?|\|\|=?|>>>?=?|<<=?|[=!]==?|\+\+|--|[-+*/%&|^<>]=?|[{}()\[\];,.:?=!~])"
)
PATTERN = re.compile(r"/(?:\[(?:[^\]\\\n]|\\.)*\]|\\.|[^/\\\n\[])+/[a-z]*")
"""Regular expression in a script."""
TEMPLATE = re.compile(r"(?:[^`\\$]|\\[\s\S]|\$(?!\{))*(?:`|\$\{)")
"""Text of a template string, up to its end or to an inserted value."""
KEYWORDS = frozenset((
    "async", "await", "break", "case", "catch", "class", "const", "continue", "default", "delete", "do", "else",
    "extends", "false", "finally", "for", "function", "if", "in", "instanceof", "let", "new", "null", "return",
    "static", "super", "switch", "this", "throw", "true", "try", "typeof", "var", "void", "while", "yield",
))
BEFORE_OPERANDS = KEYWORDS - {"super", "this", "null", "true", "false"} | {"of"}
OPENING, CLOSING = frozenset("([{"), frozenset(")]}")
BLOCK, OBJECT, CLASS = "block", "object", "class"
SHORT = {"const": "let", "true": "!0", "false": "!1", "undefined": "void 0", "Infinity": "1/0"}
"""Words with a shorter equivalent, except as names of properties."""
TIGHT = frozenset(("*", "/", "%", "**", ".", "?."))
"""Signs beside which an equivalent in `SHORT` would need parentheses."""


@dataclass(frozen=True, slots=True)
class Token:
    """Part of a script.

    Parameters
    ----------
    kind : str
        "name", "number", "text" (string, regular expression or part of a template) or "sign".
    text : str
        The characters.
    role : str
        Of a name: "keyword", "property" (also a key), "shorthand" (of a key and a variable) or "variable".
    within : str
        Innermost bracket: "block", "object", "class", "(", "[", "${", or "" outside of brackets.
    depth : int
        Number of open brackets.
    """

    kind: str
    text: str
    role: str = ""
    within: str = ""
    depth: int = 0

    @property
    def opens(self) -> bool:
        """Whether a bracket or an inserted value begins."""
        return self.text in OPENING if self.kind == "sign" else self.kind == "text" and self.text.endswith("${")

    @property
    def closes(self) -> bool:
        """Whether a bracket or an inserted value ends."""
        return self.text in CLOSING if self.kind == "sign" else self.kind == "text" and self.text.startswith("}")

    @property
    def is_variable(self) -> bool:
        """Whether a variable is named."""
        return self.role in ("variable", "shorthand")

    @property
    def is_operand(self) -> bool:
        """Whether an operand can end here."""
        if self.kind == "name":
            return self.text not in BEFORE_OPERANDS
        return self.text in CLOSING if self.kind == "sign" else not self.opens


def tokens(source: str) -> list[Token]:
    """Return the tokens of a script, with the roles of its names."""
    return list(_with_roles(list(_plain_tokens(source))))


def _plain_tokens(source: str) -> Iterator[Token]:
    """Yield tokens without roles."""
    at, braces, last = 0, [""], Token("sign", ";")
    while True:
        space = SPACE.match(source, at)
        at = space.end() if space else at
        if at == len(source):
            return
        if source[at] == "`" or (source[at] == "}" and braces[-1] == "${"):
            found, kind = TEMPLATE.match(source, at + 1), "text"
        elif source[at] == "/" and not last.is_operand:
            found, kind = PATTERN.match(source, at), "text"
        else:
            found = TOKEN.match(source, at)
            kind = found.lastgroup or "" if found else ""
        if found is None:
            raise ValueError(f"A script must consist of known tokens, got {source[at : at + 30]!r}.")
        last = Token(kind, source[at : found.end()])
        at = found.end()
        if last.closes:
            braces.pop()
        if last.opens:
            braces.append("${" if last.kind == "text" else last.text)
        yield last


def _with_roles(plain: list[Token]) -> Iterator[Token]:
    """Yield tokens with the roles of names, the innermost bracket, and the depth."""
    stack, is_class = [""], False
    for i, token in enumerate(plain):
        before = plain[i - 1] if i else Token("sign", ";")
        after = plain[i + 1] if i + 1 < len(plain) else Token("sign", ";")
        if token.closes:
            stack.pop()
        role = _role(before, token, after, stack[-1]) if token.kind == "name" else ""
        yield replace(token, role=role, within=stack[-1], depth=len(stack) - 1)
        is_class = is_class or (role == "keyword" and token.text == "class")
        if token.opens:
            kind = "${" if token.kind == "text" else token.text
            stack.append(kind if kind != "{" else CLASS if is_class else _brace(before))
            is_class = is_class and kind != "{"


def _brace(before: Token) -> str:
    """Return whether a brace after a token begins a block or an object (or a pattern)."""
    if before.kind == "name":
        return BLOCK if before.text in ("else", "try", "finally", "do") else OBJECT
    return BLOCK if before.text in (")", "=>", ";", "{", "}") else OBJECT


def _role(before: Token, name: Token, after: Token, within: str) -> str:
    if before.text in (".", "?."):
        return "property"
    if within == CLASS:
        is_modifier = name.text in ("get", "set", "static", "async") and after.kind == "name"
        return "keyword" if is_modifier or before.text in ("extends",) else "property"
    if name.text in KEYWORDS and not (within == OBJECT and before.text in "{," and after.text == ":"):
        return "keyword"
    if name.text == "of" and before.is_operand:
        return "keyword"
    if within == OBJECT and before.text in ("{", ","):
        if after.text in (":", "("):
            return "property"
        if after.text in (",", "}", "="):
            return "shorthand"
    return "variable"


def joined(parts: Sequence[Token]) -> str:
    """Return a script with the fewest spaces and signs that keep its meaning.

    Consecutive declarations are joined, and words with a shorter equivalent are replaced.
    """
    written: list[str] = []
    for token in _shortened(parts):
        text, last = token, written[-1][-1] if written else ";"
        both_words = re.match(r"[\w$]", text[0]) and re.match(r"[\w$]", last)
        if both_words or (text[0] in "+-" and last == text[0]) or (text[0] == "." and last.isdigit() and text != "..."):
            written.append(" ")
        if text == "}" and last == ";":
            written.pop()
        written.append(text)
    return "".join(written).replace("</script", "<\\/script")


def _shortened(parts: Sequence[Token]) -> Iterator[str]:
    """Yield the texts of tokens, shortened."""
    declares, skipped = [False], -1
    for i, token in enumerate(parts):
        before, after = (parts[j].text if 0 <= j < len(parts) else ";" for j in (i - 1, i + 1))
        if i == skipped or (token.text == "," and after in CLOSING and token.kind == "sign") or _is_lone(parts, i):
            continue
        if token.closes:
            declares.pop()
        if token.role == "keyword" and token.text in ("const", "let"):
            declares[-1] = True
        if token.opens:
            declares.append(False)
        if token.text == ";" and token.kind == "sign":
            if declares[-1] and token.within != "(" and after in ("const", "let"):
                skipped = i + 1
                yield ","
                continue
            declares[-1] = False
        yield _short(token, before, after)


def _short(token: Token, before: str, after: str) -> str:
    if token.kind == "number":
        return re.sub(r"^0(?=\.\d)", "", token.text)
    is_word = token.role in ("keyword", "variable") and token.text in SHORT
    return SHORT[token.text] if is_word and not {before, after} & TIGHT else token.text


def _is_lone(parts: Sequence[Token], i: int) -> bool:
    """Whether a token is a parenthesis around a single parameter of `=>`."""
    start = i if parts[i].text == "(" else i - 2
    if parts[i].text not in ("(", ")") or parts[i].kind != "sign" or start < 0 or start + 3 >= len(parts):
        return False
    texts = [one.text for one in parts[start : start + 4]]
    return texts[0] == "(" and texts[2:] == [")", "=>"] and parts[start + 1].role == "variable"
