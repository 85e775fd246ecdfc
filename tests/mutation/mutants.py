"""Mutants of a module: one small change each, as text for the place of a part of it."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

_COMPARED: dict[type[ast.cmpop], type[ast.cmpop]] = {
    ast.Lt: ast.LtE,
    ast.LtE: ast.Lt,
    ast.Gt: ast.GtE,
    ast.GtE: ast.Gt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.Is: ast.IsNot,
    ast.IsNot: ast.Is,
    ast.In: ast.NotIn,
    ast.NotIn: ast.In,
}
_COMPUTED: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Add,
    ast.Div: ast.Mult,
    ast.FloorDiv: ast.Mult,
    ast.Mod: ast.FloorDiv,
    ast.LShift: ast.RShift,
    ast.RShift: ast.LShift,
    ast.BitAnd: ast.BitOr,
    ast.BitOr: ast.BitAnd,
}
_LONGEST = 100


@dataclass(frozen=True, slots=True)
class Mutant:
    """A module with the characters from ``start`` to ``end`` replaced. What it is known by survives a shift
    of lines: the file, the function, and the statement as it was and as it became."""

    file: str
    function: str
    original: str
    mutant: str
    line: int
    start: int
    end: int
    text: str

    @property
    def key(self) -> tuple[str, str, str, str]:
        """What it is known by."""
        return self.file, self.function, self.original, self.mutant

    def applied(self, source: str) -> str:
        """The text of the module with the change."""
        return source[: self.start] + self.text + source[self.end :]


def mutants_of(root: Path, file: str) -> list[Mutant]:
    """The mutants of a module, in order of their places. Left out is what no test could tell: annotations,
    texts, assertions (they are never false), private numbers of a module (bounds of effort, measures), and
    how often the limits are looked at."""
    source = (root / file).read_text("utf-8")
    finder = _Finder(file, source)
    finder.visit(ast.parse(source))
    found = {(mutant.start, mutant.end, mutant.text): mutant for mutant in finder.found}
    return [found[place] for place in sorted(found)]


def is_change(source: str, mutant: Mutant) -> bool:
    """Whether the changed text is a module, and another one."""
    return ast.dump(ast.parse(mutant.applied(source))) != ast.dump(ast.parse(source))


class _Finder(ast.NodeVisitor):
    def __init__(self, file: str, source: str) -> None:
        self.found: list[Mutant] = []
        self._file = file
        self._source = source
        starts = [0]
        for line in source.splitlines(keepends=True):
            starts.append(starts[-1] + len(line))
        self._starts = starts
        self._lines = source.splitlines(keepends=True)
        self._names: list[str] = []
        self._statements: list[ast.stmt] = []

    # --- where it is ---------------------------------------------------------------------------

    def _offset(self, line: int, column: int) -> int:
        """The place in the text; columns of syntax trees count bytes."""
        return self._starts[line - 1] + len(self._lines[line - 1].encode()[:column].decode())

    def _mutant(self, node: ast.expr | ast.stmt, text: str) -> None:
        assert node.end_lineno is not None
        assert node.end_col_offset is not None
        start = self._offset(node.lineno, node.col_offset)
        end = self._offset(node.end_lineno, node.end_col_offset)
        statement = self._statements[-1]
        first = self._offset(statement.lineno, statement.col_offset)
        head = self._head(statement)
        before, after = self._source[first:start], self._source[end:head]
        self.found.append(
            Mutant(
                self._file,
                ".".join(self._names) or "-",
                _short(before + self._source[start:end] + after),
                _short(before + text + after),
                node.lineno,
                start,
                end,
                text,
            )
        )

    def _head(self, statement: ast.stmt) -> int:
        """Where a statement ends, or its first line does, if others stand in it."""
        body = getattr(statement, "body", None) or getattr(statement, "cases", None)
        if body:
            inner = body[0].pattern if isinstance(body[0], ast.match_case) else body[0]
            return self._offset(inner.lineno, inner.col_offset)
        assert statement.end_lineno is not None
        assert statement.end_col_offset is not None
        return self._offset(statement.end_lineno, statement.end_col_offset)

    def visit(self, node: ast.AST) -> None:
        """Keep in mind the function and the statement."""
        named = isinstance(node, (ast.FunctionDef, ast.ClassDef))
        statement = isinstance(node, ast.stmt)
        if isinstance(node, (ast.FunctionDef, ast.ClassDef)):
            self._names.append(node.name)
        if isinstance(node, ast.stmt):
            self._statements.append(node)
        super().visit(node)
        if statement:
            self._statements.pop()
        if named:
            self._names.pop()

    # --- what is left out ----------------------------------------------------------------------

    def visit_FunctionDef(self, node: ast.FunctionDef) -> None:
        for default in [*node.args.defaults, *node.args.kw_defaults]:
            if default is not None:
                self.visit(default)
        for statement in node.body:
            self.visit(statement)

    def visit_ClassDef(self, node: ast.ClassDef) -> None:
        for statement in node.body:
            self.visit(statement)

    def visit_AnnAssign(self, node: ast.AnnAssign) -> None:
        if node.value is not None and not self._is_bound_of_effort(node.target, node.value):
            self.visit(node.value)

    def visit_Assign(self, node: ast.Assign) -> None:
        if not self._is_bound_of_effort(node.targets[0], node.value):
            self.visit(node.value)

    def _is_bound_of_effort(self, target: ast.expr, value: ast.expr) -> bool:
        private = isinstance(target, ast.Name) and target.id.startswith("_")
        read = {type(node) for node in ast.walk(value)}
        plain = read <= {
            ast.Constant,
            ast.BinOp,
            ast.UnaryOp,
            ast.USub,
            ast.Pow,
            ast.Mult,
            ast.LShift,
            ast.Div,
            ast.Tuple,
            ast.Load,
        }
        return not self._names and private and plain

    def visit_Assert(self, node: ast.Assert) -> None:
        """Never false, by intention."""

    def visit_Raise(self, node: ast.Raise) -> None:
        """Its message is a text."""

    def visit_JoinedStr(self, node: ast.JoinedStr) -> None:
        """Places within are not exact in older versions of Python."""

    # --- changes -------------------------------------------------------------------------------

    def visit_Compare(self, node: ast.Compare) -> None:
        for place, operator in enumerate(node.ops):
            ops = [*node.ops]
            ops[place] = _COMPARED[type(operator)]()
            self._mutant(node, f"({ast.unparse(ast.Compare(node.left, ops, node.comparators))})")
        self.generic_visit(node)

    def visit_BoolOp(self, node: ast.BoolOp) -> None:
        other = ast.Or() if isinstance(node.op, ast.And) else ast.And()
        self._mutant(node, f"({ast.unparse(ast.BoolOp(other, node.values))})")
        self.generic_visit(node)

    def visit_UnaryOp(self, node: ast.UnaryOp) -> None:
        if isinstance(node.op, (ast.Not, ast.USub)):
            self._mutant(node, f"({ast.unparse(node.operand)})")
        self.generic_visit(node)

    def visit_BinOp(self, node: ast.BinOp) -> None:
        other = _COMPUTED.get(type(node.op))
        if other is not None:
            self._mutant(node, f"({ast.unparse(ast.BinOp(node.left, other(), node.right))})")
        self.generic_visit(node)

    def visit_Constant(self, node: ast.Constant) -> None:
        if isinstance(node.value, bool):
            self._mutant(node, str(not node.value))
        elif isinstance(node.value, int):
            self._mutant(node, str(node.value + 1))

    def visit_IfExp(self, node: ast.IfExp) -> None:
        self._mutant(node, f"({ast.unparse(ast.IfExp(node.test, node.orelse, node.body))})")
        self.generic_visit(node)

    def visit_If(self, node: ast.If) -> None:
        if ast.unparse(node.test) == "TYPE_CHECKING" or _looks_at_limits(node):
            return
        for value in ("True", "False"):
            self._mutant(node.test, value)
        self.generic_visit(node)

    def visit_keyword(self, node: ast.keyword) -> None:
        """``strict=True`` is an assertion."""
        if node.arg != "strict":
            self.visit(node.value)

    def visit_comprehension(self, node: ast.comprehension) -> None:
        for condition in node.ifs:
            self._mutant(condition, "True")
        self.generic_visit(node)

    def visit_AugAssign(self, node: ast.AugAssign) -> None:
        other = _COMPUTED.get(type(node.op))
        if other is not None:
            changed = ast.AugAssign(node.target, other(), node.value)
            self._mutant(node, ast.unparse(changed))
        self.generic_visit(node)

    def visit_Expr(self, node: ast.Expr) -> None:
        if isinstance(node.value, ast.Call):
            if ast.unparse(node.value.func) == "assert_never":
                return  # an assertion, which the type checker holds
            self._mutant(node, "pass")
            self.generic_visit(node)

    def visit_Continue(self, node: ast.Continue) -> None:
        self._mutant(node, "pass")

    def visit_Break(self, node: ast.Break) -> None:
        self._mutant(node, "pass")


def _looks_at_limits(node: ast.If) -> bool:
    """Whether all that depends on it is a look at the limits, as in every thousandth round of a loop."""
    return not node.orelse and all(
        isinstance(each, ast.Expr)
        and isinstance(each.value, ast.Call)
        and isinstance(each.value.func, ast.Attribute)
        and each.value.func.attr.startswith("check_")
        for each in node.body
    )


def _short(text: str) -> str:
    """A statement on one line, without the lines after its first colon's; of a long one, both ends."""
    line = " ".join(text.split())
    return line if len(line) <= _LONGEST * 2 else f"{line[:_LONGEST]} … {line[-_LONGEST:]}"


def modules(root: Path, package: str) -> Iterator[str]:
    """The modules of a package, in order of their names."""
    for path in sorted((root / package).rglob("*.py")):
        yield path.relative_to(root).as_posix()
