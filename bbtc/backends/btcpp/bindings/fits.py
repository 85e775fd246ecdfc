"""Which text a port takes, by the type that the model of its node gives it.

Texts are what the engine, and Nav2 for messages of ROS 2, read as such a type. A type that is not known here
takes any text, and so does one in JSON (``json:…``), which the program itself reads.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from types import MappingProxyType

from bbtc.backends.btcpp.bindings.entries import is_number

_WHOLE = re.compile(r"-?[0-9]{1,20}", re.ASCII)
_TRUTH = frozenset(("true", "True", "TRUE", "1", "false", "False", "FALSE", "0"))
_JSON = "json:"
_NS = 2**63 - 1


def misfit(text: str, port_type: str) -> str | None:
    """What a port of this type takes instead of a text; None where it takes it, or that is not known."""
    if text.startswith(_JSON):
        return None
    plain = _plain(port_type)
    if plain in _RANGES:
        low, high = _RANGES[plain]
        wanted = f"a whole number from {low} to {high}"
        return None if _WHOLE.fullmatch(text) and low <= int(text) <= high else wanted
    if plain in _FORMS:
        fits, wanted = _FORMS[plain]
        return None if fits(text) else wanted
    if plain.startswith("vector<") and plain.endswith(">"):
        inside = plain[7:-1]
        if inside in _RANGES or inside in ("double", "float", "bool"):
            wrong = next((w for part in text.split(";") if (w := misfit(part, inside)) and text), None)
            return None if wrong is None else f"values separated by ';', each {wrong}"
    return None


def _plain(port_type: str) -> str:
    """A type without spaces, ``std::`` and the like: ``vector<double>``."""
    text = re.sub(r"\s+", " ", port_type.replace("std::", "")).strip()
    text = re.sub(r"\s*([<>])\s*", r"\1", text)
    return re.sub(r"_t\b", "", re.sub(r"::msg(?:::|/)|/msg/", "::", text)).replace("/", "::")


def _range(bits: int, signed: bool) -> tuple[int, int]:
    return (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1) if signed else (0, 2**bits - 1)


_RANGES: Mapping[str, tuple[int, int]] = MappingProxyType(
    {
        **{f"int{bits}": _range(bits, True) for bits in (8, 16, 32, 64)},
        **{f"uint{bits}": _range(bits, False) for bits in (8, 16, 32, 64)},
        "int": _range(32, True),
        "unsigned int": _range(32, False),
        "unsigned": _range(32, False),
        "size": _range(64, False),
        "chrono::milliseconds": (0, _NS),
    }
)


def _numbers(parts: list[str]) -> bool:
    return all(is_number(part) for part in parts)


def _stamped(parts: list[str]) -> bool:
    """Stamp in ns and frame: the header of a message."""
    return _WHOLE.fullmatch(parts[0]) is not None and 0 <= int(parts[0]) <= _NS and bool(parts[1])


def _pose(parts: list[str]) -> bool:
    return len(parts) == 9 and _stamped(parts) and _numbers(parts[2:])


def _poses(parts: list[str]) -> bool:
    return len(parts) % 9 == 0 and all(_pose(parts[at : at + 9]) for at in range(0, len(parts), 9))


def _goals(parts: list[str]) -> bool:
    return len(parts) >= 2 and _stamped(parts) and (len(parts) == 2 or _poses(parts[2:]))


def _split(test: Callable[[list[str]], bool]) -> Callable[[str], bool]:
    return lambda text: test(text.split(";"))


_POSE = "stamp;frame;x;y;z;qx;qy;qz;qw"
_FORMS: Mapping[str, tuple[Callable[[str], bool], str]] = MappingProxyType(
    {
        "double": (is_number, "a number"),
        "float": (is_number, "a number"),
        "float32": (is_number, "a number"),
        "float64": (is_number, "a number"),
        "bool": (_TRUTH.__contains__, "true or false"),
        "geometry_msgs::Point": (_split(lambda parts: len(parts) == 3 and _numbers(parts)), "x;y;z"),
        "geometry_msgs::Quaternion": (_split(lambda parts: len(parts) == 4 and _numbers(parts)), "x;y;z;w"),
        "geometry_msgs::PoseStamped": (
            _split(_pose),
            f"a pose {_POSE} (stamp 0: the latest)",
        ),
        "vector<geometry_msgs::PoseStamped>": (_split(_poses), f"poses {_POSE};…"),
        "nav_msgs::Goals": (_split(_goals), f"stamp;frame and poses {_POSE};…"),
        "nav_msgs::Path": (_split(_goals), f"stamp;frame and poses {_POSE};…"),
    }
)
