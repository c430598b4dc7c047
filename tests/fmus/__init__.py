"""Small FMUs for the tests: built once into a temporary folder, and the systems made of them."""

from __future__ import annotations

import atexit
import shutil
import subprocess
import tempfile
import zipfile
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from fmpy import platform, platform_tuple
from fmpy.fmi2 import FMU2Model, FMU2Slave
from fmpy.fmi3 import FMU3Model, FMU3ScheduledExecution, FMU3Slave
from pythonfmu import FmuBuilder
from scipy.linalg import expm

from orchestrator.coupling.fmu.instance import Fmu
from orchestrator.coupling.fmu.sub_steps import instance
from orchestrator.coupling.graph.graph import Graph
from orchestrator.coupling.graph.links import Connection

SCRIPTS = Path(__file__).resolve().parent
OPTIONS = {"canGetAndSetFMUstate": True, "canSerializeFMUstate": True, "needsExecutionTool": False}


@cache
def _folder() -> Path:
    holder = tempfile.TemporaryDirectory(prefix="test-fmus-")
    atexit.register(holder.cleanup)
    return Path(holder.name)


def build(name: str, *, rollback: bool = True) -> Path:
    """Build ``NAME_fmu.py`` of this folder, once a process (``wave`` from ``link``); return the FMU."""
    return _built(name, rollback)


@cache
def _built(name: str, rollback: bool) -> Path:
    folder = _folder() / ("" if rollback else "no_rollback")
    folder.mkdir(exist_ok=True)
    script = SCRIPTS / f"{name}_fmu.py"
    if name == "wave":
        text = (SCRIPTS / "link_fmu.py").read_text(encoding="utf-8")
        script = folder / script.name
        script.write_text(text.replace("WAVE = False", "WAVE = True").replace("LinkTest", "WaveTest"), encoding="utf-8")
    options = {**OPTIONS, "canGetAndSetFMUstate": rollback, "canSerializeFMUstate": rollback}
    return Path(FmuBuilder.build_FMU(str(script), dest=str(folder), **options))


def compiler() -> str | None:
    """Return the C compiler of this machine, if it has one."""
    return shutil.which("cc") or shutil.which("gcc")


needs_compiler = pytest.mark.skipif(compiler() is None, reason="no C compiler on this machine")


@cache
def compiled(name: str) -> Path:
    """Compile a test FMU in C, ``lag1`` (FMI 1.0), ``lag2`` … or ``lag3`` …, on Linux; return it."""
    library, path = _folder() / f"{name}.so", _folder() / f"{name}.fmu"
    text = (SCRIPTS / f"{name}.c").read_text(encoding="utf-8")
    prefix, interfaces = ("fmi2", [FMU2Slave, FMU2Model])
    if name.endswith("3"):
        prefix, interfaces = "fmi3", [FMU3Slave, FMU3Model, FMU3ScheduledExecution]
    if name.endswith("1"):
        interfaces = []
    known = {n for interface in interfaces for n in dir(interface) if n.startswith(prefix)}
    # the standard wants every function there; those that are not used answer with an error
    text += "".join(
        f"int {function}(void) {{ return 3; }}\n"
        for function in sorted(known)
        if f" {function}(" not in text and f"*{function}(" not in text
    )
    source = _folder() / f"{name}.c"
    source.write_text(text, encoding="utf-8")
    options = ["-shared", "-fPIC", "-O1", f"-I{SCRIPTS}", str(source), "-o", str(library), "-lm"]
    subprocess.run([str(compiler()), *options], check=True)
    folder = platform if prefix == "fmi2" else platform_tuple
    with zipfile.ZipFile(path, "w") as archive:
        archive.write(SCRIPTS / f"{name}.xml", "modelDescription.xml")
        archive.write(library, f"binaries/{folder}/{name}.so")
    return path


def fmu(
    kind: str,
    name: str,
    *,
    rollback: bool = True,
    steps: int = 1,
    isolate: bool = False,
    **parameters: float | int | str,
) -> Fmu:
    """Return an instance of a test FMU with parameters set."""
    made = instance(build(kind, rollback=rollback), name, steps, isolate=isolate)
    made.set_parameters(parameters)
    return made


def started(instance: Fmu) -> Fmu:
    """Initialise an instance at t = 0 and return it."""
    instance.enter_initialization(0.0)
    instance.exit_initialization()
    return instance


