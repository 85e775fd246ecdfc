"""What is reached from what: strongly connected components of a directed graph."""

from __future__ import annotations

from collections.abc import Sequence


def components(successors: Sequence[Sequence[int]]) -> list[list[int]]:
    """Strongly connected components, each after all the components it can reach."""
    number = [0] * len(successors)
    low = [0] * len(successors)
    on_stack = [False] * len(successors)
    stack: list[int] = []
    found: list[list[int]] = []
    count = 0
    for root in range(len(successors)):
        if number[root]:
            continue
        work = [(root, 0)]
        while work:
            node, position = work.pop()
            if position == 0:
                count += 1
                number[node] = low[node] = count
                stack.append(node)
                on_stack[node] = True
            descend = False
            for at in range(position, len(successors[node])):
                target = successors[node][at]
                if not number[target]:
                    work.append((node, at + 1))
                    work.append((target, 0))
                    descend = True
                    break
                if on_stack[target]:
                    low[node] = min(low[node], low[target])
            if descend:
                continue
            if low[node] == number[node]:
                component = []
                while True:
                    member = stack.pop()
                    on_stack[member] = False
                    component.append(member)
                    if member == node:
                        break
                found.append(component)
            if work:
                parent = work[-1][0]
                low[parent] = min(low[parent], low[node])
    return found
