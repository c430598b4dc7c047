"""Sphinx extension: pages made from the code (variable tables, masters and their options, the command line).

They are written to ``reference/generated/`` before the pages are read, and are not kept under version control.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, get_args, get_type_hints

from plain_docstrings import LITERAL, sections

from fmus.module import registry
from fmus.module.variables import Variable, VariableTable

HEADINGS = {"parameter": "Parameters", "input": "Inputs", "output": "Outputs"}


# -- variables ----------------------------------------------------------------------------------------------------


def pattern(name: str) -> str:
    """Return ``port[k].force.{x,y,z}`` for ``port[2].force.y``: what stands for all rows of a kind."""
    name = re.sub(r"\[\d+\]", "[k]", name)
    name = re.sub(r"^(.*inertia)\.[xyz]{2}$", r"\1.{xx,yy,zz,xy,xz,yz}", name)
    return re.sub(r"\.[xyz]$", ".{x,y,z}", name)


def grouped(variables: Iterable[Variable]) -> dict[str, list[Variable]]:
    """Return the variables by their pattern, in table order."""
    groups: dict[str, list[Variable]] = {}
    for variable in variables:
        groups.setdefault(pattern(variable.name), []).append(variable)
    return groups


def start_value(variables: list[Variable]) -> str:
    """Return the start value that all have, the three of a vector, or nothing where they differ otherwise."""
    starts = [shown(v.start) for v in variables]
    if len(set(starts)) == 1:
        return starts[0]
    return ", ".join(starts[:3]) if variables[0].name.endswith(".x") else "various"


def shown(value: Any) -> str:
    """Return a value as it is written in a scenario."""
    if isinstance(value, bool):
        return str(value).lower()
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def meaning(variable: Variable) -> str:
    """Return the description, without the axis, with the words it may take, and whether it moves between steps alone."""
    text = re.sub(r", [xyz]$", "", variable.description)
    text = re.sub(r"\b0/(\d+) of its length", r"(k - 1)/\1 of its length", text)
    words = f" ({', '.join(f'`{word}`' for word in variable.choices)})" if variable.choices else ""
    discrete = " *Changes at communication points only.*" if variable.discrete else ""
    return cell(f"{text}{words}.{discrete}")


def cell(text: str) -> str:
    """Return `text` fit for a table of Markdown."""
    return text.replace("|", "\\|").replace("*)", "\\*)").replace("k * p", "k · p").replace("D * p", "D · p")


def variable_rows(variables: Iterable[Variable], causality: str) -> Iterator[str]:
    """Yield the lines of a table of variables; outputs have no start value, parameters may have bounds."""
    columns = {"parameter": ["start", "may be"], "input": ["start"]}.get(causality, [])
    heads = ["name", "unit", *columns, ""]
    yield f"| {' | '.join(heads)} |"
    yield "|" + "---|" * len(heads)
    for name, members in grouped(variables).items():
        first = members[0]
        cells = {"start": start_value(members), "may be": cell(str(first.bounds))}
        yield f"| {' | '.join([f'`{name}`', first.unit, *(cells[c] for c in columns), meaning(first)])} |"


def variables_page(title: str, table: VariableTable) -> str:
    """Return the part of a page that shows a module's variables."""
    lines = [f"# Variables of the {title}", ""]
    for causality, heading in HEADINGS.items():
        chosen = [v for v in table.variables if v.causality == causality]
        lines += [f"## {heading}", "", *variable_rows(chosen, causality), ""]
    return "\n".join(lines)


def tables() -> dict[str, VariableTable]:
    """Return the variable table of every module; the robot's is that of one wheel."""
    return {key: registry.find(key).table() for key in registry.OURS}


# -- masters ------------------------------------------------------------------------------------------------------


def masters_page() -> str:
    """Return the page of the masters: a line each, then what each is and its options with their defaults."""
    from orchestrator.coupling.masters import MASTERS
    from orchestrator.coupling.masters.options import master_options
    from orchestrator.coupling.stepping.implicit import Implicit

    keywords = inspect.signature(Implicit).parameters.values()
    shared = {p.name: p.default for p in keywords if p.kind is p.KEYWORD_ONLY}
    lines = ["# Masters and their options", "", "| master | |", "|---|---|"]
    lines += [f"| [`{name}`](#{name}) | {master.TITLE} |" for name, master in MASTERS.items()]
    lines += ["", "(implicit-options)=", "## Options of every implicit master", "", *option_table(Implicit, shared)]
    for name, options in master_options().items():
        master = MASTERS[name]
        inherited = shared if issubclass(master, Implicit) else {}
        own = {key: value for key, value in options.items() if key not in inherited or inherited[key] != value}
        lines += ["", f"({name})=", f"## {name}", "", *text_of(master), "", *option_table(master, own)]
        lines += ["", "And [those of every implicit master](#implicit-options)."] if inherited else []
    return "\n".join(lines) + "\n"