def described(path: Path, folder: Path, *changes: tuple[str, str]) -> Path:
    """Copy an FMU with parts of its model description replaced."""
    copy = folder / f"changed_{path.name}"
    with zipfile.ZipFile(path) as old, zipfile.ZipFile(copy, "w") as new:
        for name in old.namelist():
            content = old.read(name)
            for before, after in changes if name == "modelDescription.xml" else ():
                assert before.encode() in content
                content = content.replace(before.encode(), after.encode())
            new.writestr(name, content)
    return copy


MILD = {"stiffness": 100.0, "damping": 1.0, "ground": 1000.0, "start": (0.1, 0.0)}
STIFF = {"stiffness": 1e6, "damping": 1.0, "ground": 1000.0, "start": (0.1, 0.1)}
MASS, GROUND, GROUND_DAMPING = 10.0, 10.0, 1.0


def oscillator(
    stiffness: float,
    damping: float,
    ground: float,
    start: tuple[float, float],
    *,
    waveform: bool = False,
    rollback: bool = True,
    steps: tuple[int, int] = (1, 1),
    isolate: bool = False,
) -> Graph:
    """Return two masses on springs to ground, coupled by a spring that belongs to the second one
    (force-displacement), with their sub-steps."""
    own = {"mass": MASS, "ground_stiffness": GROUND, "initial_position": start[0]}
    a = fmu("link", "a", rollback=rollback, steps=steps[0], isolate=isolate, **own)
    b = fmu(
        "wave" if waveform else "link",
        "b",
        steps=steps[1],
        isolate=isolate,
        mass=MASS,
        ground_stiffness=ground,
        ground_damping=GROUND_DAMPING,
        stiffness=stiffness,
        damping=damping,
        initial_position=start[1],
    )
    pairs = [("a.position", "b.left.position"), ("b.left.force", "a.force")]
    if waveform:
        pairs += [("a.position_mean", "b.left.position_mean"), ("b.left.force_rate", "a.force_rate")]
    else:
        pairs += [("a.velocity", "b.left.velocity")]
    return Graph({"a": a, "b": b}, [Connection(*pair) for pair in pairs])


def oscillator_solution(
    time: np.ndarray, stiffness: float, damping: float, ground: float, start: tuple[float, float]
) -> np.ndarray:
    """Return both positions, (len(time), 2), from the matrix exponential."""
    A = np.zeros((4, 4))
    A[0, 1] = A[2, 3] = 1.0
    A[1] = np.array([-(GROUND + stiffness), -damping, stiffness, damping]) / MASS
    A[3] = np.array([stiffness, damping, -(ground + stiffness), -(GROUND_DAMPING + damping)]) / MASS
    z0 = np.array([start[0], 0.0, start[1], 0.0])
    return np.array([(expm(A * t) @ z0)[[0, 2]] for t in time])


def chain(n: int, *, waveform: bool, stiffness: float = 200.0, damping: float = 0.0) -> Graph:
    """Return `n` equal masses, each coupled to its left neighbour by a spring; the first one starts
    displaced."""
    components, connections = {}, []
    for i in range(n):
        components[f"m{i}"] = fmu(
            "wave" if waveform else "link",
            f"m{i}",
            mass=1.0,
            ground_stiffness=10.0,
            stiffness=stiffness if i else 0.0,
            damping=damping if i else 0.0,
            initial_position=0.0 if i else 0.1,
        )
    for i in range(1, n):
        left, right = f"m{i - 1}", f"m{i}"
        connections += [Connection(f"{left}.position", f"{right}.left.position")]
        connections += [Connection(f"{right}.left.force", f"{left}.force")]
        if waveform:
            connections += [Connection(f"{left}.position_mean", f"{right}.left.position_mean")]
            connections += [Connection(f"{right}.left.force_rate", f"{left}.force_rate")]
        else:
            connections += [Connection(f"{left}.velocity", f"{right}.left.velocity")]
    return Graph(components, connections)


def chain_solution(time: np.ndarray, n: int, stiffness: float = 200.0, damping: float = 0.0) -> np.ndarray:
    """Return the positions of the chain, (len(time), n), from the matrix exponential."""
    difference = np.diff(np.eye(n), axis=0)
    K, C = 10.0 * np.eye(n) + stiffness * difference.T @ difference, damping * difference.T @ difference
    A = np.block([[np.zeros((n, n)), np.eye(n)], [-K, -C]])
    z0 = np.zeros(2 * n)
    z0[0] = 0.1
    return np.array([(expm(A * t) @ z0)[:n] for t in time])
