"""A task as a Markov decision process: any policy may pick any action whose precondition is true."""

from __future__ import annotations

from fractions import Fraction

from bbtc.ground.condition import variables
from bbtc.ground.task import Task
from bbtc.verifier.conditions import where_true
from bbtc.verifier.outcomes import MOST_BRANCHES, Outcomes, relevant
from bbtc.verifier.program import Branch, Command, Drafting, Program, all_of, none_of
from bbtc.verifier.start import write_start

_ZERO, _ONE = Fraction(0), Fraction(1)


def process_of(task: Task, most_branches: int = MOST_BRANCHES) -> Program:
    """The decision process. States in which the goal is true are final; in those in which no
    action can start, no command is enabled. Label ``goal``: the goal is true."""
    read = set(variables(task.goal))
    for action in task.actions:
        read.update(variables(action.precondition))
    draft = Drafting()
    start = write_start(task, relevant(task, task.actions, read), draft)
    outcomes = Outcomes(draft, start.cell_of, most_branches)
    outcomes.prepare(task.actions, task)
    between = all_of(start.begun, outcomes.idle)
    won = draft.define("goal", "true", where_true(task.goal, start.cell_of))
    commands = []
    for action in task.actions:
        guard = all_of(between, none_of(won), where_true(action.precondition, start.cell_of))
        branches = outcomes.branches(action, [])
        if any(branch.updates for branch in branches):  # others never change anything
            commands.append(Command(action.name, guard, branches))
    stay = Branch(_ONE, (), (_ZERO, _ZERO, _ZERO))
    final = Command(None, all_of(between, won), (stay,), "the goal is reached")
    return Program(
        kind="mdp",
        title=f"{task.domain}/{task.problem}",
        cells=tuple(draft.cells),
        formulas=tuple(draft.formulas),
        commands=(*start.commands, *commands, *outcomes.commands, final),
        labels=(("goal", all_of(between, won)),),
    )
