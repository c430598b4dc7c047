"""Components that do not wait for one another are stepped at the same time: in processes of their own, or in threads.

An FMU in a process of its own is told to step and goes on by itself; its answer is waited for when all others are under way.
Of those in this process, a call through ctypes leaves Python's interpreter lock, so that compiled ones run side by side in
threads, where that pays. FMUs that hold the interpreter themselves (made with pythonfmu) would only wait for each other; they
are stepped one by one.
"""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Sequence
from functools import cache, partial
from pathlib import Path
from queue import SimpleQueue
from threading import Thread
from time import perf_counter

import numpy as np

from orchestrator.coupling.fmu.binding import Fmi2
from orchestrator.coupling.fmu.isolated import Isolated
from orchestrator.coupling.fmu.sub_steps import SubStepped
from orchestrator.coupling.graph.graph import Graph, Node

CHOICES = ("auto", "always", "never")
SAMPLE = 5  # rounds that are timed without threads, and then with them, each after one that is not (the first compiles)
BLOCK = 20  # rounds after which it is looked again whether threads pay
PATIENCE = 1.0  # s that the end of a thread is waited for

Step = Callable[[Node], None]


class Crew:
    """Makes one round over all components, batch after batch; the components of a batch need nothing of each other.

    Results do not depend on what goes on at the same time: every component reads and writes places of its own. If several
    fail at once, the error of the first in the order is raised, as one by one.

    Parameters
    ----------
    parallel : ``auto``: threads, at most one a processor, if in the first rounds those with threads took less time than
        those without, hand-over and all, and as long as rounds take less than the steps in them; ``always``: one a
        component (for FMUs that wait for another computer); ``never``: all one by one, those in other processes too
    sequential : whether a component takes the outputs of earlier ones in the same round
    """

    def __init__(self, graph: Graph, parallel: str, *, sequential: bool):
        if parallel not in CHOICES:
            raise ValueError(f"parallel {parallel!r}: choose {', '.join(CHOICES)}")
        self.nodes = list(graph.nodes)
        self.batches = independent(graph) if sequential else [self.nodes]
        self.most = {"auto": processors(), "always": len(self.nodes), "never": 1}[parallel]
        self.always = parallel == "always"
        self.ahead = [[] if parallel == "never" else goes_on_by_itself(batch) for batch in self.batches]
        self.here = [[n for n in b if n not in ahead] for b, ahead in zip(self.batches, self.ahead, strict=True)]
        self.plans: list[list[list[Node]]] = []  # for each batch what each thread does, the caller's share first
        self.workers: list[_Worker] = []
        self.done: SimpleQueue[None] = SimpleQueue()
        self.failures: dict[str, BaseException] = {}
        self._reset()

    def _reset(self) -> None:
        self.watching = self.most > 1 and any(len(compiled(batch)) > 1 for batch in self.here)
        self.made, self.serial = 0, 0.0
        self.times: deque[float] = deque(maxlen=BLOCK)  # of the last rounds, s

    def round(self, begin: Step, finish: Step) -> None:
        """Call `begin` and then `finish` with every component: what goes on by itself does so in between."""
        if self.watching:
            self._consider()
        clock = perf_counter()

        def step(node: Node) -> None:
            begin(node)
            finish(node)

        for i, batch in enumerate(self.batches):
            plan = self.plans[i] if self.plans else [self.here[i]]
            if self.ahead[i] or len(plan) > 1:
                self._together(begin, step, finish, batch, self.ahead[i], plan)
            else:
                for node in batch:
                    step(node)
        if self.watching:
            self.made += 1
            self.times.append(perf_counter() - clock)

    def close(self) -> None:
        """End the threads; the next round begins anew."""
        self._dismiss()
        self._reset()

    def _dismiss(self) -> None:
        for worker in self.workers:
            worker.inbox.put(None)
        for worker in self.workers:
            worker.thread.join(PATIENCE)
        self.workers, self.plans, self.done = [], [], SimpleQueue()
        self.watching = False

    def _together(
        self, begin: Step, step: Step, finish: Step, batch: list[Node], ahead: list[Node], plan: list[list[Node]]
    ) -> None:
        self._tried(begin, ahead)
        for worker, share in zip(self.workers, plan[1:], strict=False):
            worker.inbox.put(partial(self._work, step, share))
        self._work(step, plan[0])
        for _ in plan[1:]:
            self.done.get()
        self._tried(finish, [node for node in ahead if node.name not in self.failures])
        if self.failures:
            failures, self.failures = self.failures, {}
            raise next(failures[node.name] for node in batch if node.name in failures)

    def _tried(self, call: Step, nodes: Sequence[Node]) -> None:
        """Call with each of `nodes`; what fails is raised later, an interruption at once: an answer may never come."""
        for node in nodes:
            try:
                call(node)
            except Exception as error:
                self.failures[node.name] = error

    def _work(self, step: Step, share: Sequence[Node]) -> None:
        for node in share:
            try:
                step(node)
            except BaseException as error:  # raised again in the caller's thread
                self.failures[node.name] = error

    def _consider(self) -> None:
        """Try in the first rounds whether threads pay, and look later whether they still do."""
        made, last = self.made, list(self.times)[-SAMPLE:]
        if made == 1:
            self.before = self._books()
        elif self.always or made == 1 + SAMPLE:
            self._start()
            self.serial, self.watching = float(np.median(last or [0.0])), not self.always
        elif made == 2 + 2 * SAMPLE and np.median(last) >= self.serial:
            self._dismiss()
        elif made and made % BLOCK == 0:
            if made > BLOCK and sum(self.times) >= sum(wall for wall, _ in self._since().values()):
                self._dismiss()
            self.before = self._books()

    def _start(self) -> None:
        self.plans = [shares(batch, self._step_times(), self.most) for batch in self.here]
        self.workers = [_Worker(self.done) for _ in range(max(len(plan) for plan in self.plans) - 1)]

    def _books(self) -> dict[str, tuple[float, int]]:
        """Return the time spent in each component's steps so far, s, and their number."""
        return {node.name: (node.fmu.wall, node.fmu.solves) for batch in self.here for node in batch}

    def _since(self) -> dict[str, tuple[float, int]]:
        """Return the same, since it was noted in `before`."""
        now = self._books()
        return {name: (now[name][0] - wall, now[name][1] - solves) for name, (wall, solves) in self.before.items()}

    def _step_times(self) -> dict[str, float]:
        """Return the mean time of a step of each component, s; 1 where nothing is known."""
        if self.always:
            return {node.name: 1.0 for node in self.nodes}
        return {name: wall / max(solves, 1) for name, (wall, solves) in self._since().items()}


