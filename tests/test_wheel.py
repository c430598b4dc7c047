"""The wheel in an empty environment: other folders, blanks and letters beyond ASCII in every path, nothing to write to.

The kernels are compiled anew, twice: `make test-wheel`, minutes.
"""

import json
import os
import shutil
import subprocess
import sys
import sysconfig
import venv
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow
ROOT = Path(__file__).resolve().parents[1]
UNPRIVILEGED = ["setpriv", "--bounding-set", "-dac_override,-dac_read_search"]
"""Without these even root is refused where the mode says so."""


@dataclass
class Installation:
    """An environment of its own with the wheel in it, and where it is used: `home`, `tmp`, `work`."""

    environment: Path
    home: Path
    tmp: Path
    work: Path

    def __call__(self, *arguments: object, prefix: tuple[str, ...] = ()) -> subprocess.CompletedProcess[str]:
        """Run ``orchestrator`` with `arguments` in the working folder."""
        places = {"HOME": str(self.home), "TMPDIR": str(self.tmp), "PATH": os.environ["PATH"]}
        threads = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
        call = [*prefix, str(self.environment / "bin" / "orchestrator"), *map(str, arguments)]
        done = subprocess.run(call, cwd=self.work, env=places | threads, capture_output=True, text=True, timeout=1800)
        assert "Traceback" not in done.stderr, done.stderr
        return done


@pytest.fixture(scope="module")
def wheel(tmp_path_factory) -> Path:
    """The wheel, made from the source distribution."""
    out = tmp_path_factory.mktemp("dist")
    call = [sys.executable, "-m", "build", "--no-isolation", "--outdir", str(out), str(ROOT)]
    done = subprocess.run(call, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    (made,) = out.glob("*.whl")
    return made


@pytest.fixture(scope="module")
def installed(wheel, tmp_path_factory) -> Iterator[Installation]:
    """The wheel in an environment that finds its dependencies in the one that runs the tests."""
    base = tmp_path_factory.mktemp("Ort mit Lücke")
    places = [base / name for name in ("Umgebung Ä", "Zuhause é", "vorübergehend", "leer und 空")]
    for place in places[1:]:
        place.mkdir()
    venv.create(places[0], with_pip=True)
    packages = Path(sysconfig.get_path("purelib", vars={"base": str(places[0])}))
    (packages / "dependencies.pth").write_text(sysconfig.get_path("purelib") + "\n", encoding="utf-8")
    call = [str(places[0] / "bin" / "python"), "-m", "pip", "install", "--quiet", "--no-deps", "--no-index", str(wheel)]
    done = subprocess.run([*call, "--ignore-installed"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    yield Installation(*places)
    shutil.rmtree(base, ignore_errors=True)


def test_what_is_in_the_wheel(wheel, installed):
    listing = subprocess.run([sys.executable, "-m", "zipfile", "-l", str(wheel)], capture_output=True, text=True).stdout
    names = {line.split()[0] for line in listing.splitlines()}
    assert {f"orchestrator/scenarios/{path.name}" for path in (ROOT / "scenarios").glob("*.toml")} <= names
    assert {f"orchestrator/studies/paper/{name}.toml" for name in ("claims", "landings")} <= names
    robots = (ROOT / "orchestrator" / "catalogue" / "robots").glob("*.toml")
    assert {f"orchestrator/catalogue/robots/{path.name}" for path in robots} <= names
    assert {"fmus/py.typed", "orchestrator/py.typed", "fmus/cable/README.md"} <= names
    web = {name.partition("report/web/")[2] for name in names if "report/web/" in name}
    built = ROOT / "orchestrator" / "report" / "web" / "dist"
    if (built / "build.json").is_file():
        files = {*json.loads((built / "build.json").read_text(encoding="utf-8"))["files"], "build.json"}
        assert {f"dist/{name}" for name in files} <= web, "what `make page` has built"
    assert all(name.startswith("dist/") for name in web), "sources and packages stay out"
    assert any(name.endswith("dist-info/licenses/LICENSE") for name in names)
    assert {name.partition("/")[0] for name in names if ".dist-info" not in name} - {"File"} == {"fmus", "orchestrator"}


def test_it_lists_runs_and_compares_in_an_empty_folder(installed):
    listed = installed("list")
    assert listed.returncode == 0 and "landing_200m_point9" in listed.stdout and "fptlir" in listed.stdout
    first = installed("run", "landing_200m_point9", "--stop", 1)
    assert first.returncode == 0, first.stderr
    assert "compiling kernels" in first.stderr and "kernels were compiled in" in first.stderr
    compared = installed("compare", "drop_5cm", "--stop", 0.1)
    assert compared.returncode == 0, compared.stderr
    again = installed("compare", "drop_5cm", "--stop", 0.1)
    assert again.returncode == 0 and "compil" not in again.stderr and "building" not in again.stderr
    assert installed("reproduce", "--only", "T2-yaw,T4", "--out", "runs/paper").returncode == 0
    assert (installed.work / "runs" / "paper" / "reproduction.json").is_file()
    assert [path.name for path in installed.work.iterdir()] == ["runs"]
    kept = installed.home / ".cache" / "line-landing"
    assert {path.name.partition("-")[0] for path in (kept / "fmus").iterdir()} >= {"cable", "contact", "fptlir"}
    assert list((kept / "kernels").glob("*/*/*.nbi"))


def test_with_nothing_to_write_to_but_the_temporary_folder(installed):
    prefix = tuple(UNPRIVILEGED) if os.getuid() == 0 else ()
    if prefix and shutil.which(prefix[0]) is None:
        pytest.skip("root, and no setpriv: no file can be made read-only")
    kept = installed.tmp / f"line-landing-{os.getuid()}"
    shutil.copytree(installed.home / ".cache" / "line-landing", kept, dirs_exist_ok=True)
    for place in (installed.environment, installed.home):
        _make_read_only(place)
    done = installed("run", "landing_200m_point9", "--stop", 0.1, "--out", "Ergebnis ß", prefix=prefix)
    assert done.returncode == 0, done.stderr
    said = [line for line in done.stderr.splitlines() if line.startswith("line-landing:")]
    assert "cannot be written; caches are kept in" in said[0], done.stderr
    assert ["FMUs cannot be loaded from" in line for line in said[1:]] in ([], [True]), "once each, and nothing is made"
    assert (installed.work / "Ergebnis ß" / "manifest.json").is_file()


def _make_read_only(place: Path) -> None:
    for path in (place, *place.rglob("*")):
        if not path.is_symlink():
            path.chmod(path.stat().st_mode & 0o555)
