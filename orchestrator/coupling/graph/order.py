"""Order and dependence: which component is stepped, which output is read, after which."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from orchestrator.coupling.fmu.instance import Fmu
from orchestrator.coupling.graph.links import Link, Signal

Dependencies = dict[str, dict[str, frozenset[str] | None]]


def dependencies_of(components: Mapping[str, Fmu], *, initial: bool) -> Dependencies:
    """Return for each component and output variable the inputs it depends on without a step; None: the FMU
    does not say.

    With `initial` what the FMU says about its initialisation goes before what it says about the rest of the
    time.
    """
    table: Dependencies = {}
    for name, fmu in components.items():
        unknowns = [*fmu.description.outputs, *(fmu.description.initialUnknowns if initial else [])]
        table[name] = {
            u.variable.name: None if u.dependencies is None else frozenset(v.name for v in u.dependencies)
            for u in unknowns
            if u.variable is not None
        }
    return table


def _components_of(edges: Iterable[tuple[int, int]], n: int) -> np.ndarray:
    """Return the number of the strongly connected component of each of `n` vertices, sources before what
    they feed."""
    pairs = set(edges)
    labels = _strongly_connected(pairs, n)
    ranks = _longest_paths([(labels[a], labels[b]) for a, b in pairs if labels[a] != labels[b]], max(labels) + 1)
    return np.array([ranks[label] * (n + 1) + label for label in labels])


def _strongly_connected(edges: Iterable[tuple[int, int]], n: int) -> list[int]:
    """Return for each of `n` vertices the number of its strongly connected component; they count by their first vertex.

    Two vertices are in the same one if each can be reached from the other: squaring the matrix of what is reached doubles
    the length of the paths.
    """
    reached = np.eye(n, dtype=np.float32)
    for a, b in edges:
        reached[a, b] = 1.0
    for _ in range(n.bit_length()):
        reached = np.minimum(reached @ reached, 1.0)
    first = np.argmax(np.minimum(reached, reached.T), axis=1)
    return np.unique(first, return_inverse=True)[1].tolist()


def _longest_paths(edges: Sequence[tuple[int, int]], n: int) -> list[int]:
    """Return for each vertex of a graph without cycles the length of the longest path that ends there."""
    rank = [0] * n
    for _ in range(n):
        changed = [(b, rank[a] + 1) for a, b in edges if rank[b] < rank[a] + 1]
        if not changed:
            break
        for b, value in changed:
            rank[b] = max(rank[b], value)
    return rank


def derived_order(components: Mapping[str, Fmu], links: list[Link], feedthrough: Dependencies) -> tuple[str, ...]:
    """Return an order along the connections; inside a loop along the feedthrough, else as the components
    were named."""
    names = list(components)
    index = {name: i for i, name in enumerate(names)}
    through = {name: frozenset().union(*(deps or () for deps in table.values())) for name, table in feedthrough.items()}
    continuous = [k for k in links if not k.discrete and k.source[0] != k.target[0]]
    edges = [(index[k.source[0]], index[k.target[0]]) for k in continuous]
    variables = [components[k.target[0]].ports[k.target[1]].variable for k in continuous]
    algebraic = [e for e, k, v in zip(edges, continuous, variables, strict=True) if v in through[k.target[0]]]
    loops, inner = _components_of(edges, len(names)), _components_of(algebraic, len(names))
    depth = _ranks_within(algebraic, inner, len(names))
    return tuple(sorted(names, key=lambda n: (loops[index[n]], depth[index[n]], index[n])))


def _ranks_within(edges: list[tuple[int, int]], label: np.ndarray, n: int) -> list[int]:
    numbers = {int(value): i for i, value in enumerate(sorted(set(label.tolist())))}
    short = [(numbers[int(label[a])], numbers[int(label[b])]) for a, b in edges if label[a] != label[b]]
    ranks = _longest_paths(short, len(numbers))
    return [ranks[numbers[int(label[i])]] for i in range(n)]


def levels(
    links: list[Link],
    outputs: list[Signal],
    components: Mapping[str, Fmu],
    dependencies: Dependencies,
) -> tuple[dict[Signal, int], np.ndarray]:
    """Return the stage of every output (0: needs no input) and the places in u of the inputs that are in a
    loop."""
    edges, inputs = _edges(links, outputs, components, dependencies)
    if not edges:
        return dict.fromkeys(outputs, 0), np.array([], dtype=np.intp)
    label = _components_of(edges, len(outputs))
    rank = _ranks_within(edges, label, len(outputs))
    # an output in a loop depends on inputs even if nothing outside feeds the loop
    looped = [label[a] == label[b] for a, b in edges]
    offset = 1 if any(flag and rank[a] == 0 for (a, _), flag in zip(edges, looped, strict=True)) else 0
    fed = {b for _, b in edges}
    level = {signal: rank[i] + (offset if i in fed else 0) for i, signal in enumerate(outputs)}
    loop = sorted({i for i, flag in zip(inputs, looped, strict=True) if flag})
    return level, np.array(loop, dtype=np.intp)


def _edges(
    links: list[Link], outputs: list[Signal], components: Mapping[str, Fmu], dependencies: Dependencies
) -> tuple[list[tuple[int, int]], list[int]]:
    """Return which output depends on which, by their numbers, and for each such pair the place in u it goes through."""
    place = {signal: i for i, signal in enumerate(outputs)}
    fed: dict[str, list[int]] = {}
    for i, link in enumerate(links):
        fed.setdefault(link.target[0], []).append(i)
    edges, inputs = [], []
    for component, name in outputs:
        ports = components[component].ports
        deps = dependencies[component].get(ports[name].variable)
        for i in fed.get(component, []):
            if deps is None or ports[links[i].target[1]].variable in deps:
                edges.append((place[links[i].source], place[component, name]))
                inputs.append(i)
    return edges, inputs
