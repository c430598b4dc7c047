"""A line of one's own: a scenario that builds on a shipped one and says only what differs."""

from pathlib import Path

import orchestrator

LINE = """
extends = "landing_200m_point9"
title = "A span of 120 m with 3 m of sag, landing at its middle"

[cable.parameters]
span = { value = 120.0, unit = "m", source = "survey" }
sag = { value = 300.0, unit = "cm", source = "survey, at 15 °C" }

[landing]
position = { value = 60.0, unit = "m", source = "planned" }
"""

Path("short_span.toml").write_text(LINE, encoding="utf-8")
run = orchestrator.run("short_span.toml", stop=0.5, estimate="none")

height = run.signals["cable.port[1].position.z"]
tension = run.signals["cable.tension_mid"]
print(f"before: the cable hangs {-height[0]:.3f} m below its supports, {tension[0] / 1e3:.2f} kN")
print(f"after {height.time[-1]:g} s: {-height[-1]:.3f} m, {tension[-1] / 1e3:.2f} kN")
