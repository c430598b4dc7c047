"""A whole landing in one block of memory, with a header from which kernels rebuild its named tuples.

The block is an array of 64-bit words. Its first ones are the header: for every array its place (in words from the start of
the block) and its lengths, for every number its place. Which header words belong to which array is fixed by the types of
`Parts` alone, so that one compiled module takes every landing: any mesh, any number of wheels.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from fmus.cable.assembly import Model
from fmus.cable.state import Work, make_work, state_size
from fmus.contact import places as at
from fmus.kernels.jit import sources
from fmus.kernels.time_integration import collocation
from fmus.robot import dynamics
from fmus.robot import rigid_body as rb
from orchestrator.landing.monolithic.entry import Shown, Start, make_shown
from orchestrator.landing.monolithic.state import N_CONTACT, N_ROBOT, Space, State, System, make_space

WORD = 8
"""Bytes."""
EVEN = 2
"""Arrays begin at words that are a multiple of this: complex numbers have two."""
KINDS = {"f": "real", "c": "complex", "i": "whole", "b": "truth"}
"""Kind of an array's type → how the source of `unpack` calls a pointer to it."""


class Parts(NamedTuple):
    """What a landing consists of; the first five are given, the last two are workspace that needs no values."""

    system: System
    state: State
    control: np.ndarray
    start: Start
    shown: Shown
    space: Space
    work: Work


SCRATCH = ("space", "work")


class Place(NamedTuple):
    """Where an array stands: first word, lengths."""

    first: int
    shape: tuple[int, ...]


@dataclass(frozen=True)
class Block:
    """A packed landing.

    Attributes
    ----------
    given : (m,) float64, the words that say something: header and values
    words : of the whole block; those behind `given` are workspace, zero at the start
    places : array by its path, ``state.cable``, → where it stands
    """

    given: np.ndarray
    words: int
    places: Mapping[str, Place]

    def memory(self) -> np.ndarray:
        """Return the whole block (words,), as a solution begins with it."""
        whole = np.zeros(self.words)
        whole[: self.given.size] = self.given
        return whole

    def view(self, memory: np.ndarray, name: str) -> np.ndarray:
        """Return the real array of that path in a block's `memory`."""
        first, shape = self.places[name]
        return memory[first : first + int(np.prod(shape))].reshape(shape)


def leaves(value: Any, name: str) -> Iterator[tuple[str, np.ndarray]]:
    """Yield every array of nested named tuples by its path; a number is an array of no dimension."""
    if isinstance(value, tuple):
        fields: tuple[str, ...] = value._fields  # type: ignore[attr-defined]
        for field, part in zip(fields, value, strict=True):
            yield from leaves(part, f"{name}.{field}" if name else field)
    else:
        yield name, np.asarray(value)


def pack(parts: Parts) -> Block:
    """Return the block of a landing; `parts` stay as they are."""
    found = list(leaves(parts, ""))
    end = sum(1 + array.ndim for _, array in found)
    places, given = dict[str, Place](), 0
    for name, array in found:  # workspace stands last
        first = -(-end // EVEN) * EVEN
        places[name], end = Place(first, array.shape), first + -(-array.nbytes // WORD)
        given = end if name.partition(".")[0] not in SCRATCH else given
    words = np.zeros(given)
    words.view(np.int64)[: sum(1 + a.ndim for _, a in found)] = list(_header(places.values()))
    for name, array in found:
        if name.partition(".")[0] not in SCRATCH:
            first = WORD * places[name].first
            words.view(np.uint8)[first : first + array.nbytes] = np.frombuffer(array.tobytes(), np.uint8)
    return Block(words, end, places)


def _header(places: Any) -> Iterator[int]:
    for first, shape in places:
        yield first
        yield from shape


def unpack_source() -> str:
    """Return the source of ``unpack(block)``, which rebuilds `Parts` from the header, a tuple of its fields.

    It calls `carray`, the named tuples, and for each kind of array (`KINDS`) a function of the block and a place in it that
    returns a pointer.
    """
    words = sum(1 + array.ndim for _, array in leaves(example(), ""))
    counter = iter(range(words))
    lines = [f"    {name} = {_rebuilt(part, counter)}" for name, part in example()._asdict().items()]
    body = [f"    head = carray(whole(block, 0), ({words},))", *lines, f"    return {', '.join(Parts._fields)}"]
    return "\n".join(["def unpack(block):", *body, ""])


def _rebuilt(value: Any, words: Iterator[int]) -> str:
    """Return the expression for a value whose header begins with the next of the `words`."""
    if isinstance(value, tuple):
        return f"{type(value).__name__}({', '.join(_rebuilt(part, words) for part in value)})"
    array = np.asarray(value)
    pointer = f"{KINDS[array.dtype.kind]}(block, head[{next(words)}])"
    if array.ndim == 0:
        return f"carray({pointer}, (1,))[0]"
    return f"carray({pointer}, ({' '.join(f'head[{next(words)}],' for _ in array.shape)}))"


def example() -> Parts:
    """Return the parts of a cable of one element and a robot of one wheel: of their types, without values."""
    n, z = 12, np.zeros
    model = Model(z(2), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, z(3), z(n), z((2, 3, 3)))
    loads = rb.BODY_LOADS + rb.WHEEL_LOADS
    system = System(model, collocation(0.9), z(rb.N_PARAMETERS), z((1, at.PRM_SIZE)), z((2, loads)))
    state = State(z(state_size(n)), z(rb.RIGID), z((2, N_ROBOT)), z((1, N_CONTACT)), z(1))
    start = Start(z(4), z(4), z((1, 2 + 2 * loads)))
    shown = make_shown(z(dynamics.MEMORY + dynamics.WHEEL_MEMORY), 1, 1)
    return Parts(system, state, z(9), start, shown, make_space(n, 1), make_work(n, state_size(n)))


@cache
def kernels_hash() -> str:
    """Return a hash of all sources that the compiled module is made from: blocks and module go together by it."""
    digest = hashlib.sha256()
    for name, content in sorted(sources(__name__).items()):
        digest.update(f"\0{name}\0{len(content)}\0".encode() + content)
    return digest.hexdigest()[:16]
