"""The build: from a recipe to an FMU, the same bytes from the same input.

    python -m fmus.face.build [--out DIR]        builds those of our modules, without --out in the user's cache

An FMU holds the binary of pythonfmu, a script of its own name, and a copy of the sources under a name made of
their hash (see fmu_start.py). Each is put together in a process of its own, which imports that copy and reads
the table from it: what does not import there is not shipped.
"""

from __future__ import annotations

import argparse
import ast
import datetime
import hashlib
import importlib
import io
import json
import os
import re
import subprocess
import sys
import tempfile
import uuid
import zipfile
from collections.abc import Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pythonfmu
from pythonfmu._version import __version__ as PYTHONFMU_VERSION

from fmus.face import fmu_start
from fmus.face.fmu_start import NEEDS, digest, package_folder
from fmus.face.lock import locked
from fmus.face.model_description import documentation, model_description
from fmus.kernels import cache
from fmus.kernels.cache import user_folder
from fmus.kernels.notice import notice
from fmus.module import registry
from fmus.module.recipe import FmuRecipe, make_module
from fmus.module.variables import ModuleError, VariableTable

PYTHONFMU = Path(pythonfmu.__file__).parent
RECORD = "resources/recipe.json"
SHIPPED = ("pythonfmu", "llvmlite")
"""What is in every FMU, and what Numba brings."""
EPOCH = int(os.environ.get("SOURCE_DATE_EPOCH", 315532800))
"""Date of every file in an FMU, s: 1980-01-01 (zip knows none earlier) or what the environment asks for."""


@dataclass(frozen=True)
class Target:
    """An FMU that is wanted.

    Attributes
    ----------
    recipe : what it is made of
    path : where it is to be
    facts : what decides over its content, see `record`
    """

    recipe: FmuRecipe
    path: Path
    facts: Mapping[str, Any]

    @property
    def is_there(self) -> bool:
        """Whether the FMU at the path was made from these facts."""
        try:
            with zipfile.ZipFile(self.path) as archive:
                return json.loads(archive.read(RECORD)) == self.facts
        except (OSError, KeyError, ValueError, zipfile.BadZipFile):
            return False

    def ensured(self, *, anew: bool = False) -> Path:
        """Return the path of the FMU, built if need be: what is there needs no lock, its folder may be read-only."""
        if self.is_there and not anew:
            return self.path
        self.path.parent.mkdir(parents=True, exist_ok=True)
        with locked(self.path):
            return self.path if self.is_there and not anew else _build(self.recipe, self.path)


def plain(recipe: FmuRecipe, folder: Path) -> Target:
    """Return the FMU of `recipe` as ``NAME.fmu`` in `folder`."""
    return Target(recipe, Path(folder).resolve() / f"{recipe.name}.fmu", record(recipe))


def kept(recipe: FmuRecipe, folder: Path) -> Target:
    """Return the FMU of `recipe` as ``NAME-HASH.fmu`` in `folder`.

    The hash is that of all that decides over the content: two robots of one name and two versions of this program
    have a file each.
    """
    facts = record(recipe)
    digits = hashlib.sha256(json.dumps(facts, sort_keys=True).encode()).hexdigest()[:16]
    return Target(recipe, Path(folder).resolve() / f"{recipe.name}-{digits}.fmu", facts)


def build_fmu(recipe: FmuRecipe, folder: Path) -> Path:
    """Build ``NAME.fmu`` in `folder`, in a process of its own; return its path."""
    return plain(recipe, folder).ensured(anew=True)


def ensure_fmu(recipe: FmuRecipe, folder: Path) -> Path:
    """Build ``NAME.fmu`` in `folder` if it is missing or older than its sources; return its path."""
    return plain(recipe, folder).ensured()


def ensure_all(targets: Iterable[Target]) -> list[Path]:
    """Build those of many FMUs that are not there, as many at a time as there are processors; return all their paths."""
    targets = list(targets)
    missing = {target.path: target for target in targets if not target.is_there}
    if missing:
        notice(f"building FMUs ({', '.join(target.recipe.name for target in missing.values())}) …")
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            list(pool.map(Target.ensured, missing.values()))
    return [target.path for target in targets]


def record(recipe: FmuRecipe) -> dict[str, Any]:
    """Return what decides over the content of an FMU."""
    return {
        "recipe": json.loads(json.dumps(recipe.as_dict())),
        "sources": {name: digest(_source_folder(name)) for name in recipe.packages},
        "readme": hashlib.sha256(_readme(recipe).encode()).hexdigest()[:16],
        "pythonfmu": PYTHONFMU_VERSION,
        "epoch": EPOCH,
    }


def _source_folder(name: str) -> Path:
    folder = package_folder(name)
    if folder is None:
        raise ModuleError(f"package {name!r} cannot be found; put the folder that holds it on PYTHONPATH")
    return folder


