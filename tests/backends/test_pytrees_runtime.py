"""What exported py_trees modules stand on: set-up, interruption, beliefs, and the robot to start from."""

from __future__ import annotations

import types
from collections.abc import Iterator
from dataclasses import replace
from fractions import Fraction
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bbtc.backends.names import module_name
from bbtc.backends.registry import load_exporter, parse_options
from bbtc.diagnostics import BbtcError
from bbtc.ground.condition import Is
from bbtc.ground.task import InitialState
from bbtc.kleene import Truth
from bbtc.runtime import Beliefs, Condition, Latch, StopWhenBlocked, Try, retry, run, sequence, skipper
from bbtc.tree.nodes import ActionNode, ControlNode, Tree
from tests.strategies import HOSTILE_NAMES, soda_tree, trees

py_trees = pytest.importorskip("py_trees")
Status = py_trees.common.Status


@pytest.fixture(autouse=True)
def _empty_blackboard() -> Iterator[None]:
    py_trees.blackboard.Blackboard.clear()
    yield
    py_trees.blackboard.Blackboard.clear()


class Recorder:
    """A robot with one action that never ends, which records what it hears."""

    def __init__(self) -> None:
        self.heard: list[object] = []

    def setup(self, **kwargs: Any) -> None:
        self.heard.append(kwargs)

    def go(self) -> object:
        self.heard.append("go")
        return Status.RUNNING

    def cancel(self, action: str) -> None:
        self.heard.append(f"cancel {action}")

    def root(self) -> StopWhenBlocked:
        return StopWhenBlocked(self, Latch("go", self.go, self.cancel))  # type: ignore[arg-type]


def test_the_owner_of_a_tree_sets_the_robot_up_once() -> None:
    robot = Recorder()
    tree = py_trees.trees.BehaviourTree(robot.root())
    tree.setup(timeout=15.0, node="the ROS node")
    tree.tick()
    assert robot.heard == [{"node": "the ROS node"}, "go"]


def test_a_robot_need_not_be_set_up() -> None:
    root = StopWhenBlocked(object(), Condition("holds", lambda: True))
    assert run(root) is Status.SUCCESS


def test_an_exception_cancels_what_runs() -> None:
    robot = Recorder()

    def read() -> bool:
        if "go" in robot.heard:
            raise KeyboardInterrupt
        return True

    latch = Latch("go", robot.go, robot.cancel)  # type: ignore[arg-type]
    with pytest.raises(KeyboardInterrupt):
        run(StopWhenBlocked(robot, sequence("all", Condition("read", read), latch)))
    assert robot.heard == [{}, "go", "cancel go"]


def test_a_tree_that_is_shut_down_cancels_what_runs_in_it() -> None:
    robot = Recorder()
    tree = py_trees.trees.BehaviourTree(py_trees.decorators.Inverter("larger tree", robot.root()))
    tree.setup()
    tree.tick_tock(period_ms=1, number_of_iterations=2)
    tree.interrupt()
    assert robot.heard == [{}, "go", "go"]
    tree.shutdown()
    tree.shutdown()
    assert robot.heard == [{}, "go", "go", "cancel go"]


def test_a_timeout_ends_a_tree_that_would_try_without_end() -> None:
    robot = Recorder()
    latch = Latch("go", lambda: Status.FAILURE, robot.cancel, keep=False)
    tree = py_trees.decorators.Timeout("at most 20 ms", StopWhenBlocked(robot, latch), 0.02)
    assert run(tree, period=0.001) is Status.FAILURE
    tree = py_trees.decorators.Timeout("at most 20 ms", robot.root(), 0.02)
    assert run(tree, period=0.001) is Status.FAILURE
    assert robot.heard[-1] == "cancel go"


def test_a_snapshot_tells_what_is_unknown_and_how_many_attempts_were_made() -> None:
    beliefs: list[bool | None] = [None]
    robot = Recorder()
    attempt = Try("go", robot.go, robot.cancel)  # type: ignore[arg-type]
    root = StopWhenBlocked(
        robot, retry("at most 3", 3, skipper("see", Condition("seen", lambda: beliefs[-1]), attempt))
    )
    root.tick_once()
    shown = py_trees.display.unicode_tree(root, show_status=True)
    assert "seen [*] -- unknown" in shown
    assert "at most 3 [*] -- 1 of 3 attempts made" in shown
    beliefs.append(True)
    root.tick_once()
    assert "unknown" not in py_trees.display.unicode_tree(root, show_status=True)


def test_two_trees_in_one_leave_each_other_alone() -> None:
    robots = [Recorder(), Recorder()]
    policy = py_trees.common.ParallelPolicy.SuccessOnAll()
    both = py_trees.composites.Parallel("both", policy, children=[robot.root() for robot in robots])
    for _ in range(3):
        both.tick_once()
    assert [robot.heard for robot in robots] == [["go"] * 3] * 2


