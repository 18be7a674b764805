"""Tokens of the scripts of the pages.

`tokens` reads a script, `joined` writes it with the fewest characters. The reader covers the scripts of this package:
statements end with a semicolon or a brace. `ValueError` is raised for other scripts that it can recognise, such as
class fields, numbers with a suffix, and statements that end with a line.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

SPACE = re.compile(r"(?:\s+|//[^\n]*|/\*[\s\S]*?\*/)+")
TOKEN = re.compile(
    r"(?P<name>[A-Za-z_$][\w$]*)|(?P<number>(?:0x[\da-fA-F]+|(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?)(?![\w$]))"
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
BEFORE_OPERANDS = KEYWORDS - {"super", "this", "null", "true", "false"}
AFTER_OPERANDS = frozenset(("extends", "in", "instanceof", "of"))
"""Words that can follow an operand without a sign."""
OPENING, CLOSING = frozenset("([{"), frozenset(")]}")
STATEMENT_AFTER = frozenset((";", "{", "}", ")", ":", "else", "do"))
"""Tokens after which a statement can begin."""
MODIFIERS = frozenset(("get", "set", "async", "*"))
"""Words and a sign before the name of a method of an object."""
AFTER_KEYS = frozenset((":", "(", ",", "}", "="))
"""Tokens after the name of a key or of a shorthand."""
BLOCK, OBJECT, CLASS = "block", "object", "class"
CONDITION = "condition"
SHORT = {"const": "let", "true": "!0", "false": "!1", "undefined": "void 0", "Infinity": "1/0"}
"""Words with a shorter equivalent, except as names of properties."""
TIGHT = frozenset(("*", "/", "%", "**", ".", "?."))
"""Signs beside which an equivalent in `SHORT` would need parentheses."""
UNARY = frozenset(("!", "~", "typeof", "void", "await"))
"""Signs and words before which ``1/0`` would need parentheses."""


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
        Of a name: "keyword", "property" (also a key), "shorthand" (of a key and a variable), "label" or "variable".
        Of the bracket that ends a condition of ``if``, ``for`` or ``while``: "condition".
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
    def is_pattern(self) -> bool:
        """Whether this is a regular expression."""
        return self.kind == "text" and self.text.startswith("/")


def tokens(source: str) -> list[Token]:
    """Return the tokens of a script, with the roles of its names."""
    return list(_with_roles(list(_plain_tokens(source))))


def _plain_tokens(source: str) -> Iterator[Token]:
    """Yield tokens without roles."""
    at, brackets, last, operand = 0, [Token("sign", "")], Token("sign", ";"), False
    while True:
        space = SPACE.match(source, at)
        at = space.end() if space else at
        if at == len(source):
            return
        if source[at] == "`" or (source[at] == "}" and brackets[-1].text.endswith("${")):
            found, kind = TEMPLATE.match(source, at + 1), "text"
        elif source[at] == "/" and not operand:
            found, kind = None if last.text == "}" else PATTERN.match(source, at), "text"
        else:
            found = TOKEN.match(source, at)
            kind = found.lastgroup or "" if found else ""
        before, last = last, Token(kind, source[at : found.end()] if found else "")
        is_word = kind in ("name", "number") or last.text[:1] in ("'", '"')
        if found is None or (is_word and last.text not in AFTER_OPERANDS and (
                (operand and before.text not in (")", "}", "get", "set"))
                or (before.text in ("return", "break", "continue", "throw") and space and "\n" in space[0]))):
            raise ValueError(f"A script must consist of known tokens, got {source[at : at + 30]!r}.")
        at = found.end()
        opening = brackets.pop() if last.closes else before
        operand = _is_operand(before, last, opening, operand)
        if last.opens:
            # the bracket of a condition is marked, because a regular expression can follow it
            condition = last.text == "(" and before.text in ("if", "for", "while")
            brackets.append(replace(last, role=CONDITION if condition else ""))
        elif last.closes:
            last = replace(last, role=opening.role)
        yield last


def _is_operand(before: Token, token: Token, opening: Token, after_operand: bool) -> bool:
    """Return whether an operand ends with a token.

    A slash after an operand is a division. A slash after a brace is refused, because a block and an object differ.
    `opening` is the bracket that a closing token belongs to. `after_operand` is whether an operand ends before the
    token.
    """
    if token.kind == "name":
        is_property = before.text in (".", "?.")
        return is_property or (token.text not in BEFORE_OPERANDS and not (
            token.text == "of" and (after_operand or before.text == "}")))
    if token.text in ("++", "--"):
        return after_operand
    if token.kind == "sign":
        return token.text in (")", "]") and opening.role != CONDITION
    return not token.opens


def _with_roles(plain: list[Token]) -> Iterator[Token]:
    """Yield tokens with the roles of names, the innermost bracket, and the depth."""
    stack, questions, classes, after_label, modified = [""], [0], [0], False, False
    for i, token in enumerate(plain):
        before = plain[i - 1] if i else Token("sign", ";")
        after = plain[i + 1] if i + 1 < len(plain) else Token("sign", ";")
        if token.closes:
            stack.pop()
            questions.pop()
            classes.pop()
        role = _role(before, token, after, stack[-1], modified) if token.kind == "name" else token.role
        modified = stack[-1] == OBJECT and token.text in MODIFIERS and after.text not in AFTER_KEYS and (
            modified or before.text in ("{", ","))
        is_statement = stack[-1] in ("", BLOCK) and not questions[-1] and before.text in STATEMENT_AFTER
        if role == "variable" and (before.text in ("break", "continue") or (is_statement and after.text == ":")):
            role = "label"
        if (token.text == "var" and role == "keyword") or (token.text == "=" and stack[-1] == CLASS):
            raise ValueError(f"A script must not contain `var` or fields of classes, got {before.text} {token.text}.")
        yield replace(token, role=role, within=stack[-1], depth=len(stack) - 1)
        classes[-1] += role == "keyword" and token.text == "class"
        is_label = token.text == ":" and stack[-1] in ("", BLOCK) and not questions[-1]
        questions[-1] += (token.text == "?") - (token.text == ":" and questions[-1] > 0)
        if token.opens:
            kind = "${" if token.kind == "text" else token.text
            is_class = kind == "{" and classes[-1] > 0
            classes[-1] -= is_class
            stack.append(kind if kind != "{" else CLASS if is_class else BLOCK if after_label else _brace(before))
            questions.append(0)
            classes.append(0)
        after_label = is_label


def _brace(before: Token) -> str:
    """Return whether a brace after a token begins a block or an object (or a pattern)."""
    if before.kind == "name":
        return BLOCK if before.text in ("else", "try", "finally", "do", "catch") else OBJECT
    return BLOCK if before.text in (")", "=>", ";", "{", "}") else OBJECT


def _role(before: Token, name: Token, after: Token, within: str, is_modified: bool) -> str:
    """Return the role of a name between two tokens.

    `is_modified` is whether words such as `get` before it make it the name of a method of an object.
    """
    if before.text in (".", "?."):
        return "property"
    if within == CLASS:
        is_modifier = name.text in ("get", "set", "static", "async") and after.kind == "name"
        return "keyword" if is_modifier or before.text in ("extends",) else "property"
    is_key = within == OBJECT and before.text in ("{", ",")
    if is_modified and name.text not in KEYWORDS and after.text == "(":
        return "property"
    if is_key and after.text not in AFTER_KEYS:
        return "keyword"
    if name.text in KEYWORDS and not (is_key and after.text in (":", "(")):
        return "keyword"
    if is_key:
        return "property" if after.text in (":", "(") else "shorthand"
    return "keyword" if name.text == "of" and _can_end(before) else "variable"


def _can_end(token: Token) -> bool:
    """Whether an expression can end with a token."""
    if token.kind == "name":
        return token.text not in BEFORE_OPERANDS
    return token.text in CLOSING if token.kind == "sign" else not token.opens


def joined(parts: Sequence[Token]) -> str:
    """Return a script with the fewest spaces and signs that keep its meaning.

    Consecutive declarations are joined, and words with a shorter equivalent are replaced.
    """
    written = [""]
    for text, after_pattern in _shortened(parts):
        last = written[-1][-1:] or ";"
        is_word = re.match(r"[\w$]", text)
        if (is_word and (after_pattern or re.match(r"[\w$]", last))) or (text[0] in "+-/" and last == text[0]) or (
                text[0] == "." and written[-1].isdigit() and text != "...") or (text == "!" and last == "<"):
            written.append(" ")
        if text == "}" and last == ";":
            written.pop()
        written.append(text)
    return "".join(written).replace("</script", "<\\/script")


def _shortened(parts: Sequence[Token]) -> Iterator[tuple[str, bool]]:
    """Yield shortened texts, and whether each follows a regular expression."""
    declares, skipped = [False], -1
    for i, token in enumerate(parts):
        before, after = (parts[j].text if 0 <= j < len(parts) else ";" for j in (i - 1, i + 1))
        is_last_comma = token.text == "," and after in CLOSING and before not in (",", "[")  # those are holes
        if i == skipped or (is_last_comma and token.kind == "sign") or _is_lone(parts, i):
            continue
        if token.closes:
            declares.pop()
        if token.role == "keyword" and token.text in ("const", "let"):
            declares[-1] = True
        if token.opens:
            declares.append(False)
        if token.text == ";" and token.kind == "sign":
            if before == "else" or (i and parts[i - 1].role == CONDITION):
                yield "{}", False  # an empty statement, which cannot be left out
                continue
            if declares[-1] and token.within != "(" and after in ("const", "let"):
                skipped = i + 1
                yield ",", False
                continue
            declares[-1] = False
        yield _short(token, before, after), i > 0 and parts[i - 1].is_pattern


def _short(token: Token, before: str, after: str) -> str:
    if token.kind == "number":
        return re.sub(r"^0(?=\.\d)", "", token.text)
    is_word = token.role in ("keyword", "variable") and token.text in SHORT
    is_tight = {before, after} & TIGHT or (token.text == "Infinity" and before in UNARY)
    return SHORT[token.text] if is_word and not is_tight else token.text


def _is_lone(parts: Sequence[Token], i: int) -> bool:
    """Whether a token is a parenthesis around a single parameter of `=>`."""
    start = i if parts[i].text == "(" else i - 2
    if parts[i].text not in ("(", ")") or parts[i].kind != "sign" or start < 0 or start + 3 >= len(parts):
        return False
    texts = [one.text for one in parts[start : start + 4]]
    return texts[0] == "(" and texts[2:] == [")", "=>"] and parts[start + 1].role == "variable"
