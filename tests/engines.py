"""Systems run by another engine in a process of its own: two test FMUs in a loop, p' = q and q' = -p, or a package.

    python -m tests.engines cosim FILE.fmu STEP COUNT
    python -m tests.engines cosim_osp FOLDER STEP COUNT SIGNAL …

All engines step all FMUs and then move all outputs: FMPy's runner of system structures, libcosim (by libcosimpy) and ecos
(by ecospy, which needs oneTBB). A package is one that `orchestrator export` has written.
"""

from __future__ import annotations

import contextlib
import ctypes
import json
import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

U, Y, GAIN, START = 1, 2, 3, 4
"""Value references of tests/fmus/lag2.xml."""


def cosim(path: str, H: float, n: int) -> list[list[float]]:
    """Return p and q after each of `n` steps of `H` s by libcosim's fixed-step algorithm."""
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimObserver import CosimObserver
    from libcosimpy.CosimSlave import CosimLocalSlave

    execution, observer = CosimExecution.from_step_size(round(H * 1e9)), CosimObserver.create_last_value()
    p, q = (execution.add_local_slave(CosimLocalSlave(path, name)) for name in "pq")
    execution.real_initial_value(p, START, 1.0)
    execution.real_initial_value(q, GAIN, -1.0)
    execution.connect_real_variables(p, Y, q, U)
    execution.connect_real_variables(q, Y, p, U)
    execution.add_observer(observer)
    rows = []
    for _ in range(n):
        execution.step()
        rows.append([observer.last_real_values(slave, [Y])[0] for slave in (p, q)])
    return rows


def fmpy_ssp(path: str, H: float, n: int, *signals: str) -> list[list[float]]:
    """Return the signals after each step by FMPy's runner, which sets no parameters; its first step has zeros as inputs."""
    return _by_fmpy(path, H, n, signals, None)


def fmpy_set(path: str, H: float, n: int, *signals: str) -> list[list[float]]:
    """The same, and the parameter set of the archive is given to it, which it does not look for itself."""
    from fmpy.ssp.ssd import read_ssv

    return _by_fmpy(path, H, n, signals, read_ssv(path, resource="resources/parameters.ssv"))


def _by_fmpy(path: str, H: float, n: int, signals: tuple[str, ...], parameters) -> list[list[float]]:
    from fmpy.ssp.simulation import simulate_ssp

    found = simulate_ssp(path, stop_time=(n - 0.5) * H, step_size=H, parameter_set=parameters)
    return np.array([found[signal] for signal in signals]).T.tolist()


def cosim_osp(path: str, H: float, n: int, *signals: str) -> list[list[float]]:
    """Return the signals after each step by libcosim, which reads the step from the structure."""
    from libcosimpy.CosimExecution import CosimExecution

    return _by_cosim(CosimExecution.from_osp_config_file(path), n, signals)


def cosim_ssp(path: str, H: float, n: int, *signals: str) -> list[list[float]]:
    """The same from an archive."""
    from libcosimpy.CosimExecution import CosimExecution

    return _by_cosim(CosimExecution.from_ssp_file(path, round(H * 1e9)), n, signals)


def _by_cosim(execution, n: int, signals: tuple[str, ...]) -> list[list[float]]:
    from libcosimpy.CosimObserver import CosimObserver

    observer = CosimObserver.create_last_value()
    execution.add_observer(observer)
    places = []
    for signal in signals:
        name, _, variable = signal.partition(".")
        slave = execution.slave_index_from_instance_name(name)
        references = {one.name.decode(): one.reference for one in execution.slave_variables(slave)}
        places.append((slave, [references[variable]]))
    rows = []
    for _ in range(n):
        execution.step()
        rows.append([observer.last_real_values(*place)[0] for place in places])
    return rows


def _with_tbb() -> None:
    with contextlib.suppress(OSError):  # the library does not look where the package `tbb` puts it
        ctypes.CDLL(str(Path(sys.prefix) / "lib" / "libtbb.so.12"), mode=ctypes.RTLD_GLOBAL)


