"""A robot of one's own as a small project: an FMU in Python or in C, a scenario that lands it, and how to build both."""

from __future__ import annotations

import keyword
import re
import uuid
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal
from xml.sax.saxutils import quoteattr

from orchestrator.catalogue.names import require_file_name
from orchestrator.coupling.errors import InputError

FOLDER = Path(__file__).parent / "templates" / "robot"
Kind = Literal["python", "c", "fmi3"]
SPACING, HEIGHT = 0.3, 0.2152
"""m; of several wheels along the line, and of all over b: as the catalogue's fptlir has its one wheel."""
MOST_WHEELS = 4
FOLDERS = {
    "2.0": {"LINUX_FOLDER": "linux64", "WINDOWS_FOLDER": "win64", "DARWIN_FOLDER": "darwin64"},
    "3.0": {"LINUX_FOLDER": "x86_64-linux", "WINDOWS_FOLDER": "x86_64-windows", "DARWIN_FOLDER": "x86_64-darwin"},
}
"""Where a binary for 64 bits of Intel's kind lies in an FMU, by version of FMI."""
C_WORDS = {
    "auto", "break", "case", "char", "const", "continue", "default", "do", "double", "else", "enum", "extern", "float", "for",
    "goto", "if", "inline", "int", "long", "register", "restrict", "return", "short", "signed", "sizeof", "static", "struct",
    "switch", "typedef", "union", "unsigned", "void", "volatile", "while",
}  # fmt: skip


def write_project(name: str | Path, kind: Kind = "python", n_wheels: int = 1) -> Path:
    """Write a robot as a project into a new folder, and return that; nothing is ever overwritten.

    Parameters
    ----------
    name : of the folder and of the robot: letters, digits and underscores; a path may stand before it
    kind : ``python`` (pythonfmu), ``c`` (FMI 2.0) or ``fmi3`` (C, FMI 3.0)
    """
    folder = Path(name)
    require_file_name(name, folder.name)
    _require_name(folder.name)
    if not 1 <= n_wheels <= MOST_WHEELS:
        raise InputError(f"--wheels {n_wheels}: choose 1 to {MOST_WHEELS}")
    files = dict(_files(folder.name, kind, n_wheels))
    try:
        folder.mkdir(parents=True)
        for file, text in files.items():
            (folder / file).write_text(text, encoding="utf-8", newline="\n")
    except FileExistsError:
        raise InputError(f"{folder}: exists already; choose another name") from None
    except OSError as error:
        raise InputError(f"{folder}: cannot be written ({error.strerror}); choose another place") from None
    return folder


def _require_name(name: str) -> None:
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]{0,59}", name) or keyword.iskeyword(name) or name in C_WORDS:
        why = "a robot's name is that of a module and of a library: letters, digits and underscores, a letter first, no keyword"
        raise InputError(f"{name}: {why}; for a file of the catalogue add .toml")
    if name in ("fmi2", "fmi3", "fmu", "build", "numpy", "pickle", "pythonfmu", "robot"):
        raise InputError(
            f"{name}: is the name of something that the project needs; choose another, my_{name} for instance"
        )


def class_name(name: str) -> str:
    """Return ``MyRobot`` for ``my_robot``."""
    joined = "".join(part[:1].upper() + part[1:] for part in name.split("_"))
    return joined if joined != name else f"{joined}Fmu"


def _mounts(n_wheels: int) -> list[tuple[float, float, float]]:
    """Return the wheels' centres from b, m: one after the other along the line, b under their middle."""
    return [(0.0, SPACING * (k - 0.5 * (n_wheels - 1)), HEIGHT) for k in range(n_wheels)]


def _files(name: str, kind: Kind, n_wheels: int) -> Iterator[tuple[str, str]]:
    """Yield the files of a project, name and text."""
    mounts = [", ".join(f"{x:.10g}" if x else "0.0" for x in mount) for mount in _mounts(n_wheels)]
    version, face = ("3.0", "fmi3") if kind == "fmi3" else ("2.0", "fmi2")
    words = {
        "MOUNTS_PYTHON": ",\n          ".join(f"({mount})" for mount in mounts),
        "MOUNTS_C": ",\n    ".join(f"{{{mount}}}" for mount in mounts),
        "NUMBER_OF_WHEELS": str(n_wheels), "TITLE": name.replace("_", " "), "CLASS": class_name(name), "FACE": face,
        "FMI_VERSION": version, "FMU_FILE": f"{class_name(name) if kind == 'python' else name}.fmu", **FOLDERS[version],
    }  # fmt: skip
    sources = {"landing.toml": "landing.toml"}
    if kind == "python":
        sources |= {"README.md": "README_PYTHON.md", f"{name}.py": "python/NAME.py", "Makefile": "python/Makefile"}
    else:
        sources |= {"README.md": "README_C.md", f"{face}.c": f"{face}/{face}.c"}
        sources |= {file: f"c/{file}" for file in ("robot.c", "robot.h", "CMakeLists.txt", "Makefile")}
        yield "modelDescription.xml", description(name, version, n_wheels)
    pattern = re.compile("|".join(rf"(?<![A-Za-z0-9])(?:{word})(?![A-Za-z0-9])" for word in [*words, "NAME"]))
    for file, source in sources.items():
        text = (FOLDER / source).read_text(encoding="utf-8")
        yield file, pattern.sub(lambda found: (words | {"NAME": name})[found[0]], text)


