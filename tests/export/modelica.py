"""A reader of Modelica, written from the grammar of its specification: blocks with parameters, states and equations.

It knows what stored definitions, packages, short connectors, component declarations with modifications, and equations
need. `Block.matrices` evaluates the equations, which must be explicit in the derivatives and outputs.
"""

from __future__ import annotations

import re

import numpy as np

TOKEN = re.compile(
    r"""\s*(?:(?P<string>"(?:[^"\\]|\\.)*")|(?P<number>\d+(?:\.\d*)?(?:[eE][+-]?\d+)?)|(?P<name>[A-Za-z_]\w*)"""
    r"""|(?P<sign>\./|\.\*|[-+*/(){}\[\],;=.]))""",
    re.S,
)
KEYWORDS = {"within", "package", "connector", "block", "parameter", "input", "output", "initial", "equation", "end"} | {
    "each", "model", "class", "if", "for", "der", "algorithm", "import", "type", "when", "flow", "final", "record",
}  # fmt: skip


class Reader:
    """A recursive-descent reader of one stored definition."""

    def __init__(self, text):
        self.tokens, at = [], 0
        text = text.rstrip()
        while at < len(text):
            found = TOKEN.match(text, at)
            assert found, f"no token of Modelica at {text[at : at + 40]!r}"
            self.tokens.append((found.lastgroup, found[found.lastgroup]))
            at = found.end()
        self.at = 0

    def see(self, *texts):
        return self.at < len(self.tokens) and self.tokens[self.at][1] in texts

    def take(self, text=None, kind=None):
        got_kind, got = self.tokens[self.at]
        assert text in (None, got), f"{got!r} in place of {text!r}"
        assert kind in (None, got_kind), f"{got!r} is no {kind}"
        self.at += 1
        return got

    def name(self):
        found = self.take(kind="name")
        assert found not in KEYWORDS, f"{found} is a keyword"
        return found

    def comment(self):
        if self.tokens[self.at][0] != "string":
            return ""
        return re.sub(r"\\(.)", r"\1", self.take(kind="string")[1:-1])

    def package(self):
        """Name, comment and blocks of a package."""
        self.take("within"), self.take(";"), self.take("package")
        name, about, blocks, connectors = self.name(), self.comment(), {}, {}
        while not self.see("end"):
            if self.see("connector"):
                self.take()
                connector = self.name()
                self.take("="), connectors.update({connector: self.take(kind="name")})
                self.take("Real"), self.take(";")
                continue
            block = Block(self, connectors)
            assert block.name not in blocks
            blocks[block.name] = block
        self.take("end"), self.take(name), self.take(";")
        assert self.at == len(self.tokens)
        return name, about, blocks

    def value(self):
        """A number, or an array of numbers."""
        if self.see("{"):
            self.take()
            found = [self.value()]
            while self.see(","):
                self.take(), found.append(self.value())
            self.take("}")
            return np.array(found)
        sign = -1.0 if self.see("-") and self.take() else 1.0
        return sign * float(self.take(kind="number"))

    # Expressions are read into functions of the values of all variables.
    def sum(self):
        negative = self.see("-") and self.take()
        found = self.product()
        if negative:
            inner = found
            found = lambda at: -inner(at)  # noqa: E731
        while self.see("+", "-"):
            sign, first, second = self.take(), found, self.product()
            found = lambda at, s=sign, a=first, b=second: a(at) + b(at) if s == "+" else a(at) - b(at)  # noqa: E731
        return found

    def product(self):
        found = self.primary()
        while self.see("*", "/", ".*", "./"):
            sign, first, second = self.take(), found, self.primary()
            found = lambda at, s=sign, a=first, b=second: multiplied(s, a(at), b(at))  # noqa: E731
        return found

    def primary(self):
        if self.see("("):
            self.take()
            inner = self.sum()
            self.take(")")
            return inner
        if self.tokens[self.at][0] == "number":
            number = float(self.take())
            return lambda _: number
        name = self.name()
        if not self.see("("):
            return lambda at: at[name]
        assert name in ("fill", "zeros"), name
        self.take("(")
        arguments = [self.sum()]
        while self.see(","):
            self.take(), arguments.append(self.sum())
        self.take(")")
        if name == "zeros":
            return lambda at: np.zeros(int(arguments[0](at)))
        return lambda at: np.full(int(arguments[1](at)), arguments[0](at))


