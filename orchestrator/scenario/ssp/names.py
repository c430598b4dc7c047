"""Names of SSP 1.0 and of OSP's system structure: what is read, and what is written."""

from __future__ import annotations

DEFAULT_SSD = "SystemStructure.ssd"
"""The file of an archive that says what the system is; others beside it are variants."""
OSP_FILE = "OspSystemStructure.xml"

STANDARD = "http://ssp-standard.org/SSP1"
SSC, SSD, SSV, SSM = (
    f"{STANDARD}/SystemStructure{part}" for part in ("Common", "Description", "ParameterValues", "ParameterMapping")
)
"""Namespaces."""
PREFIXES = {"ssc": SSC, "ssd": SSD, "ssv": SSV, "ssm": SSM}
OSP = "http://opensimulationplatform.com/MSMI/OSPSystemStructure"

FMU_TYPES = ("application/x-fmu-sharedlibrary", "application/x-fmu-xml")
"""Types of a component that are an FMU."""
PARAMETER_SET, PARAMETER_MAPPING = "application/x-ssp-parameter-set", "application/x-ssp-parameter-mapping"
KINDS = {"real": "Real", "integer": "Integer", "boolean": "Boolean", "string": "String"}
"""What SSP, and OSP, call a kind of variable."""

ANNOTATION = "io.github.line-landing.coupling"
"""Type of the annotation in which our exports keep what the standard has no place for."""
LINE_LANDING = "https://line-landing.github.io/coupling"
"""Namespace of its content."""
