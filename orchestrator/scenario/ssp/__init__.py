"""System structures of other tools read as scenarios: SSP 1.0 archives, and OspSystemStructure.xml."""
