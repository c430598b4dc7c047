"""The monolithic solver as WebAssembly, from the kernels that Python runs: ``python -m orchestrator.landing.monolithic.wasm``.

Numba lowers the entry kernels to LLVM's language for a processor without vector units and without optimising, since code
optimised for one machine holds what only that machine has. llvmlite makes it anew for wasm32, optimises it, and LLVM's
linker ``wasm-ld`` makes the module. Numba's settings are those of a process, hence one of its own. It takes a minute.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from fmus.kernels import notice

MODULE, ABOUT = "landing.wasm", "landing.json"
GENERIC = {
    "NUMBA_OPT": "0",
    "NUMBA_CPU_NAME": "generic",
    "NUMBA_CPU_FEATURES": "",
    "NUMBA_LOOP_VECTORIZE": "0",
    "NUMBA_SLP_VECTORIZE": "0",
    "NUMBA_DISABLE_JIT": "0",
}
"""Settings of Numba with which kernels are lowered."""
TRIPLE = "wasm32-unknown-unknown"
LAYOUT = "e-m:e-p:32:32-p10:8:8-p20:8:8-i64:64-i128:128-n32:64-S128-ni:1:10:20"
STACK = 1 << 20
"""Bytes of the stack; the memory of a landing comes behind it, and grows to what its block needs."""
MISSING = (
    "no linker for WebAssembly: install LLVM's (Debian: apt-get install lld), or the Python package ziglang; "
    "pages have no what-if until then"
)


class NoLinker(Exception):
    """There is no ``wasm-ld``."""


def linker() -> list[str]:
    """Return the command that links WebAssembly; `NoLinker` where there is none."""
    names = ["wasm-ld", *(f"wasm-ld-{number}" for number in range(30, 10, -1))]
    for found in filter(None, map(shutil.which, names)):
        return [found]
    if find_spec("ziglang") is not None:
        return [sys.executable, "-m", "ziglang", "wasm-ld"]
    raise NoLinker(MISSING)


def build(folder: Path) -> dict[str, Any]:
    """Make module and description in `folder`, unless they are those of the present kernels; return the description.

    `NoLinker` where there is no linker.
    """
    command = linker()
    if is_made(folder):
        return json.loads((folder / ABOUT).read_text(encoding="utf-8"))
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as place:
        environment = {**os.environ, **GENERIC, "LINE_LANDING_CACHE": place}
        code = f"from orchestrator.landing.monolithic.wasm import lower; lower({place!r})"
        subprocess.run([sys.executable, "-c", code], env=environment, check=True)
        linked = Path(place, MODULE)
        _link(command, Path(place, "landing.o"), linked)
        about = json.loads(Path(place, ABOUT).read_text(encoding="utf-8")) | {"bytes": linked.stat().st_size}
        _placed(linked.read_bytes(), folder / MODULE)
        _placed(json.dumps(about, indent=1).encode() + b"\n", folder / ABOUT)
    return about


def is_made(folder: Path) -> bool:
    """Return whether `folder` holds the module of the present kernels, made by the present versions."""
    try:
        about = json.loads((folder / ABOUT).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return False
    size = (folder / MODULE).stat().st_size if (folder / MODULE).is_file() else -1
    return {**about, **made_from()} == about and about.get("bytes") == size


def made_from() -> dict[str, str]:
    """Return what decides over the module: kernels, how they are lowered, versions."""
    from orchestrator.landing.monolithic.block import kernels_hash

    versions = {name: version(name) for name in ("numba", "llvmlite", "numpy")}
    recipe = hashlib.sha256(Path(__file__).read_bytes()).hexdigest()[:16]
    return {"kernels": kernels_hash(), "recipe": recipe, **versions}


def _placed(content: bytes, path: Path) -> None:
    """Write a file whole or not at all."""
    temporary = path.with_name(f".{path.name}.{os.getpid()}")
    temporary.write_bytes(content)
    os.replace(temporary, path)


def _link(command: Sequence[str], source: Path, target: Path) -> None:
    exports = [f"--export={name}" for name in (*ENTRIES, "__heap_base")]
    options = ["--no-entry", f"-zstack-size={STACK}", "--allow-undefined", "--gc-sections", "--strip-all", "-O2"]
    subprocess.run([*command, *options, *exports, "-o", str(target), str(source)], check=True)


# -- in the process of its own --------------------------------------------------------------------------------

ENTRIES: dict[str, tuple[str, ...]] = {"begin": (), "advance": ("t", "end"), "show": ()}
"""Functions of the module → what they take beside the block; each returns a number."""
SHIM = """
define double @{name}(ptr %block{parameters}) {{
  %result = alloca double
  %exception = alloca ptr
  %status = call i32 @{inner}(ptr %result, ptr %exception, ptr %block{arguments})
  %value = load double, ptr %result
  ret double %value
}}
"""
"""A function as JavaScript calls it, around one as Numba makes it."""
RESHAPE = """
define i32 @numba_attempt_nocopy_reshape(i64 %nd, ptr %d, ptr %s, i64 %n, ptr %dims, ptr %strides, i64 %size, i32 %f) {
start:
  %last = sub i64 %n, 1
  br label %loop
loop:
  %k = phi i64 [ %last, %start ], [ %before, %body ]
  %stride = phi i64 [ %size, %start ], [ %next, %body ]
  %more = icmp sge i64 %k, 0
  br i1 %more, label %body, label %end
body:
  %to = getelementptr i64, ptr %strides, i64 %k
  store i64 %stride, ptr %to
  %from = getelementptr i64, ptr %dims, i64 %k
  %dim = load i64, ptr %from
  %next = mul i64 %stride, %dim
  %before = sub i64 %k, 1
  br label %loop
end:
  ret i32 1
}
"""
"""What Numba's run time does for ``reshape`` of an array without gaps, all that kernels reshape."""