# -- the description of the robot in C ------------------------------------------------------------------------


@dataclass(frozen=True)
class Real:
    """A variable of the description; its place in the list is its value reference, and its place in ``robot.h``."""

    name: str
    causality: str
    unit: str
    start: float
    text: str


def _vector(name: str, causality: str, unit: str, text: str, start: tuple[float, ...] = (0.0, 0.0, 0.0)) -> list[Real]:
    return [Real(f"{name}.{axis}", causality, unit, value, text) for axis, value in zip("xyz", start, strict=True)]


def variables(n_wheels: int) -> list[Real]:
    """Return the variables of the robot in C, in the order of ``robot.h``."""
    wheels = [f"wheel[{k + 1}]" for k in range(n_wheels)]
    return [*_parameters(wheels, n_wheels), *_loads(wheels, ""), *_loads(wheels, "_rate"), *_outputs(wheels)]


def _parameters(wheels: list[str], n_wheels: int) -> Iterator[Real]:
    inertia = {"xx": 5.42, "yy": 5.42, "zz": 8.5, "xy": 0.0, "xz": 0.0, "yz": 0.0}
    yield Real("mass", "parameter", "kg", 38.0, "mass")
    for entry, value in inertia.items():
        yield Real(f"inertia.{entry}", "parameter", "kg.m2", value, "inertia tensor about the centre of mass, in B")
    yield Real("gravity", "parameter", "m/s2", 9.8, "gravitational acceleration, along -Z")
    yield from _vector("center_of_mass", "parameter", "m", "centre of mass from b, in B", (0.0, 0.0, -0.1))
    yield from _vector("initial.position", "parameter", "m", "initial position of b")
    yield from _vector("initial.velocity", "parameter", "m/s", "initial velocity of b")
    for angle in ("roll", "pitch", "yaw"):
        yield Real(f"initial.{angle}", "parameter", "rad", 0.0, "initial angle")
    for wheel, mount in zip(wheels, _mounts(n_wheels), strict=True):
        yield from _vector(f"{wheel}.mount", "parameter", "m", "wheel centre from b, in B", mount)


def _loads(wheels: list[str], rate: str) -> Iterator[Real]:
    per = "/s" if rate else ""
    what = "slope within the macro step" if rate else "mean over the macro step"
    yield Real(f"thrust{rate}", "input", f"N{per}", 0.0, f"thrust at b along z_B, {what}")
    yield from _vector(f"torque{rate}", "input", f"N.m{per}", f"control torque in B, {what}")
    for wheel in wheels:
        yield from _vector(f"{wheel}.force{rate}", "input", f"N{per}", f"contact force, {what}")
        yield from _vector(
            f"{wheel}.moment{rate}", "input", f"N.m{per}", f"contact moment about the wheel centre, {what}"
        )


def _outputs(wheels: list[str]) -> Iterator[Real]:
    yield from _vector("body.position", "output", "m", "position of b")
    yield from _vector("body.velocity", "output", "m/s", "velocity of b")
    yield from _vector("body.angular_velocity", "output", "rad/s", "angular velocity")
    for angle in ("roll", "pitch", "yaw"):
        yield Real(angle, "output", "rad", 0.0, "R = Rz(yaw) Ry(pitch) Rx(roll)")
    yield Real("kinetic_energy", "output", "J", 0.0, "kinetic energy")
    yield Real("gravitational_energy", "output", "J", 0.0, "m g Z of the centre of mass")
    for wheel in wheels:
        yield from _vector(f"{wheel}.position", "output", "m", "wheel centre")
        yield from _vector(f"{wheel}.axle", "output", "1", "axle, unit vector")
        yield from _vector(f"{wheel}.velocity", "output", "m/s", "velocity of the wheel centre")
        yield from _vector(f"{wheel}.angular_velocity", "output", "rad/s", "angular velocity")
        yield from _vector(f"{wheel}.position_mean", "output", "m", "time mean over the last macro step")
        yield from _vector(f"{wheel}.axle_mean", "output", "1", "time mean over the last macro step")
        yield from _vector(
            f"{wheel}.rotation", "output", "rad", "integral of the angular velocity over the last macro step"
        )
        yield from _vector(f"{wheel}.rotation_mean", "output", "rad", "time mean of that running integral")