def _readme(recipe: FmuRecipe) -> str:
    """Return the README beside the module of `recipe`."""
    name, *parts = recipe.factory.split(":")[0].split(".")
    path = _source_folder(name).joinpath(*parts[:-1], "README.md")
    return path.read_text(encoding="utf-8") if path.is_file() else ""


def _build(recipe: FmuRecipe, path: Path) -> Path:
    done = subprocess.run(
        [sys.executable, "-m", "fmus.face.build", "--assemble", str(path)],
        input=json.dumps(recipe.as_dict()),
        capture_output=True,
        text=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(_search_path())},
    )
    if done.returncode != 0:
        raise ModuleError(f"{path.name} was not built: {done.stderr.strip()}")
    return path


def _search_path() -> list[str]:
    """Return where this process imports from, without the FMUs it has loaded (pythonfmu puts them first)."""
    folders = [Path(entry).resolve() for entry in sys.path]
    return [str(folder) for folder in folders if not (folder / "slavemodule.txt").is_file()]


# --- in the process of one FMU ------------------------------------------------------------------------------


@dataclass(frozen=True)
class Bundle:
    """The copy of the sources inside an FMU.

    Attributes
    ----------
    name : the package's name, with the hash of the sources
    factory : the recipe's factory in that package
    files : path below ``resources`` → content
    """

    name: str
    factory: str
    files: Mapping[str, bytes]


def make_bundle(recipe: FmuRecipe, sources: Mapping[str, str]) -> Bundle:
    """Return the sources of the recipe's packages (name → digest) under one new name, imports rewritten."""
    name = "fmus_" + hashlib.sha256(json.dumps(sources, sort_keys=True).encode()).hexdigest()[:16]
    new_names = {package: name if package == "fmus" else f"{name}.{package}" for package in sources}
    files: dict[str, bytes] = {}
    for package, new_name in new_names.items():
        folder = _source_folder(package)
        for path in sorted(folder.rglob("*.py")):
            place = f"{new_name.replace('.', '/')}/{path.relative_to(folder).as_posix()}"
            files[place] = rename_imports(path.read_text(encoding="utf-8"), new_names, path).encode()
    package, _, rest = recipe.factory.partition(".")
    return Bundle(name, f"{new_names[package]}.{rest}", files)


def requirements(bundle: Bundle) -> list[str]:
    """Return the libraries that a bundle imports, as requirements of pip: those of ours with their versions."""
    trees = [ast.parse(content) for content in bundle.files.values()]
    nodes = [node for tree in trees for node in ast.walk(tree)]
    names = {alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names}
    names |= {node.module or "" for node in nodes if isinstance(node, ast.ImportFrom) and not node.level}
    there = {*sys.stdlib_module_names, *SHIPPED, bundle.name}
    return [name + NEEDS.get(name, "") for name in sorted({name.split(".")[0] for name in names} - there)]


def rename_imports(source: str, new_names: Mapping[str, str], path: Path) -> str:
    """Return `source` with the packages in its import statements renamed."""
    pattern = rf"^(\s*(?:from|import)\s+)({'|'.join(map(re.escape, new_names))})(?=[.\s])"
    renamed = re.sub(pattern, lambda match: match[1] + new_names[match[2]], source, flags=re.MULTILINE)
    for node in ast.walk(ast.parse(renamed)):
        if isinstance(node, ast.Import):
            left = [a.name for a in node.names if _is_in(a.name, new_names) or (not a.asname and "fmus_" in a.name)]
        elif isinstance(node, ast.ImportFrom) and not node.level:
            left = [node.module] if _is_in(node.module or "", new_names) else []
        else:
            continue
        if left:
            raise ModuleError(f"{path}, line {node.lineno}: import {left[0]}: write `from … import …`, one a line")
    return renamed


def _is_in(module: str, packages: Mapping[str, str]) -> bool:
    return module.split(".")[0] in packages


