"""A description held against the official schema of SSP 1.0, which comes with FMPy."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import Any

import fmpy.ssp

etree: Any = import_module("lxml.etree")  # compiled, and without types
SCHEMAS = Path(fmpy.ssp.__file__).parent / "schema"
MOST = 3
"""Violations that are told."""


def violations(content: bytes, schema: str) -> list[str]:
    """Return what the schema says against a file that has no document type, a line each; the first few."""
    parser = etree.XMLParser(resolve_entities=False, no_network=True, huge_tree=False)
    rules = etree.XMLSchema(etree.parse(str(SCHEMAS / schema)))
    try:
        if rules.validate(etree.fromstring(content, parser)):
            return []
    except etree.XMLSyntaxError as error:  # what another parser has let pass
        return [str(error)]
    found = [f"line {entry.line}: {entry.message}" for entry in rules.error_log]
    return found[:MOST]
