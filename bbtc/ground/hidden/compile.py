"""The belief compilation: from a physical task to one whose conditions read knowledge only."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence, Set
from dataclasses import dataclass, replace
from fractions import Fraction

from bbtc.collector import collector_paused
from bbtc.diagnostics import BbtcError, Report
from bbtc.diagrams import Diagram, TooManyNodes
from bbtc.ground import task as gt
from bbtc.ground.condition import FALSE, TRUE, Condition, Constant, Is, compile_condition, variables
from bbtc.ground.condition_diagram import diagrams_of
from bbtc.ground.hidden.changes import Local, act, divided, join, read_after, telling
from bbtc.ground.hidden.derived_tests import with_asked
from bbtc.ground.hidden.failing import may_fail
from bbtc.ground.hidden.given import contradicts
from bbtc.ground.hidden.groups import Groups
from bbtc.ground.hidden.knowledge import KnownConditions, TooManyCases
from bbtc.ground.hidden.naming import formula_names
from bbtc.ground.hidden.parts import Setting, all_settings, effects_of, facts_of, settings_of
from bbtc.ground.hidden.physical import Draw, Physical, physical
from bbtc.ground.hidden.priors import Said, prior_diagram
from bbtc.ground.hidden.relevance import relevant
from bbtc.ground.hidden.uncertain import hidden_facts
from bbtc.ground.hidden.worlds import TooManyWorlds, Worlds, given_true
from bbtc.ground.pruning.renumber import reordered
from bbtc.ground.start import contradicted
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.model import domain as md
from bbtc.rounding import short_text
from bbtc.source import Span

_MOST_NAMED = 4


def hidden_task(model: md.Model, report: Report, limits: Limits) -> gt.Task:
    """The task of a model with hidden state. Raises as :func:`bbtc.ground.instantiate.ground` does."""
    with collector_paused():
        model, asked = with_asked(model)
        found = physical(model, report, limits)
        if model.may_fail:
            found = may_fail(found)
        return _Compiler(model, asked, found, report, limits).task()


@dataclass(frozen=True, slots=True)
class _Read:
    """What the final task reads of what is known."""

    goal: Condition
    preconditions: list[Condition]
    knowledge: KnownConditions


class _Compiler:
    def __init__(
        self, model: md.Model, asked: frozenset[str], found: Physical, report: Report, limits: Limits
    ) -> None:
        self._model = model
        self._tests = {
            number: condition
            for number, (condition, _) in found.thresholds.items()
            if found.task.variables[number].predicate in asked
        }
        """By variable that stands for a derived fact whose knowledge is asked for: what that is."""
        self._found = found
        self._report = report
        self._limits = limits
        hidden = hidden_facts(found)
        self._doubt(hidden)
        kept, names = relevant(found, hidden)
        self._hidden = hidden & kept
        self._kept = kept
        odds = dict(_odds(found.draws))
        self._acts = [
            act(action, found.readings.get(action.name, ()), kept, self._hidden, odds)
            for action in found.task.actions
            if action.name in names
        ]
        self._groups = Groups(self._hidden)
        self._draws = [draw for draw in found.draws if self._hidden.issuperset(draw.variables)]
        clauses = [
            (given_true(clause.condition, found.start, found.uncertain), clause.span)
            for clause in found.clauses
        ]
        self._clauses = [each for each in clauses if self._hidden.issuperset(variables(each[0]))]
        self._check_what_does_not_matter(hidden - kept, clauses)
        for draw in self._draws:
            self._groups.join(draw.variables)
        for condition, _ in self._clauses:
            self._groups.join(variables(condition))
        self._thresholds = dict(self._asked_beliefs())
        report.raise_errors()
        for condition, _ in self._thresholds.values():
            self._groups.join(variables(condition))
        self._told_first = list(self._at_first())
        self._draws_of: dict[int, list[Draw]] = {}
        self._clauses_of: dict[int, list[tuple[Condition, Span | None]]] = {}
        self._first_of: dict[int, list[gt.Observation]] = {}
        join(self._groups, self._acts, self._told_first)

    def _doubt(self, hidden: frozenset[int]) -> None:
        """Warn of observations that tell nothing, whatever the arguments."""
        for name, read in self._found.read.items():
            if not read & hidden:
                self._report.warning(
                    "BBT0417",
                    f"`:observe` of action `{name}` tells nothing: what it reads is always seen",
                    self._model.schemas[name].observe_span,
                    "say in `:init` what is not known, as `(unknown (p))` or `(oneof …)`",
                )

    def _asked_beliefs(self) -> Iterator[tuple[int, tuple[Condition, Fraction]]]:
        """The thresholds that matter. What they ask has to be hidden."""
        for number, (condition, at_least) in self._found.thresholds.items():
            if number not in self._kept or number in self._tests:
                continue
            every = self._found.task.variables
            seen = [every[each].name for each in variables(condition) if each not in self._hidden]
            if seen:
                self._report.error(
                    "BBT0420",
                    f"`believed` is about hidden facts, and {seen[0]} is seen",
                    self._model.thresholds[every[number].predicate].span,
                    "ask for what is seen in a condition of its own",
                )
            yield number, (condition, at_least)

    def _at_first(self) -> Iterator[gt.Observation]:
        """What sensors tell at the start; whether they do, as far as that is seen, is settled."""
        for reading in telling(self._found.first, self._hidden):
            when = given_true(reading.when or TRUE, self._found.start, self._hidden)
            if when != FALSE:
                yield replace(reading, when=None if when == TRUE else when)

    def _check_what_does_not_matter(
        self, left: Set[int], clauses: Sequence[tuple[Condition, Span | None]]
    ) -> None:
        """Report a contradiction of the start among facts that are left out, or are all given."""
        for condition, span in clauses:
            if condition == FALSE:
                contradicted(self._report, span or self._model.init.span)
                return
        draws = [draw for draw in self._found.draws if not left.isdisjoint(draw.variables)]
        others = [each for each in clauses if not left.isdisjoint(variables(each[0]))]
        groups = Groups(left)
        for together in (*(draw.variables for draw in draws), *(variables(each) for each, _ in others)):
            groups.join(together)
        by_group: dict[int, tuple[list[Draw], list[tuple[Condition, Span | None]]]] = {}
        for draw in draws:
            by_group.setdefault(groups.of(draw.variables[0]), ([], []))[0].append(draw)
        for each in others:
            by_group.setdefault(groups.of(next(variables(each[0]))), ([], []))[1].append(each)
        for facts in groups.all():
            mine, said = by_group.get(groups.of(facts[0]), ([], []))
            worlds = Worlds(facts, {}, mine, [condition for condition, _ in said], self._limits)
            try:
                empty = worlds.contradict()
            except TooManyWorlds:
                local = Local(facts)
                holds = [local.condition(condition) for condition, _ in said]
                start = Said({fact: local.variable(fact) for fact in facts}, {}, mine, holds)
                empty = self._diagram(start, [self._name(fact) for fact in facts], ()) is None
            if empty:
                contradicted(self._report, (said[0][1] if said else None) or self._model.init.span)

    def task(self) -> gt.Task:
        """The task whose conditions read knowledge."""
        read = self._read()
        facts = {self._groups.of(each[0]): each for each in self._groups.all()}
        numbers = {leader: (number, each) for number, (leader, each) in enumerate(facts.items())}
        actions = []
        for each, precondition in zip(self._acts, read.preconditions, strict=True):
            factors, changes = divided(each, self._groups, numbers)
            actions.append(replace(each.action, precondition=precondition, factors=factors, changes=changes))
        templates = tuple(self._template(template, read.knowledge) for template in self._found.task.templates)
        made = replace(
            self._found.task,
            variables=self._variables(read.knowledge),
            goal=read.goal,
            actions=tuple(actions),
            templates=templates,
        )
        asked = set(_asked(made))
        self._assign()
        together = _read_together(made, [len(each) for each in facts.values()])
        components = [
            self._component(each, read.knowledge, asked, together[number])
            for number, each in enumerate(facts.values())
        ]
        self._report.raise_errors()
        values = [*self._found.start, *[Truth.UNKNOWN] * len(read.knowledge.formulas)]
        for number, (condition, _) in self._thresholds.items():
            if isinstance(condition, Constant):
                values[number] = Truth.of(condition == TRUE)
        for component in components:
            for variable, value in _known_at_first(component):
                values[variable] = value
        true_worlds = tuple(self._true_worlds(components))
        made = replace(
            made,
            components=tuple(components),
            true_worlds=true_worlds,
            initial=(gt.InitialState(Fraction(1), tuple(values)),),
        )
        last = len(self._found.task.variables)
        order = [
            number
            for number in range(len(made.variables))
            if (number in asked if number in self._hidden or number >= last else number in self._kept)
            and number not in self._tests
        ]
        return reordered(made, sorted(order, key=lambda number: made.variables[number].name))

    def _assign(self) -> None:
        """Give draws, conditions and what is told at first to their components."""
        for draw in self._draws:
            if draw.variables:
                self._draws_of.setdefault(self._groups.of(draw.variables[0]), []).append(draw)
        for condition, span in self._clauses:
            leader = next((self._groups.of(variable) for variable in variables(condition)), None)
            if leader is not None:
                self._clauses_of.setdefault(leader, []).append((condition, span))
            elif condition == FALSE:
                contradicted(self._report, span)
        for reading in self._told_first:
            leader = next(self._groups.of(each) for each in read_after([reading]) if each in self._groups)
            self._first_of.setdefault(leader, []).append(reading)

    def _true_worlds(self, components: Iterable[gt.Component]) -> Iterator[gt.TrueWorld]:
        """What is true in simulated runs, as far as it is hidden and matters."""
        components = list(components)
        hidden = {fact for component in components for fact in component.facts}
        for said in self._model.true_worlds:
            named = [(gt.ground_name(fact.predicate, fact.args), fact) for fact in said]
            mine = [(name, fact) for name, fact in named if name in hidden]
            world = gt.TrueWorld(
                frozenset(name for name, fact in mine if fact.value is Truth.TRUE),
                frozenset(name for name, fact in mine if fact.value is Truth.FALSE),
            )
            for component in components:
                if contradicts(component, world):
                    span = next(fact.span for name, fact in mine if name in component.facts)
                    told = "what is said to be true at the start cannot be, by what is said to be known then"
                    hint = "runs begin in a world that can be"
                    self._report.warning("BBT0431", told, span, hint)
            yield world

    # --- conditions --------------------------------------------------------------------------

    def _read(self) -> _Read:
        """All conditions on what is known, once the components they need are joined."""
        task = self._found.task
        while True:
            self._limits.check_time("grounding")
            knowledge = KnownConditions(self._groups, task.variables, self._tests)
            goal = self._known(knowledge, task.goal, task.goal_span)
            preconditions = [
                self._known(knowledge, each.action.precondition, each.action.span) for each in self._acts
            ]
            for template in task.templates:
                self._template(template, knowledge)
            if not knowledge.joined:
                return _Read(goal, preconditions, knowledge)

    def _known(
        self, knowledge: KnownConditions, condition: Condition, span: Span | None, *, truth: bool = True
    ) -> Condition:
        try:
            return knowledge.known(condition, truth=truth)
        except TooManyCases:
            raise BbtcError.single(
                "BBT0416",
                "this condition mixes too many visible facts with hidden ones",
                span,
                "say what is hidden in a condition of its own, as a derived predicate",
            ) from None

    def _template(self, template: gt.GroundTemplate, knowledge: KnownConditions) -> gt.GroundTemplate:
        """A template whose conditions read knowledge; what its guide makes true becomes known."""

        def body(part: gt.Body) -> gt.Body:
            if isinstance(part, gt.BodyControl):
                return replace(part, children=tuple(map(body, part.children)))
            if isinstance(part, gt.BodyCondition):
                return replace(
                    part, condition=self._known(knowledge, part.condition, template.span, truth=False)
                )
            return part

        def outcome(each: gt.Outcome) -> gt.Outcome:
            settings = [
                Setting(None if s.when is None else self._known(knowledge, s.when, template.span), *s[1:])
                for s in settings_of(each)
            ]
            inner = tuple(map(factor, each.factors))
            return replace(each, effects=effects_of(settings), factors=inner)

        def factor(each: gt.Factor) -> gt.Factor:
            return replace(each, outcomes=tuple(map(outcome, each.outcomes)))

        return replace(
            template,
            precondition=self._known(knowledge, template.precondition, template.span),
            factors=tuple(map(factor, template.factors)),
            body=body(template.body),
        )

    # --- variables and components ------------------------------------------------------------

    def _variables(self, knowledge: KnownConditions) -> tuple[gt.Variable, ...]:
        declared = self._model.predicates
        made = [
            replace(
                self._named(number, variable),
                three_valued=number in self._hidden or declared[variable.predicate].declared_three_valued,
                hidden=number in self._hidden or number in self._thresholds,
            )
            for number, variable in enumerate(self._found.task.variables)
        ]
        names = formula_names(made, list(knowledge.formulas))
        return (*made, *(gt.Variable(name, (), three_valued=True, hidden=True) for name in names))

    def _named(self, number: int, variable: gt.Variable) -> gt.Variable:
        """The variable; one that stands for what is believed under a name for people."""
        threshold = self._model.thresholds.get(variable.predicate)
        if threshold is None or number not in self._thresholds:
            return variable
        called = f"believed-{threshold.called}"
        if threshold.called == "formula":
            called += f"-{list(self._model.thresholds).index(variable.predicate) + 1}"
        called = gt.unused_name(called, self._model.predicates)
        args = (*variable.args, short_text(threshold.at_least))
        return replace(variable, predicate=called, args=args)

    def _component(
        self,
        facts: Sequence[int],
        knowledge: KnownConditions,
        asked: set[int],
        together: Iterable[Sequence[int]],
    ) -> gt.Component:
        self._limits.check_time("listing worlds")
        mine, start = set(facts), self._found.start
        leader = self._groups.of(facts[0])
        draws, clauses = self._draws_of.get(leader, []), self._clauses_of.get(leader, [])
        given = {fact: start[fact] is Truth.TRUE for fact in facts if fact not in self._found.uncertain}
        names = list(map(self._name, facts))
        local = Local(facts)
        diagram = None
        try:
            prior = Worlds(facts, given, draws, [each for each, _ in clauses], self._limits).all()
        except TooManyWorlds:
            prior = {}
            places = {fact: local.variable(fact) for fact in facts}
            holds = [local.condition(each) for each, _ in clauses]
            diagram = self._diagram(Said(places, given, draws, holds), names, together)
        if not prior and diagram is None:
            spans = [span for _, span in clauses if span is not None]
            contradicted(self._report, spans[0] if spans else self._model.init.span)
            prior = {0: Fraction(1)}
        known = [gt.Knowledge(fact, local.condition(Is(fact, Truth.TRUE))) for fact in facts if fact in asked]
        known += [
            gt.Knowledge(number, local.condition(formula))
            for formula, number in knowledge.formulas.items()
            if mine.issuperset(variables(formula)) and number in asked
        ]
        known += [
            gt.Knowledge(number, local.condition(condition), at_least)
            for number, (condition, at_least) in self._thresholds.items()
            if number in asked and not isinstance(condition, Constant)
            if mine.issuperset(variables(condition))
        ]
        first = tuple(map(local.observation, self._first_of.get(leader, ())))
        return gt.Component(
            tuple(names), tuple(prior.items()), tuple(known), first, tuple(local.seen), diagram
        )

    def _name(self, variable: int) -> str:
        return self._found.task.variables[variable].name

    def _diagram(self, said: Said, names: Sequence[str], together: Iterable[Sequence[int]]) -> Diagram | None:
        """The prior of a component with too many worlds to be listed; None if there is no world."""
        try:
            return prior_diagram(said, together, self._limits)
        except TooManyNodes:
            listed = ", ".join(f"`{name}`" for name in names[:_MOST_NAMED])
            more = f" and {len(names) - _MOST_NAMED} more" if len(names) > _MOST_NAMED else ""
            raise BbtcError.single(
                "BBT0415",
                f"the hidden facts {listed}{more} depend on each other in too many ways: what is known of "
                f"them takes more than {self._limits.diagram_nodes:,} nodes of a decision diagram",
                self._model.init.span or self._model.problem_span,
                "facts that no draw, condition, effect or observation joins are tracked apart",
            ) from None


def _odds(draws: Iterable[Draw]) -> Iterator[tuple[int, Fraction]]:
    """The facts that have a draw of their own, with their probabilities."""
    for draw in draws:
        if len(draw.variables) == 1:
            (variable,) = draw.variables
            whole = sum((weight for weight, _ in draw.branches), Fraction(0))
            yield variable, sum((weight for weight, true in draw.branches if true), Fraction(0)) / whole


def _read_together(task: gt.Task, sizes: Sequence[int]) -> list[dict[tuple[int, ...], None]]:
    """By component: the local facts that an observation reads, or an action's effects read and set."""
    found: list[dict[tuple[int, ...], None]] = [{} for _ in sizes]
    for action in task.actions:
        for change in action.changes:
            read = [read_after([each]) for each in change.observations]
            read.append(set().union(*map(facts_of, change.factors)))
            for each in read:
                found[change.component][tuple(sorted(at for at in each if at < sizes[change.component]))] = (
                    None
                )
    return found