# --- beliefs ---------------------------------------------------------------------------------


def test_beliefs_are_keys_of_a_namespace_on_the_blackboard() -> None:
    here, there = Beliefs("household", "look-for-soda"), Beliefs("robot 2")
    assert here.key("seen", "soda") == "/household/look-for-soda/seen/soda"
    assert there.key("seen", "0.5 l/can") == "/robot%202/seen/0%2E5%20l%2Fcan"
    here.believe(True, "seen", "soda")
    assert here.value("seen", "soda") is True
    assert there.value("seen", "soda") is None
    assert py_trees.blackboard.Blackboard.get("/household/look-for-soda/seen/soda") is True
    py_trees.blackboard.Blackboard.set("/household/look-for-soda/seen/soda", False)
    assert here.value("seen", "soda") is False


def test_a_belief_of_another_type_is_an_error() -> None:
    py_trees.blackboard.Blackboard.set("/a/p", 1)
    with pytest.raises(TypeError, match=r"/a/p is 1, not True, False or None"):
        Beliefs("a").value("p")


FACTS = st.lists(HOSTILE_NAMES | st.just("\udc80") | st.just("a.b"), min_size=1, max_size=3).map(tuple)


@given(FACTS, FACTS)
def test_different_facts_have_different_keys_which_hold_any_name(
    one: tuple[str, ...], two: tuple[str, ...]
) -> None:
    beliefs = Beliefs("a.b", "/")
    assert (beliefs.key(*one) == beliefs.key(*two)) == (one == two)
    beliefs.believe(False, *two)
    beliefs.believe(True, *one)
    assert beliefs.value(*one) is True
    py_trees.blackboard.Blackboard.clear()


# --- the robot to start from -----------------------------------------------------------------


def robot_of(tree: Tree, **options: str) -> types.ModuleType:
    """The robot, beside the module of its tree, both imported."""
    modules = {}
    for form in ("py_trees", "py_trees_robot"):
        exporter = load_exporter(form)
        text = exporter.export(tree, parse_options(exporter, options if form != "py_trees" else {}), None)
        assert isinstance(text, str)
        modules[form] = types.ModuleType(form)
        if form == "py_trees_robot":
            (line,) = [line for line in text.splitlines() if " import Robot, create_root, run" in line]
            text = text.replace(line, "")
            modules[form].__dict__.update(vars(modules["py_trees"]))
        exec(compile(text, form, "exec"), modules[form].__dict__)
    return modules["py_trees_robot"]


def test_the_robot_starts_with_what_the_problem_says_and_believes_what_it_is_told() -> None:
    module = robot_of(soda_tree(), namespace="/left/arm/")
    robot = module.MyRobot()
    board = py_trees.blackboard.Blackboard
    assert dict(board.storage) == {"/left/arm/luminousity_ok": False, "/left/arm/seen/soda": None}
    assert robot.luminousity_ok() is False
    assert robot.seen("soda") is None
    board.set("/left/arm/luminousity_ok", True)
    board.set("/left/arm/seen/soda", True)
    assert robot.luminousity_ok() is True
    assert robot.seen("soda") is True
    assert module.run(module.create_root(robot)) is Status.SUCCESS


def undecided_tree() -> Tree:
    """The soda tree of a problem that does not say whether there is light."""
    tree = soda_tree()
    (start,) = tree.task.initial
    light, can = start.values
    assert (light, can) == (Truth.FALSE, Truth.UNKNOWN)
    starts = tuple(InitialState(Fraction(1, 2), (value, can)) for value in (Truth.FALSE, Truth.TRUE))
    return replace(tree, task=replace(tree.task, initial=starts))


class Asked:
    """Makes the actions of a robot remember that they were asked for, and end at once."""

    def __init__(self, robot: Any) -> None:
        self.actions: list[str] = []
        for name in ("light_on", "detect"):
            setattr(robot, name, self._act(name))

    def _act(self, name: str) -> Any:
        def act(*_: str) -> object:
            self.actions.append(name)
            return Status.SUCCESS

        return act


