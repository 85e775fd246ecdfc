"""Exporter ``prism``: a tree and its task as a Markov chain in the language of PRISM and Storm."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from typing_extensions import assert_never

from bbtc.backends.exporter import Figures, Option, OptionValue
from bbtc.backends.names import Namer, snake
from bbtc.ground.task import Task
from bbtc.limits import Limits
from bbtc.printable import printable
from bbtc.tree.nodes import Tree
from bbtc.verifier.chain import MOST_WRITTEN, Form, chain_of
from bbtc.verifier.naming import Names
from bbtc.verifier.partial import partial_process_of
from bbtc.verifier.prism import END, KEYWORDS, counted, prism_text
from bbtc.verifier.process import process_of
from bbtc.verifier.program import REWARDS, Cell, Formula, Program

FORM = Option(
    "form",
    "auto",
    "auto: a step for each action, in deep trees for each leaf; walk: for each leaf",
    ("auto", "walk"),
)


@dataclass(frozen=True, slots=True)
class PrismExporter:
    """The chain that ``bbtc verify`` solves. Deterministic."""

    name: str = "prism"
    description: str = "Markov chain of the tree and its task for the model checkers PRISM and Storm"
    suffix: str = ".prism"
    options: tuple[Option, ...] = (FORM,)

    def export(
        self,
        tree: Tree,
        options: Mapping[str, OptionValue],
        figures: Figures | None,  # noqa: ARG002 - of other exporters
    ) -> str:
        """The chain as text."""
        return _text(tree_program(tree, options))


prism = PrismExporter()


def tree_program(tree: Tree, options: Mapping[str, OptionValue], most_written: int = MOST_WRITTEN) -> Program:
    """The chain in the form that the options ask for; ``most_written`` as in :func:`chain_of`."""
    form: Form | None = "walk" if options["form"] == "walk" else None
    return chain_of(tree.task, tree.root, form, most_written=most_written)


def task_text(task: Task) -> str:
    """The decision process of a task: what any policy could do."""
    return _text(process_of(task))


def partial_task_text(task: Task, limits: Limits) -> str:
    """The partially observable decision process of a task: what any policy could do that sees what the robot
    sees. Raises as :func:`partial_process_of` does."""
    return _text(partial_process_of(task, limits))


def _text(program: Program) -> str:
    return prism_text(program, readable_names(program), tuple(_preamble(program)))


def _preamble(program: Program) -> Iterator[str]:
    what = "a tree and its task" if program.kind == "dtmc" else "a task"
    yield f"{printable(program.title)}: {what}. Values of variables: 0 false, 1 unknown, 2 true."
    if program.kind != "dtmc":
        yield 'The best that any policy can do: Pmax=? [F "goal"]'
        return
    asked = [f'P=? [F "{end}"]' for end in ("success", "failure", "blocked")]
    asked += [f'R{{"{REWARDS[number]}"}}=? [F "finished"]' for number in counted(program)]
    yield f"Properties: {', '.join(asked)}"
    yield "N_starts: the tick starts the action of node N; N_success, N_failure: what node N returns."


# --- names -----------------------------------------------------------------------------------


def readable_names(program: Program) -> Names:
    """Identifiers made of the names in the domain, by the rules of :mod:`bbtc.backends.names`; two that
    would be equal, even ignoring case, are told apart by a digest."""
    namer = Namer({*KEYWORDS, *REWARDS, *(label for label, _ in program.labels), "tree", "task", "here"})

    def take(base: str, seed: str) -> str:
        return namer.take(base.replace(END, "end_module"), seed=seed)

    actions = sorted({command.action for command in program.commands if command.action is not None})
    return Names(
        cells=tuple(take(_cell(cell), f"{cell.kind} {cell.subject}") for cell in program.cells),
        formulas=tuple(
            take(_formula(formula), f"{formula.aspect} {formula.subject}") for formula in program.formulas
        ),
        actions={action: take(f"do_{snake(action)}", f"action {action}") for action in actions},
        cell_remarks=tuple(printable(cell.meaning) for cell in program.cells),
        command_remarks=tuple(printable(command.remark) for command in program.commands),
    )


def _cell(cell: Cell) -> str:
    match cell.kind:
        case "variable" | "number" | "control":
            return snake(cell.subject)
        case "done" | "attempts" | "possible" | "told":
            return f"{cell.kind}_{snake(cell.subject)}"
        case "fact":
            return f"really_{snake(cell.subject)}"
        case "pending":
            return f"next_{snake(cell.subject)}"
        case _:
            assert_never(cell.kind)


def _formula(formula: Formula) -> str:
    return f"{snake(formula.subject) if formula.subject else 'now'}_{formula.aspect}"
