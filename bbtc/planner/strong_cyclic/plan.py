"""The strategy ``strong-cyclic``: a policy over partial states that reaches the goal with probability 1,
written down as rules; where there is none, or a limit ends the search for it, the best policy that the search
for P* finds, to which it tells what it learnt."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction

from bbtc.belief.chain import Chain, explore
from bbtc.belief.simulate import success_of
from bbtc.diagnostics import Diagnostic, LimitReached
from bbtc.ground.task import Task
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.planner.best_tree import BestTree
from bbtc.planner.options import DEFAULTS, Options
from bbtc.planner.result import Plan, Progress
from bbtc.planner.strong_cyclic.quotient import quotient_chain
from bbtc.planner.strong_cyclic.rules import Rule, Rules, tree_of
from bbtc.planner.strong_cyclic.solve import Hopeless, Solved, Solver
from bbtc.rewrite.simplify import numbered, size
from bbtc.tree.nodes import ConditionNode, Node, PlanStatus

_FEW_STATES = 200
"""A tree with so many states is simulated in all of them; one with more, in as many as differ in what
matters."""

_FOR_SURE = 0.7
"""Of the time left, what may be spent on the search for a policy that surely reaches the goal."""

_MOST_SHORT = 6
"""How many short trees are tried; each decides as the policy in the states that those before it met."""

_FOR_SHORT = 0.6
"""Of the time left, what may be spent on the short tree while there is none."""


def plan_strong_cyclic(
    task: Task,
    target: Fraction,
    limits: Limits,
    progress: Progress,
    options: Options = DEFAULTS,
) -> Plan:
    """Plan for probability 1, else for P*. Always returns; where a limit is reached, with the best that is
    known by then."""
    goal: Node = numbered(ConditionNode("", task.goal))
    best = BestTree.start(task, target, options.best, goal, limits)
    solver: Solver | None = None
    refused: Diagnostic | None = None
    status: PlanStatus = "stuck"
    try:
        sure = limits.part(_FOR_SURE)
        solver = Solver(task, sure)
        match solver.run():
            case Solved() as solved:
                _keep(best, solver, solved, limits)
            case Hopeless():
                status = "out-of-reach" if target == 1 else "stuck"
    except LimitReached as reached:
        if solver is None:
            refused = reached.diagnostics[0]
    except KeyboardInterrupt:
        status = "interrupted"
    if best.success == 1 or status == "interrupted":
        plan = best.plan(status)
        bounds = (plan.figures.success, Fraction(1))
        return replace(plan, tree=replace(plan.tree, bounds=bounds))
    from bbtc.planner.synthesis.policy import plan_policy

    advice = None if solver is None else _Advice(solver)
    plan = plan_policy(task, target, limits, progress, replace(options, best=best), advice=advice)
    if status == "out-of-reach" and plan.tree.status == "limit-reached":
        plan = replace(plan, tree=replace(plan.tree, status=status))
    return plan if refused is None or plan.stop is None else replace(plan, stop=refused)


def sure_starts(task: Task, limits: Limits) -> list[tuple[Truth, ...]]:
    """The initial states of a task from which a policy surely reaches the goal. Raises ``LimitReached``."""
    solver = Solver(task, limits)
    while isinstance(answer := solver.run(), Hopeless):
        solver.leave_out(answer.state)
    left = set(solver.initial)
    pack = solver.model.packing.pack
    return [each.values for each in task.initial if pack(bytes(each.values)) in left]


class _Advice:
    """What a search for a strong cyclic policy has learnt, for the search for P*."""

    def __init__(self, solver: Solver) -> None:
        self.decisions, self.forbidden = solver.policy, solver.forbidden

    def decide(self, state: int) -> int | None:
        """The action of the first pair that applies."""
        number = self.decisions.decide(state)
        return None if number is None else self.decisions.pairs[number].action

    def forbids(self, state: int, action: int) -> bool:
        """May it lead to a state without strong cyclic policy?"""
        return self.forbidden.forbids(state, action) is not None


def _keep(best: BestTree, solver: Solver, solved: Solved, limits: Limits) -> None:
    """A tree of the policy that is shown to succeed always: a short one, else the plain one."""
    rules = Rules(solver.model, solver.exclusion, solved, limits)
    try:
        for _ in range(_MOST_SHORT):
            chain = _keep_if_sure(best, solver, solved, rules.short(), limits.part(_FOR_SHORT))
            if chain is None:
                return
            if not rules.meet(solver.model.packing.pack(state.values) for state in chain.states):
                break
    except LimitReached:
        limits.check_time("the search for a small tree")
    _keep_if_sure(best, solver, solved, rules.plain(), limits)


def _keep_if_sure(
    best: BestTree, solver: Solver, solved: Solved, rules: Sequence[Rule], limits: Limits
) -> Chain | None:
    """Keep a tree that succeeds always; of another one, return the chain."""
    root = tree_of(solver.task, solver.model, rules)
    limits.check_nodes(size(root))
    chain = chain_of(solver, solved, root, limits)
    success = success_of(chain)
    if success < 1:
        return chain
    best.take(root, chain, success)
    return None


def chain_of(solver: Solver, solved: Solved, root: Node, limits: Limits) -> Chain:
    """The chain of a tree, or where it is large, its quotient."""
    few = min(limits.states, _FEW_STATES)
    if len(solved.visited) <= few:  # the tree gets to all that the policy visits, and maybe more
        try:
            return explore(solver.task, root, replace(limits, states=few))
        except LimitReached:
            limits.check_time("the simulation")
    return quotient_chain(solver.task, root, limits, solver.model, solver.exclusion)