UNITS = {
    "kg": {"kg": 1}, "kg.m2": {"kg": 1, "m": 2}, "m": {"m": 1}, "m/s": {"m": 1, "s": -1}, "m/s2": {"m": 1, "s": -2},
    "N": {"kg": 1, "m": 1, "s": -2}, "N/s": {"kg": 1, "m": 1, "s": -3}, "N.m": {"kg": 1, "m": 2, "s": -2},
    "N.m/s": {"kg": 1, "m": 2, "s": -3}, "J": {"kg": 1, "m": 2, "s": -2}, "rad": {"rad": 1}, "rad/s": {"rad": 1, "s": -1},
    "s": {"s": 1}, "1": {},
}  # fmt: skip
"""Unit → its exponents of base units."""


def description(name: str, version: str, n_wheels: int) -> str:
    """Return ``modelDescription.xml`` of the robot in C, for FMI 2.0 or 3.0."""
    reals = variables(n_wheels)
    token = uuid.uuid5(uuid.NAMESPACE_URL, f"line-landing/{name}/{version}/{n_wheels}")
    lines = _opening_3(name, f"{token}") if version == "3.0" else _opening_2(name, f"{token}")
    lines += ["  <UnitDefinitions>", *map(_unit, UNITS), "  </UnitDefinitions>"]
    lines.append('  <DefaultExperiment startTime="0" stopTime="2" stepSize="0.005"/>')
    lines += ["  <ModelVariables>", *(_variable(i, real, version) for i, real in enumerate(reals))]
    if version == "3.0":  # wants to have time among the variables
        place = f'valueReference="{len(reals)}" causality="independent" variability="continuous"'
        lines.append(f'    <Float64 name="time" {place} unit="s"/>')
    lines.append("  </ModelVariables>")
    outputs = [i for i, real in enumerate(reals) if real.causality == "output"]
    given = [i for i, real in enumerate(reals) if real.causality == "parameter"]
    lines += [
        "  <ModelStructure>",
        *_structure(outputs, given, version),
        "  </ModelStructure>",
        "</fmiModelDescription>",
        "",
    ]
    return "\n".join(lines)


CAN = 'canHandleVariableCommunicationStepSize="true"'


def _opening_2(name: str, token: str) -> list[str]:
    return [
        '<?xml version="1.0" encoding="UTF-8"?>',
        f'<fmiModelDescription fmiVersion="2.0" modelName="{name}" guid="{{{token}}}"',
        '    variableNamingConvention="structured" numberOfEventIndicators="0">',
        f'  <CoSimulation modelIdentifier="{name}" {CAN}',
        '      canGetAndSetFMUstate="true" canSerializeFMUstate="true"/>',
    ]


def _opening_3(name: str, token: str) -> list[str]:
    return [
        '<?xml version="1.0" encoding="UTF-8"?>',
        f'<fmiModelDescription fmiVersion="3.0" modelName="{name}" instantiationToken="{{{token}}}"',
        '    variableNamingConvention="structured">',
        f'  <CoSimulation modelIdentifier="{name}" {CAN}',
        '      canGetAndSetFMUState="true" canSerializeFMUState="true"/>',
    ]


def _unit(unit: str) -> str:
    exponents = "".join(f' {base}="{power}"' for base, power in UNITS[unit].items())
    return f'    <Unit name="{unit}"><BaseUnit{exponents}/></Unit>'


def _variable(place: int, real: Real, version: str) -> str:
    kind = "fixed" if real.causality == "parameter" else "continuous"
    head = f'name="{real.name}" valueReference="{place}" causality="{real.causality}" variability="{kind}"'
    text, unit = f"description={quoteattr(real.text)}", f'unit="{real.unit}"'
    start = f' start="{real.start:.10g}"' if real.causality != "output" else ""
    if version == "3.0":
        return f"    <Float64 {head} {unit}{start} {text}/>"
    return f"    <ScalarVariable {head} {text}><Real {unit}{start}/></ScalarVariable>"


def _structure(outputs: list[int], parameters: list[int], version: str) -> list[str]:
    """Return what outputs depend on: without a step on no input, at the start on the parameters."""
    if version == "3.0":
        known = [f'    <Output valueReference="{i}" dependencies=""/>' for i in outputs]
        given = " ".join(map(str, parameters))
        return known + [f'    <InitialUnknown valueReference="{i}" dependencies="{given}"/>' for i in outputs]
    given = " ".join(str(i + 1) for i in parameters)
    known = [f'      <Unknown index="{i + 1}" dependencies=""/>' for i in outputs]
    initial = [f'      <Unknown index="{i + 1}" dependencies="{given}"/>' for i in outputs]
    return ["    <Outputs>", *known, "    </Outputs>", "    <InitialUnknowns>", *initial, "    </InitialUnknowns>"]