def ecos_ssp(path: str, H: float, n: int, *signals: str) -> list[list[float]]:
    """Return the signals after each step by ecos, which takes no parameter set unless it is told its name."""
    return _by_ecos(path, H, n, signals, None)


def ecos_set(path: str, H: float, n: int, *signals: str) -> list[list[float]]:
    """The same, and the parameter set of the archive is named to it."""
    from fmpy.ssp.ssd import read_ssv

    return _by_ecos(path, H, n, signals, read_ssv(path, resource="resources/parameters.ssv").name)


def _by_ecos(path: str, H: float, n: int, signals: tuple[str, ...], parameters: str | None) -> list[list[float]]:
    _with_tbb()
    from ecospy import EcosSimulation

    rows = []
    with EcosSimulation(ssp_path=path, step_size=H) as simulation:
        simulation.init(parameter_set=parameters)
        for _ in range(n):
            simulation.step()
            rows.append([simulation.get_real(signal.replace(".", "::", 1)) for signal in signals])
    return rows


def ecos(path: str, H: float, n: int) -> list[list[float]]:
    """Return p and q after each of `n` steps of `H` s by ecos."""
    _with_tbb()
    from ecospy import EcosSimulation, EcosSimulationStructure

    with EcosSimulationStructure() as structure:
        for name in "pq":
            structure.add_model(name, path)
        structure.make_real_connection("p::y", "q::u")
        structure.make_real_connection("q::y", "p::u")
        structure.add_parameter_set("start", {"p::start": 1.0, "q::gain": -1.0})
        with EcosSimulation(structure=structure, step_size=H) as simulation:
            simulation.init(parameter_set="start")
            return [_stepped(simulation) for _ in range(n)]


def _stepped(simulation) -> list[float]:
    simulation.step()
    return [simulation.get_real("p::y"), simulation.get_real("q::y")]


ENGINES = {"cosim": cosim, "ecos": ecos}
RUNNERS = {one.__name__: one for one in (fmpy_ssp, fmpy_set, cosim_osp, cosim_ssp, ecos_ssp, ecos_set)}
"""What runs a package; those of SSP take the archive, that of OSP the folder."""
LIBRARIES = {"fmpy": "fmpy", "cosim": "libcosimpy", "ecos": "ecospy"}
REQUIRED = "LINE_LANDING_ENGINES"
"""Environment variable; ``required`` makes tests fail that would be skipped for want of another engine."""
ROOT = Path(__file__).resolve().parents[1]


def wanting(why: str) -> None:
    """Skip for want of an engine, or fail where they are required."""
    if os.environ.get(REQUIRED) == "required":
        pytest.fail(f"{why}, and {REQUIRED}=required", pytrace=False)
    pytest.skip(why)


def by_engine(engine: str, path: Path, H: float, n: int, *signals: str) -> np.ndarray:
    """What an engine says after each of `n` steps of `H` s, (n, m); the test is skipped where it is not installed."""
    library = LIBRARIES[engine.partition("_")[0]]
    if find_spec(library) is None:
        wanting(f"{library} is not installed: pip install -e '.[engines]'")
    command = [sys.executable, "-m", "tests.engines", engine, str(path), repr(H), str(n), *signals]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=600)
    if done.returncode != 0 and "cannot open shared object" in done.stderr:
        wanting(f"{engine} does not run here: {done.stderr.splitlines()[-1]}")
    rows = [line for line in done.stdout.splitlines() if line.startswith("[[")]
    assert done.returncode == 0 and rows, done.stderr
    return np.array(json.loads(rows[-1]))


if __name__ == "__main__":
    engine, file, length, count, *names = sys.argv[1:]
    print(json.dumps((ENGINES | RUNNERS)[engine](file, float(length), int(count), *names)), flush=True)
