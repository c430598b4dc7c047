"""The same line, other robots: by name, by a changed parameter."""

import orchestrator

SHORT = {"stop": 0.8, "estimate": "none"}

runs = {
    "10 kg": orchestrator.run("landing_200m_point9", robot="fptlir_10kg", **SHORT),
    "38 kg": orchestrator.run("landing_200m_point9", **SHORT),
    "100 kg": orchestrator.run("landing_200m_point9", robot="fptlir_100kg", **SHORT),
    "two wheels": orchestrator.run("landing_200m_point9", robot="hybrid_robot_2", **SHORT),
}

depth = {}
for name, run in runs.items():
    z = run.signals["robot.body.position.z"]
    depth[name] = float(z[0] - z.values.min())
    wheels = sum(signal.endswith(".normal_force") for signal in run.signals)
    print(f"{name:10s}  {wheels} wheel(s)  goes down by {depth[name]:.3f} {z.unit}")
