"""Runs a Datalog program with clingo's grounder and gives back the facts it derives.

Small programs are grounded in this process, large ones in a child process that streams its facts:
the grounder cannot be interrupted, a process can be ended when a limit is met.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path

from bbtc.ground.universe import Row
from bbtc.limits import Limits

_CHUNK = 1 << 18
_OUT_OF_MEMORY = 33
"""The exit status of clingo for it."""


def derive(
    program: Sequence[str],
    outputs: Mapping[str, int],
    counted: frozenset[str],
    limits: Limits,
    *,
    small: bool,
) -> dict[str, list[Row]]:
    """The derived facts of each predicate of ``outputs`` (name to arity), arguments as integers.

    Facts of ``counted`` predicates are bounded by ``limits.actions``, all together by
    ``limits.facts``. ``small`` says that the program cannot derive many facts. Raises
    :class:`bbtc.diagnostics.LimitReached`.
    """
    if small:
        return _in_process(program, outputs)
    return _in_child(program, outputs, counted, limits)


def _in_process(program: Sequence[str], outputs: Mapping[str, int]) -> dict[str, list[Row]]:
    import clingo

    control = clingo.Control(["--warn=none"])
    control.add("base", [], "\n".join(program))
    control.ground([("base", [])])
    atoms = control.symbolic_atoms
    return {
        name: [tuple(arg.number for arg in atom.symbol.arguments) for atom in atoms.by_signature(name, arity)]
        for name, arity in outputs.items()
    }


# --- the child process -----------------------------------------------------------------------

# The child sees the packages that we see, and nothing from the folder it starts in.
_CHILD = """
import sys
program, memory, *sys.path[:] = sys.argv[1:]
if int(memory):
    try:
        import resource
        resource.setrlimit(resource.RLIMIT_AS, (int(memory), int(memory)))
    except (ImportError, ValueError, OSError):
        pass
from clingo.application import Application, clingo_main
sys.exit(clingo_main(Application(), ["--mode=gringo", "--text", "--warn=none", program]))
"""


def _in_child(
    program: Sequence[str], outputs: Mapping[str, int], counted: frozenset[str], limits: Limits
) -> dict[str, list[Row]]:
    seconds = limits.remaining
    with tempfile.TemporaryDirectory(prefix="bbtc-") as folder:
        path = Path(folder, "program.lp")
        path.write_text("\n".join(program), encoding="ascii")
        command = [sys.executable, "-I", "-S", "-c", _CHILD, str(path), str(limits.memory or 0), *sys.path]
        timer = None
        # Our own interpreter and our own program text: nothing of the input is a command.
        process = subprocess.Popen(  # noqa: S603
            command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE
        )
        try:
            if seconds is not None:
                timer = threading.Timer(seconds, process.kill)
                timer.start()
            rows = _collect(process, outputs, counted, limits)
            process.wait()
        finally:
            if timer is not None:
                timer.cancel()
            process.kill()
            process.communicate()
    if process.returncode == 0:
        return rows
    limits.check_time("grounding")
    if process.returncode < 0 or process.returncode == _OUT_OF_MEMORY:
        bound = f"the limit of {(limits.memory or 0) >> 20} MiB of memory ended grounding"
        raise limits.reached(bound, "--max-memory")
    raise RuntimeError(f"the Datalog engine failed with status {process.returncode}")


def _collect(
    process: subprocess.Popen[bytes],
    outputs: Mapping[str, int],
    counted: frozenset[str],
    limits: Limits,
) -> dict[str, list[Row]]:
    assert process.stdout is not None
    rows: dict[str, list[Row]] = {name: [] for name in outputs}
    wanted = {name.encode(): (rows[name], arity) for name, arity in outputs.items()}
    facts = 0
    for lines in _blocks(process.stdout.fileno()):
        facts += len(lines)
        limits.check_facts(facts)
        for name, run in _runs(lines):
            found = wanted.get(name)
            if found is not None:
                into, arity = found
                into += _read(run, len(name), arity)
        limits.check_actions(sum(len(rows[name]) for name in counted))
    return rows


def _runs(lines: list[bytes]) -> Iterator[tuple[bytes, list[bytes]]]:
    """Facts of one predicate that stand together. They come in long runs, whose ends are searched for
    in steps that double."""
    start, size = 0, len(lines)
    while start < size:
        name = lines[start].rstrip(b".").partition(b"(")[0]
        prefixes = (name + b"(", name + b".")
        step = 1
        end = start + 1
        while end < size and all(line.startswith(prefixes) for line in lines[end : end + step]):
            end += step
            step *= 2
        end = min(end, size)
        while end < size and lines[end].startswith(prefixes):
            end += 1
        yield name, lines[start:end]
        start = end


def _read(facts: list[bytes], skip: int, arity: int) -> Iterable[Row]:
    """The arguments of facts ``name(1,2).`` or ``name.`` whose name has ``skip`` letters."""
    if not arity:
        return [()] * len(facts)
    # The JSON reader turns many numbers at once into integers.
    numbers = json.loads(b"[%b]" % b",".join([fact[skip + 1 : -2] for fact in facts]))
    return zip(*(numbers[place::arity] for place in range(arity)), strict=True)


def _blocks(descriptor: int) -> Iterator[list[bytes]]:
    """Whole lines, as they come, many at a time."""
    pieces: list[bytes] = []
    size = 0
    while chunk := os.read(descriptor, _CHUNK):
        pieces.append(chunk)
        size += len(chunk)
        if size >= _CHUNK:
            lines = b"".join(pieces).split(b"\n")
            rest = lines.pop()
            pieces, size = [rest], len(rest)
            yield lines
    # A line without its end was cut off by a limit.
    yield b"".join(pieces).split(b"\n")[:-1]
