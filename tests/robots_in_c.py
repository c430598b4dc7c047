"""The scaffold's robot in C, right and with one fault each: what a trial must tell apart."""

from __future__ import annotations

import subprocess
import zipfile
from functools import cache
from pathlib import Path
from tempfile import mkdtemp

from fmpy import platform, platform_tuple

from orchestrator.catalogue.project import write_project
from tests.fmus import compiler

Change = tuple[str, str, str]
"""File, what stands there, what stands in its place."""
LOADS = "loads[i] = r->value[LOADS + i] + r->value[RATES + i] * since_middle;"
SHOWN = "int ok = robot_step(&m->robot, H); memcpy(now, m->robot.value, sizeof now); "
LATE = (
    "double now[N_VARIABLES]; "
    + SHOWN
    + "memcpy(m->robot.value + BODY, m->robot.late + BODY, sizeof now - BODY * sizeof(double)); "
    "memcpy(m->robot.late, now, sizeof now); return ok ? fmi2OK : fmi2Error;"
)
STALE = (
    "double now[2 * N_LOADS]; memcpy(now, m->robot.value + LOADS, sizeof now); "
    "memcpy(m->robot.value + LOADS, m->robot.late, sizeof now); int ok = robot_step(&m->robot, H); "
    "memcpy(m->robot.value + LOADS, now, sizeof now); memcpy(m->robot.late, now, sizeof now); return ok ? fmi2OK : fmi2Error;"
)
FAULTS: dict[str, tuple[Change, ...]] = {
    "wrong sign": (("robot.c", LOADS, f"{LOADS} loads[4] = -loads[4];"),),
    "one axis ignored": (("robot.c", LOADS, f"{LOADS} loads[5] = 0;"),),
    "moments ignored": (("robot.c", "lever[i] + wrench[3 + i]", "lever[i]"),),
    "no lever": (("robot.c", "lever[i] + wrench[3 + i]", "wrench[3 + i]"),),
    "body's frame": (
        ("robot.c", "const double *wrench = loads + 4 + 6 * k;",
         "double wrench[6]; times(R, loads + 4 + 6 * k, wrench); times(R, loads + 7 + 6 * k, wrench + 3);"),
    ),
    "old outputs": (
        ("robot.h", "double time; ", "double late[N_VARIABLES]; double time; "),
        ("fmi2.c", "m->running = 1;", "m->running = 1; memcpy(m->robot.late, m->robot.value, sizeof m->robot.value);"),
        ("fmi2.c", 'return robot_step(&m->robot, H) ? fmi2OK : fail(m, fmi2Discard, "the motion is no longer finite");', LATE),
    ),
    "late loads": (
        ("robot.h", "double time; ", "double late[2 * N_LOADS]; double time; "),
        ("fmi2.c", 'return robot_step(&m->robot, H) ? fmi2OK : fail(m, fmi2Discard, "the motion is no longer finite");', STALE),
    ),
    "wrong mean": (("robot.c", "wheel[i] = i / 3 == 2", "wheel[i] = i < 3 ? wheel[i - 12] : i / 3 == 2"),),
    "rotation in one step only": (("robot.c", "? sums[i] : sums[i] / H", "? 0.5 * sums[i] : sums[i] / H"),),
    "state forgotten": (
        ("fmi2.c", "memcpy(&((Instance *)c)->robot, state, sizeof(Robot));",
         "memcpy(((Instance *)c)->robot.value, state, sizeof((Robot *)state)->value);"),
    ),
    "slopes ignored": (("robot.c", " + r->value[RATES + i] * since_middle;", " + 0 * since_middle;"),),
    "slopes from the start": (("robot.c", "i * H / n - H / 2", "i * H / n"),),
    "no gyroscope": (("robot.c", "turning[i] -= gyro[i];", "turning[i] -= 0 * gyro[i];"),),
    "starts elsewhere": (("robot.c", "r->state[i] = r->value[START_POSITION + i] - b[i];", "r->state[i] = -b[i];"),),
    "falls upwards": (("robot.c", "(i == 2 ? r->value[GRAVITY] : 0.0)", "(i == 2 ? -r->value[GRAVITY] : 0.0)"),),
    "axle too long": (("robot.c", "AXLE[3] = {1.0,", "AXLE[3] = {1.1,"),),
    "pitch down": (("robot.c", "body[10] = -asin(sine);", "body[10] = asin(sine);"),),
}  # fmt: skip
FAILS = "fails under load"
EXITS, HANGS = "leaves under load", "hangs under load"
FAILING: dict[str, tuple[Change, ...]] = {
    FAILS: (("robot.c", LOADS, f"{LOADS} if (loads[4] != 0) loads[4] = NAN;"),),
    EXITS: (
        ("robot.c", "#include <math.h>", "#include <math.h>\n#include <stdlib.h>"),
        ("robot.c", LOADS, f"{LOADS} if (loads[4] != 0) exit(0);"),
    ),
    HANGS: (("robot.c", LOADS, f"{LOADS} while (loads[4] != 0) {{}}"),),
}
"""Robots that give up; no faults of their mechanics."""
SILENT: tuple[Change, ...] = (
    ("modelDescription.xml", 'name="center_of_mass.', 'name="own.center_of_mass.'),
    ("modelDescription.xml", 'name="mass"', 'name="own.mass"'),
)
"""A robot that does not say what it is."""


@cache
def robot_in_c(fault: str = "", n_wheels: int = 1, silent: bool = False) -> Path:
    """Return the FMU of the scaffold's robot in C, with one of the `FAULTS`."""
    folder = write_project(Path(mkdtemp(prefix="robots-")) / "c_robot", "c", n_wheels)
    for file, before, after in (*(FAULTS | FAILING).get(fault, ()), *(SILENT if silent else ())):
        text = (folder / file).read_text(encoding="utf-8")
        assert before in text, f"{file}: {before}"
        (folder / file).write_text(text.replace(before, after), encoding="utf-8")
    return packed(folder)


def packed(folder: Path) -> Path:
    """Compile and zip a project in C; return its FMU."""
    face = next(folder.glob("fmi?.c"))
    library = folder / f"{folder.name}.so"
    sources = [str(folder / "robot.c"), str(face)]
    subprocess.run(
        [str(compiler()), "-std=c99", "-O1", "-fPIC", "-shared", *sources, "-o", str(library), "-lm"], check=True
    )
    place = platform if face.stem == "fmi2" else platform_tuple
    with zipfile.ZipFile(folder / f"{folder.name}.fmu", "w") as archive:
        archive.write(folder / "modelDescription.xml", "modelDescription.xml")
        archive.write(library, f"binaries/{place}/{library.name}")
    return folder / f"{folder.name}.fmu"