def assemble(recipe: FmuRecipe) -> bytes:
    """Return the content of the FMU of `recipe`."""
    facts = record(recipe)
    bundle = make_bundle(recipe, facts["sources"])
    with tempfile.TemporaryDirectory(prefix=f"line-landing-{os.getpid()}-") as staging:
        for place, content in bundle.files.items():
            path = Path(staging, place)
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content)
        bundle_digest = digest(Path(staging, bundle.name))
        sys.path.insert(0, staging)
        table, values = _table_and_start(bundle, recipe)
    guid = str(uuid.uuid5(uuid.NAMESPACE_URL, json.dumps(facts, sort_keys=True)))
    date = datetime.datetime.fromtimestamp(EPOCH, datetime.UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
    script_name = f"{recipe.name}_{guid.replace('-', '')}"
    needs = requirements(bundle)
    script = make_script(recipe, script_name, facts["sources"], bundle, bundle_digest)
    files = {
        "modelDescription.xml": model_description(recipe, table, values, f"{{{guid}}}", date),
        "documentation/index.html": documentation(recipe, table, values, _readme(recipe), needs).encode(),
        "resources/requirements.txt": "\n".join([*needs, ""]).encode(),
        RECORD: json.dumps(facts, indent=1, sort_keys=True).encode(),
        "resources/slavemodule.txt": script_name.encode(),
        f"resources/{script_name}.py": script.encode(),
    }
    files |= {f"resources/{place}": content for place, content in bundle.files.items()}
    files |= {f"resources/pythonfmu/{path.name}": path.read_bytes() for path in PYTHONFMU.glob("*.py")}
    return pack(files | _binaries(recipe.name))


def _binaries(name: str) -> dict[str, bytes]:
    """Return the libraries of pythonfmu, one a platform, under the name of the FMU."""
    libraries = list((PYTHONFMU / "resources" / "binaries").glob("*/*.*"))
    if not libraries:
        raise ModuleError(f"{PYTHONFMU}: no binaries in this installation of pythonfmu; install it anew")
    return {f"binaries/{path.parent.name}/{name}{path.suffix}": path.read_bytes() for path in libraries}


def _table_and_start(bundle: Bundle, recipe: FmuRecipe) -> tuple[VariableTable, np.ndarray]:
    """Import the bundle, with its own `ModuleError`; return its module's table and start values."""
    importlib.import_module(bundle.name + ".face.slave")
    refusal = importlib.import_module(bundle.name + ".module.variables").ModuleError
    try:
        module = make_module(bundle.factory, recipe.arguments, recipe.start)
    except refusal as error:
        raise ModuleError(str(error)) from None
    return module.table, module.values


def make_script(
    recipe: FmuRecipe, script_name: str, sources: Mapping[str, str], bundle: Bundle, bundle_digest: str
) -> str:
    """Return the Python script of the FMU: fmu_start.py, then the slave's class."""
    return f"""{_start_text()}

BUNDLE = "{bundle.name}"
if "PACKAGE" not in globals():  # pythonfmu executes the script twice
    PACKAGE = load_package(Path(__file__).resolve().parent, {dict(sources)!r}, BUNDLE, "{bundle_digest}")
hold(globals())


class {script_name}(sys.modules[PACKAGE + ".face.slave"].ModuleSlave):
    \"\"\"The slave; pythonfmu needs a class with a method of its own.\"\"\"

    def __init__(self, **kwargs):
        factory = {{"fmus": "{recipe.factory}", BUNDLE: "{bundle.factory}"}}[PACKAGE]
        make_module = sys.modules[PACKAGE + ".module.recipe"].make_module
        super().__init__(make_module(factory, {dict(recipe.arguments)!r}, {dict(recipe.start)!r}), **kwargs)
"""


def _start_text() -> str:
    """Return kernels/cache.py and fmu_start.py as one script, which imports nothing of ours."""
    first, second = (Path(str(module.__file__)).read_text(encoding="utf-8") for module in (cache, fmu_start))
    for line in ("from __future__ import annotations\n", "from fmus.kernels.cache import prune, used, user_folder\n"):
        second = second.replace(line, "", 1)
    return f"{first}\n\n{second}"


def pack(files: Mapping[str, bytes]) -> bytes:
    """Return a zip archive of `files` (name → content) that depends on nothing else."""
    date = datetime.datetime.fromtimestamp(max(EPOCH, 315532800), datetime.UTC).timetuple()[:6]
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name in sorted(files):
            entry = zipfile.ZipInfo(name, date)
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.create_system = 3
            entry.external_attr = 0o644 << 16
            archive.writestr(entry, files[name], compresslevel=6)
    return buffer.getvalue()


def write_atomically(path: Path, content: bytes) -> None:
    """Write `content` to `path`, all of it or nothing."""
    draft = path.with_name(f".{path.stem}.{os.getpid()}{path.suffix}")
    try:
        draft.write_bytes(content)
        draft.chmod(0o644)
        os.replace(draft, path)
    except BaseException:
        draft.unlink(missing_ok=True)
        raise


def main() -> None:
    """Build every FMU, or (in the process of one FMU) assemble the recipe on the standard input."""
    parser = argparse.ArgumentParser(prog="python -m fmus.face.build", description="Build the FMUs.")
    parser.add_argument("--out", type=Path, help="folder of the FMUs; default: a cache of the user's")
    parser.add_argument("--assemble", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    try:
        if options.assemble:
            write_atomically(options.assemble, assemble(FmuRecipe(**json.load(sys.stdin))))
        else:
            recipes = [registry.find(key).recipe() for key in registry.OURS]
            out = options.out
            print(*ensure_all(plain(r, out) if out else kept(r, user_folder("fmus")) for r in recipes), sep="\n")
    except ModuleError as error:
        sys.exit(str(error))


if __name__ == "__main__":
    main()