def option_table(master: type, options: dict[str, Any]) -> list[str]:
    """Return the table of some options of a master."""
    texts = option_texts(master)
    rows = [f"| `{key}` | {shown(value)} | {cell(texts.get(key, ''))} |" for key, value in options.items()]
    return ["| option | default | |", "|---|---|---|", *rows] if rows else []


def option_texts(master: type) -> dict[str, str]:
    """Return what the docstrings of a master and its bases say of each option."""
    texts: dict[str, str] = {}
    for base in master.__mro__:
        for heading, body in sections(inspect.cleandoc(base.__doc__ or "").splitlines()):
            if heading != "Parameters":
                continue
            for line in re.sub(r"\n\s+", " ", "\n".join(body)).splitlines():
                names, _, text = line.partition(" : ")
                texts |= {name.strip(): text for name in names.split(",") if name.strip() not in texts}
    return texts


def text_of(described: type) -> list[str]:
    """Return the text of a docstring before its first section, as Markdown; what it is good for begins a paragraph."""
    _, body = next(sections(inspect.cleandoc(described.__doc__ or "").splitlines()))
    text = re.sub(r"\s+(?=(Stability|When|Cost|Reference):\s)", "\n\n", "\n".join(body))
    label = r"^(Order|Order and stability|Stability|When|Cost|Reference):\s+(\w)(?=(\w*))"
    text = re.sub(label, lambda m: f"**{m[1]}.** {m[2].upper() if m[3] else m[2]}", marked_down(text), flags=re.M)
    return text.strip().splitlines()


def marked_down(text: str) -> str:
    """Return `text` with nothing as markup but its backticks and emphasis."""
    parts = LITERAL.split(text)
    return "".join(part if i % 2 else re.sub(r"([\\_|<\[\]])", r"\\\1", part) for i, part in enumerate(parts))


# -- command line -------------------------------------------------------------------------------------------------


def command_line_page() -> str:
    """Return the page of the command line, from the application itself."""
    import typer

    from orchestrator.cli.commands import app

    group = typer.main.get_command(app)
    lines = ["# Commands", "", str(group.help), ""]
    for name, command in sorted(leaves(group)):
        lines += [f"## {name}", "", str(command.help), "", "```text", usage(name, command), "```", ""]
        options = [p for p in command.params if p.param_type_name == "option" and not getattr(p, "hidden", False)]
        if options:
            kinds = value_names(command.callback)
            lines += ["| option | |", "|---|---|", *(option_row(p, kinds) for p in options), ""]
    return "\n".join([*lines, str(group.epilog), ""])


def leaves(group: Any, before: str = "") -> Iterator[tuple[str, Any]]:
    """Yield every command and its name, ``new scenario`` for one of a group."""
    for name, command in group.commands.items():
        if hasattr(command, "commands"):
            yield from leaves(command, f"{before}{name} ")
        elif not command.hidden:
            yield f"{before}{name}", command


def usage(name: str, command: Any) -> str:
    """Return the line that shows how the command is called."""
    arguments = [p.metavar or p.name.upper() for p in command.params if p.param_type_name == "argument"]
    return " ".join(["orchestrator", name, *arguments, "[OPTIONS]"])


def value_names(callback: Any) -> dict[str, str]:
    """Return for each argument of a command what its type is called on the command line."""
    names = {Path: "PATH", float: "NUMBER", int: "WHOLE", str: "TEXT"}
    hints = get_type_hints(callback)
    return {key: next((word for kind, word in names.items() if kind in flat(hint)), "") for key, hint in hints.items()}


def flat(hint: Any) -> set[Any]:
    """Return the classes that a type hint is made of."""
    return {hint}.union(*(flat(part) for part in get_args(hint)))


def option_row(option: Any, kinds: dict[str, str]) -> str:
    """Return the row of one option."""
    value = "" if option.is_flag else f" {option.metavar or kinds[option.name]}"
    return f"| `{', '.join(option.opts)}{cell(value)}` | {cell(option.help or '')} |"


# -- Sphinx -------------------------------------------------------------------------------------------------------


def write(folder: Path) -> None:
    """Write all generated pages into `folder`; a page that has not changed is left alone."""
    pages = {f"variables_{name}": variables_page(name, table) for name, table in tables().items()}
    pages |= {"masters": masters_page(), "commands": command_line_page()}
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in pages.items():
        path = folder / f"{name}.md"
        if not path.exists() or path.read_text() != text:
            path.write_text(text)


def setup(app: Any) -> dict[str, bool]:
    """Register the extension."""
    app.connect("builder-inited", lambda a: write(Path(a.srcdir) / "reference" / "generated"))
    return {"parallel_read_safe": True}
