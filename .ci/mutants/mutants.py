"""The mutants of a module, made by Cosmic Ray: its text with one small change each.

Changes made: a whole number plus and minus one; another number doubled and halved; a comparison moved at its edge and
reversed; + and -, * and /, & and |, `and` and `or`, True and False, break and continue exchanged; a minus sign, `~` or `not`
taken away; a condition reversed; a loop's body skipped.

Left out, since no test should pin them: annotations, decorators, a bare `*` among arguments, `assert`, all that a `raise`
statement or an f-string holds (the words of messages and pages), bounds and metadata of pydantic's Field (its default is
changed), `strict` of zip, blocks under TYPE_CHECKING, and numbers up to 1e-6, which only keep a division or a comparison from
failing.
"""

import ast
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cosmic_ray.ast import ast_nodes, get_ast
from cosmic_ray.mutating import mutate_code
from cosmic_ray.operators.operator import Operator
from cosmic_ray.operators.provider import OperatorProvider
from parso.python.tree import Number

ROOT = Path(__file__).resolve().parents[2]
LARGEST_GUARD = 1e-6
EXCHANGES = {
    "ReplaceBinaryOperator": [
        ("Add", "Sub"), ("Sub", "Add"), ("Mul", "Div"), ("Div", "Mul"), ("FloorDiv", "Mul"), ("Mod", "Mul"), ("Pow", "Mul"),
        ("BitAnd", "BitOr"), ("BitOr", "BitAnd"), ("BitXor", "BitAnd"), ("RShift", "LShift"), ("LShift", "RShift"),
    ],
    "ReplaceComparisonOperator": [
        ("Lt", "LtE"), ("Lt", "GtE"), ("LtE", "Lt"), ("LtE", "Gt"), ("Gt", "GtE"), ("Gt", "LtE"), ("GtE", "Gt"), ("GtE", "Lt"),
        ("Eq", "NotEq"), ("NotEq", "Eq"), ("Is", "IsNot"), ("IsNot", "Is"),
    ],
    "ReplaceUnaryOperator": [("Delete", "USub"), ("Delete", "Invert"), ("Delete", "Not")],
}  # fmt: skip
OTHER_CHANGES = (
    "AddNot", "ReplaceTrueWithFalse", "ReplaceFalseWithTrue", "ReplaceAndWithOr", "ReplaceOrWithAnd",
    "ReplaceBreakWithContinue", "ReplaceContinueWithBreak", "ZeroIterationForLoop",
)  # fmt: skip

Position = tuple[int, int]  # line from 1, column from 0


@dataclass(frozen=True, kw_only=True)
class Candidate:
    """A place where an operator can change a module: the occurrence, from 0, of what it changes."""

    file: str
    line: int
    operator: Operator
    occurrence: int


@dataclass(frozen=True, kw_only=True)
class Mutant:
    """One changed module: its file from the project's root, the line of the change, and its text before and with it."""

    file: str
    line: int
    before: str
    text: str


class ScaleNumber(Operator):  # type: ignore[misc]  # Cosmic Ray has no types
    """Doubles and halves numbers that are not whole; puts one for zero."""

    def mutation_positions(self, node: Any) -> Iterator[tuple[Position, Position]]:
        """A position for each change of a number."""
        if isinstance(node, Number) and isinstance(ast.literal_eval(node.value), float):
            for _ in self._changed(node):
                yield node.start_pos, node.end_pos

    def mutate(self, node: Any, index: int) -> Any:
        """The node with a change."""
        return Number(f" {self._changed(node)[index]!r}", node.start_pos)

    def _changed(self, node: Any) -> tuple[float, ...]:
        value = ast.literal_eval(node.value)
        return (2 * value, value / 2) if value else (1.0,)

    @classmethod
    def examples(cls) -> tuple[()]:
        """None."""
        return ()


class ShiftWholeNumber(OperatorProvider()["NumberReplacer"]):  # type: ignore[misc]  # Cosmic Ray has no types
    """Adds one to whole numbers and takes one from them."""

    def mutation_positions(self, node: Any) -> Iterator[tuple[Position, Position]]:
        """A position for each change of a number."""
        if isinstance(node, Number) and isinstance(ast.literal_eval(node.value), int):
            yield from super().mutation_positions(node)


def operators() -> list[Operator]:
    """What changes the code."""
    provider = OperatorProvider()
    exchanges = [f"{kind}_{before}_{after}" for kind, pairs in EXCHANGES.items() for before, after in pairs]
    return [ScaleNumber(), ShiftWholeNumber(), *(provider[name]() for name in (*exchanges, *OTHER_CHANGES))]


def candidates_of(file: str) -> Iterator[Candidate]:
    """Every change of a module that is not left out."""
    source = (ROOT / file).read_text(encoding="utf-8")
    left_out = list(spans_left_out(source))
    nodes = list(ast_nodes(get_ast(source)))
    for operator in operators():
        places = [(node, span) for node in nodes for span in operator.mutation_positions(node)]
        for occurrence, (node, (start, end)) in enumerate(places):
            marks_arguments = node.parent is not None and node.parent.type in {"parameters", "param", "lambdef"}  # a bare *
            if not marks_arguments and not any(first <= start and end <= last for first, last in left_out):
                yield Candidate(file=file, line=start[0], operator=operator, occurrence=occurrence)


def mutants_of(candidates: Iterable[Candidate]) -> Iterator[Mutant]:
    """The candidates' mutants, without those that change nothing, are no Python, or came before."""
    seen = set()
    for candidate in candidates:
        source = (ROOT / candidate.file).read_text(encoding="utf-8")
        text = mutate_code(source, candidate.operator, candidate.occurrence)
        if text not in {None, source} and (candidate.file, text) not in seen and _parses(text):
            seen.add((candidate.file, text))
            yield Mutant(file=candidate.file, line=candidate.line, before=source, text=text)


def _parses(text: str) -> bool:
    try:
        ast.parse(text)
    except SyntaxError:
        return False
    return True


def spans_left_out(source: str) -> Iterator[tuple[Position, Position]]:
    """Beginning and end of each part of the code that is not changed."""
    lines = source.splitlines()

    def column(line: int, byte: int) -> int:
        return len(lines[line - 1].encode()[:byte].decode())

    for node in ast.walk(ast.parse(source)):
        for part in _parts_left_out(node):
            last_line, last_byte = part.end_lineno or part.lineno, part.end_col_offset or 0
            yield (part.lineno, column(part.lineno, part.col_offset)), (last_line, column(last_line, last_byte))


def _parts_left_out(node: ast.AST) -> Iterator[ast.expr | ast.stmt]:
    match node:
        case ast.arg(annotation=ast.expr() as part) | ast.AnnAssign(annotation=part):
            yield part
        case ast.FunctionDef(returns=returns, decorator_list=decorators):
            yield from decorators
            yield from [returns] if returns else []
        case ast.ClassDef(decorator_list=decorators):
            yield from decorators
        case ast.Raise() | ast.Assert() | ast.JoinedStr():
            yield node
        case ast.If(test=ast.Name(id="TYPE_CHECKING")):
            yield node
        case ast.Call(func=ast.Name(id="Field"), keywords=keywords):
            yield from (keyword.value for keyword in keywords if keyword.arg not in {"default", "default_factory"})
        case ast.Call(func=ast.Name(id="zip"), keywords=keywords):
            yield from (keyword.value for keyword in keywords)
        case ast.Constant(value=float() as value) if 0 < value <= LARGEST_GUARD:
            yield node
        case _:
            pass
