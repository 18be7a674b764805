"""Random modules in the subset of JavaScript that the page uses, and their output before and after shortening.

A case consists of two modules: `first.mjs`, whose exports `second.mjs` imports. Both print with the free function
`tell`. Names are drawn from a few, so that most of them are shadowed, and also occur as keys, shorthands, labels and
words in texts and comments.
"""

import json
import random
import subprocess
from pathlib import Path

NAMES = ("speed", "height", "gap", "a", "b", "c", "get", "set", "of", "width", "name", "length")
DRIVER = Path(__file__).with_name("scripts_at_random.mjs")
FOREIGN = ("innerWidth", "devicePixelRatio")
"""Variables of the browser, which are declared nowhere."""


class Writer:
    """Writes one case. `known` are the names of numbers in each scope, `used` those that it may not declare later."""

    def __init__(self, seed):
        self.draw, self.known, self.used, self.count, self.depth = random.Random(seed), [[]], [set()], 0, 0
        self.without, self.labels = [], []

    def one(self, *ways):
        return self.draw.choice(ways)

    def fresh(self):
        """A name that this scope neither has nor has used yet."""
        left = [name for name in NAMES if name not in self.used[-1].union(self.known[-1])]
        return self.draw.choice(left) if left and len(self.known) > 1 else self.top()

    def top(self):
        self.count += 1
        return f"{self.draw.choice(('speedOf', 'long', 'x', 'height'))}{self.count}"

    def variable(self):
        known = dict.fromkeys(name for names in self.known for name in names if name not in self.without)
        name = self.draw.choice([*known, *FOREIGN])
        for used in self.used:
            used.add(name)
        return name

    def inner(self, names, write):
        """What is written in a new scope with further names."""
        self.known.append(list(names))
        self.used.append(set())
        self.depth += 1
        text = write()
        self.known.pop()
        self.used.pop()
        self.depth -= 1
        return text

    def number(self):
        """An expression of a number."""
        x = self.variable
        if self.depth > 3:
            return self.one(x(), "0.5", "3", "1e-3", "0x1f")
        self.depth += 1
        other, name = self.number, self.draw.choice(NAMES)
        text = self.draw.choice([
            lambda: f"({other()} + {other()})", lambda: f"({other()} - -{other()})", lambda: f"{x()} / 2",
            lambda: f"({x()} / {x()} / 3)", lambda: f"({other()} > 1 ? {other()} : .5)",
            lambda: f"({{ {name}: {other()} }}).{name}", lambda: f"({{ {name}: {other()} }})?.{name}",
            lambda: f"[{other()}, , {other()}, ].length", lambda: "[, ].length", lambda: f"[...[{other()}], 2,][0]",
            lambda: f"`{name} ${{{other()}}} /* {name} */ ${{`${{{other()}}}; }}`}}`.length",
            lambda: f"(/[/{name}\\]]\\/ ?;/g.test(\"{name}/ ;\") ? 1 : {other()})",
            lambda: f"(typeof {other()} === 'number' && !Infinity ? 1 : {other()})",
            lambda: f"(true ? {other()} : undefined) /* a {name} // */", lambda: f"({other()} ?? Infinity)",
            lambda: f"(/{name}/ instanceof RegExp ? {other()} : 0)", lambda: f"Math.max({other()}, {other()})",
            lambda: self.called(), lambda: self.object_(),
            lambda: f"((twice) => ({{ {name}: 2 * twice({other()}) }}).{name})((k) => k * 2)",
            lambda: f"(1 <! {x()} ? 1 : 2)",
            lambda: f"(({x()} in {{ {name}: 1 }}) ? 1 : {other()})", lambda: f"((-{x()}) ** 2 % 7)",
        ])()
        self.depth -= 1
        return text

    def parameters(self):
        """Names and text of parameters with patterns and default values."""
        names = self.draw.sample(NAMES, 5)
        first, second, third, fourth, rest = names
        value = self.before(names, self.number)
        other = self.before(names, self.variable)
        text = self.one(
            f"{first}, {{ {second}, {self.draw.choice(NAMES)}: {third} = {value} }} = {{}}, "
            f"[{fourth}, , ...{rest}] = [1, 2]",
            f"{first} = {value}, {second} = [{first}, {other}].length, {third} = 1, "
            f"{{ [`k${{{first}}}`]: {fourth} = 3 }} = {{}}, ...{rest}",
            f"{first} = 1, {second} = (({third}) => {third} + {first})(2), {{ {third} = 4, ...{rest} }} = {{}}, "
            f"{fourth} = 2",
        )
        return names, text

    def before(self, names, write):
        """What is written where names are declared, but have no value yet."""
        outer, self.without = self.without, [*self.without, *names]
        text = write()
        self.without = outer
        return text

    def labelled(self, write):
        """A block with a label that no outer block has."""
        label = self.draw.choice([name for name in NAMES if name not in self.labels])
        self.labels.append(label)
        text = write(label, self.inner([], self.statement))
        self.labels.pop()
        return text

    def function_body(self, names):
        def write():
            statements = "".join(self.statement() for _ in range(self.draw.randrange(3)))
            return f"{statements}return {self.value()};"
        return self.inner(names, write)

    def value(self):
        """An expression whose value is printed whole."""
        name = self.draw.choice(NAMES)
        known = self.draw.choice([one for one in self.known[-1] if "." not in one] or ["innerWidth"])
        return self.one(self.number(), f"[{self.number()}, {{ {known}, {name}1: {self.number()} }}]",
                        f"({{ {known}, }})", f"`{name}: ${{{self.number()}}}`")

    def called(self):
        """A number from a function that is called where it is written."""
        names, text = self.parameters()
        arguments = f"({self.number()}, undefined)"
        body = self.inner(names, self.number)
        if self.draw.random() < 0.3:
            name = self.draw.choice(NAMES)
            return f"(({name}) => {self.inner([name], self.number)})({self.number()})"
        return self.one(f"(({text}) => {body}){arguments}", f"(({text}) => {{ return {body}; }}){arguments}",
                        f"(function {self.one('inner', '')}({text}) {{ return {body}; }}){arguments}")

    def object_(self):
        """A number from an object with a getter, a setter or a method."""
        name, other = self.draw.sample(NAMES, 2)
        names, text = self.parameters()
        body = self.inner(names, self.number)
        return self.one(
            f"({{ get {name}() {{ return {self.number()}; }}, {other}: 2 }}).{name}",
            f"({{ {name}({text}) {{ return {body}; }} }}).{name}({self.number()})",
            f"Object.assign({{ set {name}({other}) {{ tell(\"{name}\", {self.inner([other], self.number)}); }}, }}, "
            f"{{ {name}: {self.number()} }}, {{ if: 1, {other}: 1 }}).{other}",
            f"(({{ {name}: {other}, ...rest }}) => {self.inner([other], self.number)})({{ {name}: 1, true: 2 }})",
            f"(class {{ static {name}({text}) {{ return {body}; }} get {other}() {{ return 1; }} }}).{name}(1)",
        )

    def block(self, names=()):
        length = self.draw.randrange(1, 3)
        return "{ " + self.inner(names, lambda: "".join(self.statement() for _ in range(length))) + "}"

    def statement(self):
        """A statement inside a function, or at the top level if it declares nothing."""
        if self.depth > 3:
            return f"tell({self.value()});\n"
        name, (i, other) = self.draw.choice(NAMES), self.draw.sample(NAMES[:6], 2)
        return self.draw.choice([
            self.declaration, self.declaration, lambda: f"tell({self.value()}); // {name} ' `\n",
            lambda: f"for (let {i} = 0; {i} < 2; {i}++) {self.block([i])}\n",
            lambda: f"for (const [{i}, {other}] of Object.entries({{ {name}: 1 }})) tell({i}, {other});\n",
            lambda: f"for (const {i} of [{self.before([i], self.number)}]) {self.block([i])}\n",
            lambda: f"for (const {{ length: {i} }} of [[1, 2]]) {self.block([i])}\n",
            lambda: self.labelled(lambda at, text: f"{at}: for (;;) {{ {text}if (1) break {at}; else break; }}"),
            lambda: self.labelled(lambda at, text: f"{at}: {{ {text}break {at}; }}\n"),
            lambda: f"if ({self.number()} > 1) {self.block()} else {self.block()}\n",
            lambda: f"if ({self.number()}) tell(1);\nelse ;\n",
            lambda: f"while (!1) ;\ndo {self.block()} while (0);\n",
            lambda: f"try {{ throw {self.number()}; }} catch ({i}) {self.block([i])} finally {self.block()}\n",
            lambda: f"try {{ throw 1; }} catch {self.block()}\n",
            lambda: f"if ({self.number()} < 9) /{name} [}}'\"]/.test('a') || tell({self.number()});\n",
            lambda: f"switch (1) {{ case 1: {{ tell({self.number()}); break; }} default: tell(0); }}\n",
            lambda: f"switch ({self.number()} > 0 ? 1 : 2) {{ case 1: tell(2); default: {self.block()} }}\n",
            lambda: self.counted(),
        ])()

    def counted(self):
        name = self.fresh()
        self.known[-1].append(name)
        return (f"let {name} = 4; {name}++; tell({name}++ / 2, {name}-- / 3, - --{name}, + +{name}); {name} **= 2; "
                f"{name} ||= 1;\n")

    def declaration(self):
        """Declarations of one to three names, for the rest of the scope."""
        kind, value, other = self.one("const", "let"), self.number(), self.number()
        names = []
        for _ in range(3):
            names.append(self.fresh())
            self.known[-1].append(names[-1])
        one, two, three = names
        del self.known[-1][-3:]
        key = self.draw.choice(NAMES)
        text = self.one(
            f"{kind} {one} = {value}, {{ {two} = 2, {key}9: {three} = {other} }} = {{}};\n",
            f"{kind} [{one}, , {two} = {other}, ...[{three} = 5]] = [{value}, 2];\n",
            f"{kind} {one} = {value};\nconst {two} = 1;\nlet {three} = {other};\n",
            f"{kind} {{ {key}: {{ {one}, ...{two}s }}, {key}2: {two} = 6 }} = {{ {key}: {{ {one}: {value} }} }}, "
            f"{three} = 2;\n",
        )
        self.known[-1] += names
        return text

    def at_top(self, export=""):
        """A function, a class, declarations, or a statement at the top level."""
        name, (names, text) = self.top(), self.parameters()
        body, end = self.function_body(names), f"tell({name}({self.number()}));\n"
        kind = self.draw.randrange(6)
        if kind == 0:
            return f"{export}function {name}({text}) {{ {body} }}\n{end}", name
        if kind == 1:
            return f"{export}const {name} = ({text}) => {{ {body} }};\n{end}", name
        if kind == 2:
            return export + self.class_(name, text, body), name
        if kind == 3:
            inside = self.inner([], self.statement)
            return self.one(f"{{ {inside}}}\n", f"if (1) {{ {inside}}}\n"), None
        if kind == 4:
            return f"{export}function* {name}({text}) {{ yield 1; {body} }}\ntell([...{name}(1)]);\n", name
        self.known[0].append(name)
        return f"{export}const {name} = {self.one('1', '2.5')}, {{ length: {name}l }} = \"abc\";\n", name

    def class_(self, name, parameters, body):
        field, other = self.draw.sample(NAMES[:6], 2)
        base = self.one("", " extends Array", " extends class { constructor() { this.k = 1; } }")
        begin, each = "super(); " if base else "", self.inner([field], self.number)
        return (f"class {name}{base} {{\n  constructor({field} = 3) {{ {begin}Object.assign(this, {{ {field} }}); }}\n"
                f"  get {other}() {{ return this.{field} + {self.number()}; }}\n"
                f"  static make({parameters}) {{ {body} }}\n"
                f"  *each({field}) {{ yield {each}; yield* [{field}]; }}\n}}\n"
                f"tell(new {name}({self.number()}).{other}, {name}.make(1), [...new {name}().each(2)]);\n")

    def modules(self):
        """Texts of both modules."""
        parts = [self.at_top("export ") for _ in range(3)]
        first = "".join(text for text, _ in parts) + self.declaration()
        exported = [name for _, name in parts if name]
        numbers = [name for name in exported if name in self.known[0]]
        self.known = [numbers]
        head = f'import {{ {", ".join(exported)} }} from "./first.mjs";\n' if exported else ""
        body = "".join(self.at_top()[0] + self.declaration() for _ in range(3))
        return first, head + body + f"tell({', '.join(self.known[0])});\n"


def outputs(node, cases):
    """Output of each case: of the modules and of the script, or the error."""
    run = subprocess.run([node, DRIVER], input=json.dumps(cases), capture_output=True, text=True, check=True)
    return json.loads(run.stdout)
