"""Order and dependence: which component is stepped, which output is read, after which."""

from __future__ import annotations

from collections.abc import Container, Iterable, Mapping

import numpy as np

from orchestrator.coupling.fmu.instance import Fmu
from orchestrator.coupling.graph.links import Link, Signal

Dependencies = dict[str, dict[str, frozenset[str] | None]]
Edge = tuple[int, int]
"""From one vertex to another, by their numbers."""


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


def discrete_loops(links: Iterable[Link], components: Mapping[str, Fmu]) -> list[str]:
    """Return the connections of reals in loops that an FMU declares discrete, so that no master iterates over them."""
    links, rank = list(links), {name: i for i, name in enumerate(components)}
    label = _strongly_connected([(rank[k.source[0]], rank[k.target[0]]) for k in links], len(rank))
    held = [k for k in links if k.discrete and label[rank[k.source[0]]] == label[rank[k.target[0]]]]
    return [str(k) for k in held if all(components[c].ports[v].kind == "real" for c, v in (k.source, k.target))]


def _components_of(edges: Iterable[Edge], n: int) -> np.ndarray:
    """Return the number of the strongly connected component of each of `n` vertices, sources before what
    they feed."""
    pairs = set(edges)
    labels = _strongly_connected(pairs, n)
    ranks = _longest_paths([(labels[a], labels[b]) for a, b in pairs if labels[a] != labels[b]], max(labels) + 1)
    return np.array([ranks[label] * (n + 1) + label for label in labels])


def _neighbours(edges: Iterable[Edge], n: int) -> list[list[int]]:
    """Return for each of `n` vertices those that an edge leads to."""
    following: list[list[int]] = [[] for _ in range(n)]
    for a, b in edges:
        following[a].append(b)
    return following


def _strongly_connected(edges: Iterable[Edge], n: int) -> list[int]:
    """Return for each of `n` vertices the number of its strongly connected component; they count by their first vertex.

    R. Tarjan, Depth-first search and linear graph algorithms, SIAM J. Comput. 1 (1972) 146-160, without recursion: a
    component ends at the vertex from which none found before it can be reached.
    """
    following = [iter(vertices) for vertices in _neighbours(edges, n)]
    found, lowest, first, open_ = [-1] * n, [n] * n, [-1] * n, list[int]()
    count = 0
    for root in range(n):
        path = [root] if found[root] < 0 else []
        while path:
            v = path[-1]
            if found[v] < 0:
                found[v] = lowest[v] = count
                count += 1
                open_.append(v)
            w = next(following[v], -1)
            if w >= 0:
                if found[w] < 0:
                    path.append(w)
                elif first[w] < 0:
                    lowest[v] = min(lowest[v], found[w])
                continue
            path.pop()
            if path:
                lowest[path[-1]] = min(lowest[path[-1]], lowest[v])
            if lowest[v] == found[v]:
                _close(v, open_, first)
    number = {vertex: i for i, vertex in enumerate(sorted(set(first)))}
    return [number[vertex] for vertex in first]


def _close(v: int, open_: list[int], first: list[int]) -> None:
    """Take the strongly connected component that `v` ends from the open vertices; write its first vertex for each."""
    members = [open_.pop()]
    while members[-1] != v:
        members.append(open_.pop())
    least = min(members)
    for w in members:
        first[w] = least


def _longest_paths(edges: Iterable[Edge], n: int, light: Container[int] = ()) -> list[int]:
    """Return for each vertex of a graph without cycles the length of the longest path that ends there; edges to `light`
    vertices have none."""
    pairs = set(edges)
    following, waiting, rank = _neighbours(pairs, n), [0] * n, [0] * n
    for _, b in pairs:
        waiting[b] += 1
    ready = [v for v in range(n) if not waiting[v]]
    for a in ready:  # grows on the way
        for b in following[a]:
            rank[b] = max(rank[b], rank[a] + (b not in light))
            waiting[b] -= 1
            if not waiting[b]:
                ready.append(b)
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


def _ranks_within(edges: Iterable[Edge], label: np.ndarray, n: int, joints: Iterable[int] = ()) -> list[int]:
    """Return for each of `n` vertices the longest path of strongly connected components that ends at its own; those of
    `joints` alone add nothing to it."""
    numbers = {int(value): i for i, value in enumerate(sorted(set(label.tolist())))}
    place = [numbers[int(value)] for value in label]
    joined = set(joints)
    light = {place[v] for v in joined} - {place[v] for v in range(n) if v not in joined}
    short = [(place[a], place[b]) for a, b in edges if place[a] != place[b]]
    ranks = _longest_paths(short, len(numbers), light)
    return [ranks[p] for p in place]


def levels(
    links: list[Link],
    outputs: list[Signal],
    components: Mapping[str, Fmu],
    dependencies: Dependencies,
) -> tuple[dict[Signal, int], np.ndarray]:
    """Return the stage of every output (0: needs no input) and the places in u of the inputs that are in a
    loop."""
    edges, inputs, n = _edges(links, outputs, components, dependencies)
    if not edges:
        return dict.fromkeys(outputs, 0), np.array([], dtype=np.intp)
    label = _components_of(edges, n)
    rank = _ranks_within(edges, label, n, range(len(outputs), n))
    # an output in a loop depends on inputs even if nothing outside feeds the loop
    looped = [label[a] == label[b] for a, b in edges]
    offset = 1 if any(flag and rank[a] == 0 for (a, _), flag in zip(edges, looped, strict=True)) else 0
    fed = {b for _, b in edges}
    level = {signal: rank[i] + (offset if i in fed else 0) for i, signal in enumerate(outputs)}
    loop = sorted({i for i, flag in zip(inputs, looped, strict=True) if flag and i >= 0})
    return level, np.array(loop, dtype=np.intp)


def _edges(
    links: list[Link], outputs: list[Signal], components: Mapping[str, Fmu], dependencies: Dependencies
) -> tuple[list[Edge], list[int], int]:
    """Return which output depends on which, and for each such edge the place in u it goes through, or -1.

    The edges of an output go through a joint, a vertex of its own for each set of inputs that outputs of a component depend
    on; so there are as many as there are inputs and outputs, not the product of the two. The last number is that of all
    vertices: the outputs, then the joints.
    """
    place = {signal: i for i, signal in enumerate(outputs)}
    fed: dict[str, list[int]] = {}
    for i, link in enumerate(links):
        fed.setdefault(link.target[0], []).append(i)
    joints: dict[tuple[str, frozenset[str] | None], int] = {}
    edges, inputs = [], []
    for component, name in outputs:
        deps = dependencies[component].get(components[component].ports[name].variable)
        key = component, deps
        if key not in joints:
            joints[key] = len(outputs) + len(joints)
            for i in _depended(links, fed.get(component, []), components[component], deps):
                edges.append((place[links[i].source], joints[key]))
                inputs.append(i)
        edges.append((joints[key], place[component, name]))
        inputs.append(-1)
    reached = {b for _, b in edges}
    kept = [
        j for j, (a, _) in enumerate(edges) if a < len(outputs) or a in reached
    ]  # a joint that nothing feeds is none
    return [edges[j] for j in kept], [inputs[j] for j in kept], len(outputs) + len(joints)


def _depended(links: list[Link], fed: list[int], fmu: Fmu, deps: frozenset[str] | None) -> list[int]:
    """Return those of the inputs `fed` of a component that are among `deps`; None: all of them."""
    return [i for i in fed if deps is None or fmu.ports[links[i].target[1]].variable in deps]