class _Worker:
    """A thread that does what is put in its inbox, until that is None."""

    def __init__(self, done: SimpleQueue[None]):
        self.done = done
        self.inbox: SimpleQueue[Callable[[], None] | None] = SimpleQueue()
        self.thread = Thread(target=self._run, daemon=True)
        self.thread.start()

    def _run(self) -> None:
        with np.errstate(over="ignore", invalid="ignore"):  # as in the run's own thread
            while (task := self.inbox.get()) is not None:
                task()
                self.done.put(None)


def processors() -> int:
    """Return the number of processors this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@cache
def holds_interpreter(library: str) -> bool:
    """Return whether a library runs Python in the process of its host, as those of pythonfmu do."""
    return b"PyGILState_Ensure" in Path(library).read_bytes()


def compiled(nodes: list[Node]) -> list[Node]:
    """Return the components that can be stepped in threads."""
    return [node for node in nodes if isinstance(node.fmu.fmi, Isolated) or not _is_python(node.fmu.fmi)]


def _is_python(fmi: Fmi2) -> bool:
    return holds_interpreter(fmi.slave.dll._name)


def goes_on_by_itself(batch: list[Node]) -> list[Node]:
    """Return the components that are to be told first, and waited for last; none where there is no other."""
    alone = len(batch) == 1
    return [] if alone else [n for n in batch if isinstance(n.fmu.fmi, Isolated) and not isinstance(n.fmu, SubStepped)]


def shares(batch: list[Node], times: dict[str, float], most: int) -> list[list[Node]]:
    """Return what each of at most `most` threads steps: the longest step first, to the thread that is free first.

    What holds the interpreter falls to the first thread, the caller's.
    """
    order = sorted(compiled(batch), key=lambda node: -times[node.name])
    plan: list[list[Node]] = [[] for _ in range(max(1, min(most, len(order))))]
    for node in order:
        min(plan, key=lambda share: sum(times[n.name] for n in share)).append(node)
    plan[0] += [node for node in batch if node not in order]
    return plan


def independent(graph: Graph) -> list[list[Node]]:
    """Return the components in their order, cut before each that takes an output of one since the last cut."""
    batches: list[list[Node]] = []
    for node in graph.nodes:
        first = node.first + node.torn
        sources = {graph.links[first + i].source[0] for i in range(node.forward.size)}
        if not batches or sources & {earlier.name for earlier in batches[-1]}:
            batches.append([])
        batches[-1].append(node)
    return batches
