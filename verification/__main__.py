"""Run the studies and write ``docs/verification.md``; exit status 1 when a tolerance is missed."""

from __future__ import annotations

import argparse
import re
import sys
import time
from importlib import import_module
from pathlib import Path
from types import ModuleType

import matplotlib

from verification.study import page_section

SECTIONS = {
    "cable": "Cable",
    "exchange": "Exchange within a macro step",
    "coupling": "Coupling",
    "system": "Whole system",
}
"""Package below `verification` → heading, in the order of the page."""
ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs" / "verification.md"
HEAD = """# Verification

Every number on this page is written by `make verify` (`python -m verification`): computed by the code of this commit
and held against a closed form, an invariant or an independent method. *error* is relative unless marked *abs.*
"""


def studies() -> dict[str, ModuleType]:
    """Return all studies by name, ``section.study``."""
    found = {}
    for section in SECTIONS:
        for module in import_module(f"verification.{section}").STUDIES:
            found[f"{section}.{module.__name__.rpartition('.')[2]}"] = module
    return found


def read_page(page: Path) -> dict[str, str]:
    """Return the parts of the page by the name of their study; empty where there is no page yet."""
    text = page.read_text() if page.exists() else ""
    parts = re.split(r"<!-- study (\S+) -->\n", text.partition("\n## ")[2])
    return {
        name: re.split(r"\n## ", body)[0].strip() + "\n" for name, body in zip(parts[1::2], parts[2::2], strict=True)
    }


def write_page(page: Path, parts: dict[str, str]) -> None:
    """Write the page from the parts of its studies."""
    lines = [HEAD]
    for section, heading in SECTIONS.items():
        names = [name for name in studies() if name.startswith(f"{section}.") and name in parts]
        if names:
            lines.append(f"## {heading}\n")
            lines += [f"<!-- study {name} -->\n{parts[name]}" for name in names]
    page.write_text("\n".join(lines))


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m verification", description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help="a section or section.study; all when none is given")
    wanted = parser.parse_args().names
    matplotlib.use("Agg")
    known = studies()
    chosen = [n for n in known if not wanted or n in wanted or n.partition(".")[0] in wanted]
    if not chosen:
        parser.error(f"no such study; known are {', '.join(known)}")
    figures = PAGE.parent / "figures"
    figures.mkdir(parents=True, exist_ok=True)
    missed = []
    for name in chosen:
        start = time.perf_counter()
        result = known[name].run(figures)
        write_page(PAGE, read_page(PAGE) | {name: page_section(known[name], result)})
        missed += [f"{name}: {row.quantity}: error {row.error:.2e}" for row in result.rows if not row.passed]
        verdict = "ok" if result.passed else "MISSED"
        print(f"{name:32s} {verdict:7s} {len(result.rows)} rows, {time.perf_counter() - start:.1f} s", flush=True)
    print("\n".join(missed))
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
