"""What BehaviorTree.CPP 4.10 gives a meaning to: its nodes with their ports, and its attributes."""

from __future__ import annotations

from types import MappingProxyType

_SWITCH = {"variable": "{x}"}
_LOOP = {"value": "{x}", "queue": "{y}", "if_empty": "SUCCESS"}

NODES = MappingProxyType(
    {
        "action": {
            "AlwaysFailure": {},
            "AlwaysSuccess": {},
            "Script": {"code": "x := 1"},
            "SetBlackboard": {"output_key": "x", "value": "1"},
            "Sleep": {"msec": "1"},
            "UnsetBlackboard": {"key": "x"},
            "WasEntryUpdated": {"entry": "{x}"},
        },
        "condition": {"ScriptCondition": {"code": "true"}},
        "control": {
            "AsyncFallback": {},
            "AsyncSequence": {},
            "Fallback": {},
            "IfThenElse": {},
            "Parallel": {"success_count": "-1", "failure_count": "1"},
            "ParallelAll": {"max_failures": "1"},
            "ReactiveFallback": {},
            "ReactiveSequence": {},
            "Sequence": {},
            "SequenceWithMemory": {},
            **{f"Switch{n}": _SWITCH | {f"case_{i + 1}": str(i) for i in range(n)} for n in range(2, 7)},
            "TryCatch": {"catch_on_halt": "false"},
            "WhileDoElse": {},
        },
        "decorator": {
            "Delay": {"delay_msec": "1"},
            "ForceFailure": {},
            "ForceSuccess": {},
            "Inverter": {},
            "KeepRunningUntilFailure": {},
            **{f"Loop{kind}": _LOOP for kind in ("Bool", "Double", "Int", "String")},
            "Precondition": {"if": "true", "else": "FAILURE"},
            "Repeat": {"num_cycles": "2"},
            "RetryUntilSuccessful": {"num_attempts": "2"},
            "RunOnce": {"then_skip": "true"},
            "SkipUnlessUpdated": {"entry": "{x}"},
            "Timeout": {"msec": "1"},
            "WaitValueUpdate": {"entry": "{x}"},
        },
        "subtree": {"SubTree": {"ID": "Other", "_autoremap": "false"}},
    }
)
"""Nodes by kind, with every port of theirs and a value for it."""

SCRIPTS = ("_failureIf", "_skipIf", "_successIf", "_while", "_onSuccess", "_onFailure", "_onHalted", "_post")
"""Attributes of any node that hold a script: read before, while or after it is ticked."""

PORTS = tuple(sorted({port for nodes in NODES.values() for ports in nodes.values() for port in ports}))
"""Attributes that are a port of some node."""