def multiplied(sign, first, second):
    """The product by the rules of Modelica: * of two vectors is their scalar product, .* is element by element."""
    if sign == "*":
        return float(first @ second) if np.ndim(first) and np.ndim(second) else first * second
    assert sign != "/" or not np.ndim(second)
    if sign in (".*", "./"):
        assert np.shape(first) == np.shape(second)
    return first * second if sign == ".*" else first / second


class Block:
    """A block: its comment, parameters, variables with units, and equations."""

    def __init__(self, reader, connectors):
        reader.take("block")
        self.name, self.about = reader.name(), reader.comment()
        self.sizes, self.units, self.parameters = {}, {}, {}
        self.inputs, self.outputs, self.initial, self.equations = [], [], {}, {}
        while not reader.see("initial", "equation"):
            is_parameter = reader.see("parameter") and bool(reader.take())
            self.component(reader, reader.take(kind="name"), connectors, is_parameter)
        if reader.see("initial"):
            reader.take(), reader.take("equation")
            while not reader.see("equation"):
                self.equation(reader, self.initial)
        reader.take("equation")
        while not reader.see("end"):
            self.equation(reader, self.equations)
        reader.take("end"), reader.take(self.name), reader.take(";")

    def component(self, reader, kind, connectors, is_parameter):
        assert kind == "Real" or kind in connectors
        name, array = reader.name(), reader.see("[")
        assert name not in self.sizes
        size = None
        if array:
            reader.take(), (size := int(reader.take(kind="number"))), reader.take("]")
        reader.take("(")
        assert reader.see("each") == array, "an array has each modification for each of its elements"
        if array:
            reader.take("each")
        reader.take("unit"), reader.take("="), self.units.update({name: reader.comment()}), reader.take(")")
        self.sizes[name] = size
        if is_parameter:
            reader.take("=")
            self.parameters[name] = reader.value()
            assert np.shape(self.parameters[name]) == (() if size is None else (size,))
        {"input": self.inputs, "output": self.outputs}.get(connectors.get(kind), []).append(name)
        reader.comment(), reader.take(";")

    def equation(self, reader, into):
        if reader.see("der"):
            reader.take(), reader.take("("), (name := ("der", reader.name())), reader.take(")")
        else:
            name = reader.name()
        reader.take("=")
        assert name not in into
        into[name] = reader.sum()
        reader.take(";")

    def matrices(self):
        """A, B, C, D by evaluation of the equations, in their order, at unit values of each state and input."""
        states = [name for kind, name in (one for one in self.equations if isinstance(one, tuple))]
        between = [one for one in self.equations if not isinstance(one, tuple) and one not in self.outputs]
        unknown = set(self.sizes) - set(self.parameters) - set(self.inputs)
        assert unknown == {*states, *self.outputs, *between}
        assert {("der", name) for name in states} == set(self.initial)
        counts = [self.sizes[name] or 1 for name in states]
        total = sum(counts)
        columns = []
        for at in range(total + len(self.inputs)):
            unit = np.eye(total + len(self.inputs))[at]
            held = dict(self.parameters) | dict(zip(self.inputs, unit[total:], strict=True))
            ends = np.cumsum([0, *counts])
            held |= {
                name: unit[a:b] if self.sizes[name] else unit[a]
                for name, a, b in zip(states, ends[:-1], ends[1:], strict=True)
            }
            for name, equation in self.equations.items():
                held[name] = equation(held)
            found = [np.atleast_1d(held["der", name]) for name in states]
            assert [len(one) for one in found] == counts
            columns.append(np.concatenate([*found, [held[name] for name in self.outputs]]))
        whole, n = np.array(columns).T, len(self.outputs)
        return whole[:-n, :total], whole[:-n, total:], whole[-n:, :total], whole[-n:, total:]


def read_modelica(text):
    """Name of the package and its blocks."""
    name, _, blocks = Reader(text).package()
    return name, blocks