def lower(place: str) -> None:
    """Write the object file of the entry kernels for WebAssembly, and its description, to `place`."""
    import llvmlite.binding as llvm

    notice.muted = True
    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    whole = llvm.parse_assembly(f'target datalayout = "{LAYOUT}"\ntarget triple = "{TRIPLE}"\n{RESHAPE}')
    for name, (inner, code) in _lowered().items():
        extra = ENTRIES[name]
        text = _for_wasm(code) + SHIM.format(
            name=name,
            inner=inner,
            parameters="".join(f", double %{p}" for p in extra),
            arguments="".join(f", double %{p}" for p in extra),
        )
        whole.link_in(llvm.parse_assembly(text))
    whole.verify()
    for function in whole.functions:
        if not function.is_declaration:
            function.linkage = "external" if function.name in ENTRIES else "internal"
    machine = llvm.Target.from_triple(TRIPLE).create_target_machine(opt=3)
    tuning = llvm.create_pipeline_tuning_options(speed_level=3)
    tuning.loop_vectorization = tuning.slp_vectorization = False
    passes = llvm.create_pass_builder(machine, tuning)
    passes.getModulePassManager().run(whole, passes)
    Path(place, "landing.o").write_bytes(machine.emit_object(whole))
    imports = sorted(f.name for f in whole.functions if f.is_declaration and not f.name.startswith("llvm."))
    about = {**made_from(), "exports": [*ENTRIES, "memory", "__heap_base"], "imports": imports}
    Path(place, ABOUT).write_text(json.dumps(about), encoding="utf-8")


def _lowered() -> dict[str, tuple[str, str]]:
    """Return for every entry the name of the function that Numba makes, and the code of all that it calls."""
    import numba
    from numba import types

    _without_machine_code()
    pointer, number = types.CPointer(types.float64), types.float64
    found = dict[str, tuple[str, str]]()
    for name, function in _entries().items():
        signature = number(pointer, *(number for _ in ENTRIES[name]))
        options: dict[str, Any] = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
        compiled = numba.njit([signature], error_model="numpy", **options)(function)
        result = compiled.overloads[signature.args]
        found[name] = result.fndesc.mangled_name, compiled.inspect_llvm(signature.args)
    return found


def _without_machine_code() -> None:
    """Keep Numba from making code for this machine, which nobody runs, and from keeping it: nine tenths of the time."""
    from numba.core import caching, codegen

    library, cache = codegen.JITCodeLibrary, caching.Cache
    spared = [(library, name) for name in ("_finalize_specific", "_optimize_final_module", "_optimize_functions")]
    spared += [(codegen.JITCPUCodegen, "set_env"), (cache, "load_overload"), (cache, "save_overload")]
    for owner, name in spared:
        setattr(owner, name, lambda *_: None)
    # what asks for a pointer to the code wants the library whole
    setattr(library, "get_pointer_to_function", lambda self, _: self._ensure_finalized() or 0)  # noqa: B010