def _known_at_first(component: gt.Component) -> Iterator[tuple[int, Truth]]:
    """What the prior tells."""
    for each, chance in zip(component.known, _chances(component), strict=True):
        yield each.variable, each.value(chance.numerator, chance.denominator)


def _chances(component: gt.Component) -> Iterator[Fraction]:
    """How likely each condition is of which something is known."""
    if component.diagram is not None:
        diagrams = diagrams_of(component)
        yield from (Fraction(*diagrams.share(diagrams.prior, each.condition)) for each in component.known)
        return
    worlds = [
        (bytes(2 * (world >> place & 1) for place in range(len(component.facts))), probability)
        for world, probability in component.prior
    ]
    for each in component.known:
        value = compile_condition(each.condition)
        yield sum((p for world, p in worlds if value(world) == Truth.TRUE), Fraction(0))


def _asked(task: gt.Task) -> Iterator[int]:
    """The variables that conditions of a task read, and that its changes see."""
    yield from variables(task.goal)
    for action in task.actions:
        yield from variables(action.precondition)
        yield from _guards(action.factors)
        for change in action.changes:
            yield from change.seen
    for template in task.templates:
        yield from variables(template.precondition)
        yield from _guards(template.factors)
        yield from (setting.variable for setting in all_settings(template.factors))
        for part in gt.walk_body(template.body):
            if isinstance(part, gt.BodyCondition):
                yield from variables(part.condition)


def _guards(factors: Iterable[gt.Factor]) -> Iterator[int]:
    for effect in gt.effects_of(factors):
        if effect.when is not None:
            yield from variables(effect.when)
    for charge in gt.charges_of(factors):
        yield from variables(charge.when)
