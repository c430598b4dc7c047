"""The kernels of our modules, compiled side by side before they are first used.

    python -m fmus.face.first_use             compiles all that are missing, in several processes
    python -m fmus.face.first_use NAME        compiles those of one module, in this one

Numba compiles in one thread of one process; cable, contact and robot know nothing of each other.
"""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from importlib import import_module

from fmus.face.lock import locked
from fmus.kernels.cache import user_folder
from fmus.kernels.jit import is_compiled
from fmus.kernels.notice import notice
from fmus.module import registry
from fmus.module.variables import ModuleError

LANDING = tuple(key for key in registry.OURS if registry.MODULES[key].contract)
"""The modules of a landing; those that take longest come first."""


def compile_modules(names: Sequence[str] = LANDING) -> None:
    """Compile the kernels of the modules `names` if they are not, as many modules at a time as there are processors."""
    if not _uncompiled(names):
        return
    with contextlib.suppress(ModuleError), locked(user_folder("kernels") / "first_use"):  # else each does it for itself
        left, start = _uncompiled(names), time.monotonic()
        if left:
            notice(f"compiling kernels ({', '.join(left)}) for this machine, once; this takes about a minute …")
            with ThreadPoolExecutor(os.cpu_count()) as pool:
                list(pool.map(_compile_elsewhere, left))
            notice(f"kernels were compiled in {time.monotonic() - start:.0f} s")


def _uncompiled(names: Sequence[str]) -> list[str]:
    files = {name: registry.find(name).factory.partition(":")[0] for name in names}
    for file in files.values():
        import_module(file)
    return [name for name, file in files.items() if not is_compiled(file.rpartition(".")[0])]


def _compile_elsewhere(name: str) -> None:
    """Compile in a process of its own; what fails there will fail here, where it is said."""
    path = os.pathsep.join(entry or os.getcwd() for entry in sys.path)
    call = [sys.executable, "-m", "fmus.face.first_use", name]
    subprocess.run(call, capture_output=True, check=False, env={**os.environ, "PYTHONPATH": path})


def compile_module(name: str) -> None:
    """Call every kernel of a module that a run calls."""
    recipe = registry.find(name).recipe()
    module = recipe.make_module()
    module.initialize(0.0)
    module.step(0.0, recipe.step_size)
    module.refresh()


if __name__ == "__main__":
    if sys.argv[1:]:
        compile_module(sys.argv[1])
    else:
        compile_modules()