def _entries() -> dict[str, Any]:
    """Return the functions of the module, on a block in memory."""
    import numba

    from orchestrator.landing.monolithic import entry

    unpack = numba.njit(error_model="numpy")(_unpack())
    grant, start, advanced, shown = entry.grant, entry.begin, entry.advance_interval, entry.show

    def begin(block):
        system, state, _control, wanted, _shown, space, work = unpack(block)
        status = grant(system, state, wanted)
        if status == 0:
            status = start(system, state, 0.0, space, work)
        return float(status)

    def advance(block, t, end):
        system, state, control, wanted, _shown, space, work = unpack(block)
        status, reached = advanced(system, state, control, wanted, t, end, space, work)
        return reached if status == 0 else -1.0 - status

    def show(block):
        system, state, _control, _wanted, seen, space, work = unpack(block)
        shown(system, state, seen, space, work)
        return 0.0

    return {"begin": begin, "advance": advance, "show": show}


def _unpack() -> Any:
    """Return the function that rebuilds the parts of a landing from its block."""
    import numba
    from numba import types

    from orchestrator.landing.monolithic import block

    kinds = {"real": types.float64, "complex": types.complex128, "whole": types.int64, "truth": types.boolean}
    names: dict[str, Any] = {name: _pointer(kind) for name, kind in kinds.items()}
    names["carray"] = numba.carray  # type: ignore[attr-defined]
    names |= {type(part).__name__: type(part) for part in _tuples(block.example())}
    exec(block.unpack_source(), names)
    return names["unpack"]


def _tuples(value: Any) -> list[tuple]:
    found = [part for field in value for part in _tuples(field)] if isinstance(value, tuple) else []
    return [*found, value] if isinstance(value, tuple) else []


def _pointer(kind: Any) -> Any:
    """Return what gives kernels a pointer to another type, so many words behind a pointer to words."""
    from numba import types
    from numba.extending import intrinsic

    @intrinsic
    def place(_context, block, word):
        def code(context, builder, _signature, arguments):
            there = builder.gep(arguments[0], [arguments[1]])
            return builder.bitcast(there, context.get_value_type(types.CPointer(kind)))

        return types.CPointer(kind)(block, word), code

    return place


def _for_wasm(code: str) -> str:
    """Return LLVM code made for another machine as it is to be for wasm32."""
    code = re.sub(r'target triple = ".*"', f'target triple = "{TRIPLE}"', code)
    code = re.sub(r'target datalayout = ".*"', f'target datalayout = "{LAYOUT}"', code)
    for name in ("NRT_incref", "NRT_decref"):  # nothing is allocated, nothing is counted
        code = re.sub(rf"define [^@\n]*@{name}\([^{{]*\{{.*?\n\}}\n", "", code, flags=re.DOTALL)
        code = re.sub(rf"declare [^@\n]*@{name}\([^\n]*\n", "", code)
        if f"@{name}(" in code:
            code += f"define internal void @{name}(ptr %x) {{ ret void }}\n"
    code = re.sub(r"= common (local_unnamed_addr )?global", r"= internal \1global", code)
    code = re.sub(r" comdat(\([^)]*\))?", "", code)
    code = re.sub(r"^\$.*= comdat.*$", "", code, flags=re.MULTILINE)
    code = re.sub(r'"(target-cpu|target-features|tune-cpu)"="[^"]*"', "", code)
    code = code.replace("call double @sqrt(", "call double @llvm.sqrt.f64(")
    return re.sub(r"declare double @sqrt\(double\)[^\n]*", "declare double @llvm.sqrt.f64(double)", code)


def main() -> int:
    """Build into the folder given; status 1 where no linker is found, which is said."""
    parser = argparse.ArgumentParser(description="Build the monolithic solver as WebAssembly.")
    parser.add_argument("folder", type=Path)
    try:
        about = build(parser.parse_args().folder)
    except NoLinker as error:
        print(f"what-if: {error}", file=sys.stderr)
        return 1
    print(f"what-if: {MODULE}, {about['bytes'] / 1e3:.0f} kB, kernels {about['kernels']}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