def test_a_tree_waits_until_its_robot_has_heard_of_every_fact_and_says_so(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    module = robot_of(undecided_tree(), namespace="home")
    robot = module.MyRobot()
    asked, board = Asked(robot), py_trees.blackboard.Blackboard
    clock = [100.0]
    monkeypatch.setattr("time.monotonic", lambda: clock[0])
    root = module.create_root(robot)
    waiting = "waiting to hear of luminousity_ok()"
    for now in (100.0, 101.0, 109.0, 111.0):
        clock[0] = now
        root.tick_once()
        assert (root.status, root.feedback_message, asked.actions) == (Status.RUNNING, waiting, [])
    assert capsys.readouterr().out.count(waiting) == 2  # at once, and after ten seconds
    # It is never unknown in the domain: that nobody knows it yet is no answer.
    board.set("/home/luminousity_ok", None)
    root.tick_once()
    assert (root.status, root.feedback_message, asked.actions) == (Status.RUNNING, waiting, [])
    board.set("/home/luminousity_ok", True)
    root.tick_once()
    assert (root.status, root.feedback_message, asked.actions) == (Status.RUNNING, "", ["detect"])


def test_a_can_that_may_be_unknown_is_waited_for_until_it_is_said_to_be_unknown() -> None:
    module = robot_of(soda_tree(), namespace="home")
    robot = module.MyRobot()
    asked = Asked(robot)
    py_trees.blackboard.Blackboard.clear()  # of what the problem says
    root = module.create_root(robot)
    robot._beliefs.believe(True, "luminousity_ok")
    root.tick_once()
    assert (root.status, asked.actions) == (Status.RUNNING, [])
    robot._beliefs.believe(None, "seen", "soda")
    root.tick_once()
    assert (root.status, asked.actions) == (Status.RUNNING, ["detect"])


def test_what_is_not_known_any_more_is_not_false() -> None:
    """The light, which is never unknown in the domain: where it is false, it would be switched on."""
    module = robot_of(soda_tree(), namespace="home")
    robot = module.MyRobot()
    asked = Asked(robot)
    robot._beliefs.believe(True, "luminousity_ok")
    root = module.create_root(robot)
    root.tick_once()
    assert asked.actions == ["detect"]
    robot._beliefs.believe(None, "luminousity_ok")
    root.tick_once()
    assert (root.status, asked.actions) == (Status.FAILURE, ["detect"])


def test_a_robot_that_keeps_no_beliefs_is_not_waited_for() -> None:
    class Knowing:
        def luminousity_ok(self) -> bool:
            return True

        def seen(self, _: str) -> bool:
            return True

        detect = light_on = cancel = seen

    module = robot_of(soda_tree())
    assert module.run(module.create_root(Knowing())) is Status.SUCCESS


def test_a_robot_whose_actions_are_not_started_tells_which_and_why(
    capsys: pytest.CaptureFixture[str],
) -> None:
    tree = soda_tree()
    guards = (Is(1, Truth.TRUE), Is(0, Truth.TRUE))
    detect, light_on = (
        replace(action, precondition=guard) for action, guard in zip(tree.task.actions, guards, strict=True)
    )
    attempts = (ActionNode("a", light_on.name, guarded=True), ActionNode("b", detect.name, guarded=True))
    tree = replace(
        tree, task=replace(tree.task, actions=(detect, light_on)), root=ControlNode("r", "fallback", attempts)
    )
    robot_of(tree).main()
    *_, told = capsys.readouterr().out.splitlines()
    blocked = "blocked: nothing can observe what is unknown"
    assert (
        told == f"{blocked}; light_on(): its precondition is false; detect(soda): its precondition is unknown"
    )
    tree = replace(tree, root=ControlNode("r", "sequence", attempts))
    robot_of(tree).main()
    assert capsys.readouterr().out.splitlines() == [
        "The tree returned FAILURE.",
        "no action was started; light_on(): its precondition is false",
    ]


@given(trees(HOSTILE_NAMES))
def test_the_robot_runs_whatever_the_names(tree: Tree) -> None:
    module = robot_of(tree, namespace=tree.task.domain)
    root = module.create_root(module.MyRobot())
    for _ in range(5):
        root.tick_once()
    assert root.status in (Status.SUCCESS, Status.FAILURE, Status.RUNNING)
    py_trees.blackboard.Blackboard.clear()


@pytest.mark.parametrize(
    ("module", "accepted"),
    [
        ("a_b", True),
        ("pkg.trees.a", True),
        ("", True),
        ("a b", False),
        ("1a", False),
        ("a.", False),
        ("a.class", False),
        ("a\nimport os", False),
        ("ü", False),
    ],
)
def test_the_module_must_have_a_name_that_python_can_import(module: str, accepted: bool) -> None:
    exporter = load_exporter("py_trees_robot")
    options = parse_options(exporter, {"module": module})
    if accepted:
        line = f"from {module or 'look_for_soda'} import Robot, create_root, run"
        assert line in str(exporter.export(soda_tree(), options, None)).splitlines()
        return
    with pytest.raises(BbtcError) as error:
        exporter.export(soda_tree(), options, None)
    assert error.value.diagnostics[0].code == "BBT0704"


@given(HOSTILE_NAMES | st.sampled_from(["random", "class", "Time", "p-1", "P_1"]))
def test_a_module_is_named_by_any_text(text: str) -> None:
    name = module_name(text)
    assert name.isidentifier()
    assert name.isascii()
    assert name not in ("random", "class", "time")
