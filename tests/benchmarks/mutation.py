"""Small changes of a module's source that its tests ought to notice: one change a mutant."""

import ast
from collections.abc import Callable, Iterator
from dataclasses import dataclass

_COMPARED: dict[type[ast.cmpop], type[ast.cmpop]] = {
    ast.Lt: ast.LtE,
    ast.LtE: ast.Lt,
    ast.Gt: ast.GtE,
    ast.GtE: ast.Gt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.In: ast.NotIn,
    ast.NotIn: ast.In,
    ast.Is: ast.IsNot,
    ast.IsNot: ast.Is,
}
_CALCULATED: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.FloorDiv: ast.Mult,
    ast.Mod: ast.Mult,
    ast.Pow: ast.Mult,
    ast.BitAnd: ast.BitOr,
    ast.BitOr: ast.BitAnd,
    ast.LShift: ast.RShift,
    ast.RShift: ast.LShift,
}
_PAIRED = (
    ("min", "max"),
    ("minimum", "maximum"),
    ("fmin", "fmax"),
    ("nanmin", "nanmax"),
    ("argmin", "argmax"),
    ("erode", "dilate"),
    ("any", "all"),
    ("logical_and", "logical_or"),
    ("floor", "ceil"),
    ("ROUND_FLOOR", "ROUND_CEILING"),
    ("mean", "median"),
)
_RENAMED = {a: b for pair in _PAIRED for a, b in (pair, pair[::-1])} | {"rint": "floor", "round": "int"}
_SIDES = {"left": "right", "right": "left"}
_SHRUNK = 0.8


@dataclass(frozen=True)
class Mutant:
    """A module with one change; `where` is the qualified name of the function, `line` the stripped original line.

    `operator` says what became of what. `source` is the whole text of the changed module.
    """

    module: str
    where: str
    operator: str
    line: str
    source: str

    @property
    def key(self) -> tuple[str, str, str, str]:
        """What it is known by, wherever its line has moved to."""
        return self.module, self.where, self.operator, self.line


def mutants_of(module: str, source: str) -> list[Mutant]:
    """All mutants of a module, in an order that does not depend on where its functions stand.

    Docstrings, annotations, decorators, imports, assertions, texts and what is raised are left alone.
    """
    lines = source.encode().splitlines(keepends=True)
    found = []
    for where, node, operator, text in _changes(ast.parse(source), ""):
        first, last = node.lineno - 1, (node.end_lineno or node.lineno) - 1
        before = b"".join(lines[:first]) + lines[first][: node.col_offset]
        after = lines[last][node.end_col_offset :] + b"".join(lines[last + 1 :])
        changed = (before + text.encode() + after).decode()
        found.append(Mutant(module, where, operator, lines[first].decode().strip(), changed))
    return sorted(found, key=lambda mutant: mutant.key)


Change = tuple[str, ast.expr | ast.stmt, str, str]
"""The qualified name of the function, the node that is replaced, what becomes of what, and the text in its place."""


def _changes(node: ast.AST, where: str) -> Iterator[Change]:
    if isinstance(node, ast.Raise | ast.Assert | ast.JoinedStr) or _names_a_type(node, where):
        return
    if isinstance(node, ast.FunctionDef | ast.ClassDef):
        where = f"{where}.{node.name}".lstrip(".")
    yield from ((where, *change) for change in _CHANGES.get(type(node), _none)(node))
    for name, value in ast.iter_fields(node):
        if name in {"annotation", "returns", "decorator_list", "bases"}:
            continue
        for part in value if isinstance(value, list) else [value]:
            if isinstance(part, ast.AST):
                yield from _changes(part, where)


def _names_a_type(node: ast.AST, where: str) -> bool:
    """Whether it is the alias of a type: an assignment of the module in which no value stands."""
    alias = isinstance(node, ast.Assign) and not where and isinstance(node.value, ast.Subscript | ast.BinOp)
    return alias and not any(isinstance(part, ast.Constant) for part in ast.walk(node))


Changes = Iterator[tuple[ast.expr | ast.stmt, str, str]]


def _none(_: ast.AST) -> Changes:
    yield from ()


def _compared(node: ast.Compare) -> Changes:
    for place, op in enumerate(node.ops):
        other = _COMPARED[type(op)]()
        changed = ast.Compare(node.left, [*node.ops[:place], other, *node.ops[place + 1 :]], node.comparators)
        yield node, _exchanged(op, other), f"({ast.unparse(changed)})"


def _calculated(node: ast.BinOp | ast.AugAssign) -> Changes:
    if type(node.op) in _CALCULATED:
        other = _CALCULATED[type(node.op)]()
        if isinstance(node, ast.AugAssign):
            yield node, _exchanged(node.op, other), ast.unparse(ast.AugAssign(node.target, other, node.value))
        else:
            yield node, _exchanged(node.op, other), f"({ast.unparse(ast.BinOp(node.left, other, node.right))})"


def _joined(node: ast.BoolOp) -> Changes:
    other = ast.Or() if isinstance(node.op, ast.And) else ast.And()
    yield node, _exchanged(node.op, other), f"({ast.unparse(ast.BoolOp(other, node.values))})"


def _unary(node: ast.UnaryOp) -> Changes:
    yield node, f"no {type(node.op).__name__}", f"({ast.unparse(node.operand)})"


def _constant(node: ast.Constant) -> Changes:
    value = node.value
    if isinstance(value, str) and value in _SIDES:
        yield node, f"{value} to {_SIDES[value]}", repr(_SIDES[value])
    elif isinstance(value, int | float) and not isinstance(value, bool):
        yield from ((node, f"{value!r} to {other!r}", f"{other!r}") for other in _other_numbers(value))


def _other_numbers(value: float) -> list[float]:
    if isinstance(value, int):
        return [value + 1, value - 1] if value > 0 else [value + 1]
    return [round(value * _SHRUNK, 12), -value] if value else [1.0]


def _named(node: ast.Name) -> Changes:
    if node.id in _RENAMED:
        yield node, f"{node.id} to {_RENAMED[node.id]}", _RENAMED[node.id]


def _attribute(node: ast.Attribute) -> Changes:
    if node.attr in _RENAMED:
        yield node, f"{node.attr} to {_RENAMED[node.attr]}", f"{ast.unparse(node.value)}.{_RENAMED[node.attr]}"


def _branch(node: ast.If) -> Changes:
    if not node.orelse and isinstance(node.body[-1], ast.Return | ast.Continue | ast.Break):
        yield node.test, "no early end", "False"


def _either(node: ast.IfExp) -> Changes:
    yield node, "branches exchanged", f"({ast.unparse(ast.IfExp(node.test, node.orelse, node.body))})"


def _bounds(node: ast.Slice) -> Changes:
    for bound, sign in ((node.lower, "+"), (node.upper, "-")):
        if bound is not None and not isinstance(bound, ast.Constant):
            yield bound, f"bound {sign} 1", f"({ast.unparse(bound)}) {sign} 1"


def _exchanged(one: ast.AST, other: ast.AST) -> str:
    return f"{type(one).__name__} to {type(other).__name__}"


_CHANGES: dict[type[ast.AST], Callable[..., Changes]] = {
    ast.Compare: _compared,
    ast.BinOp: _calculated,
    ast.AugAssign: _calculated,
    ast.BoolOp: _joined,
    ast.UnaryOp: _unary,
    ast.Constant: _constant,
    ast.Name: _named,
    ast.Attribute: _attribute,
    ast.If: _branch,
    ast.IfExp: _either,
    ast.Slice: _bounds,
}
