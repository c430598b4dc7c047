"""A landing: 38 kg, 20 m from the tower of a 200 m span. What happens, and how far to trust it."""

import orchestrator

run = orchestrator.run("landing_200m_point9", stop=1.0)

z = run.signals["robot.body.position.z"]
roll = run.signals["robot.roll"]
force = run.signals["contact1.normal_force_max"]  # largest within each macro step, sum of both walls
sensor = run.signals["contact1.radial_force"]  # their resultant: what a force sensor in the wheel measures

lowest = int(z.values.argmin())
print(f"goes down by {z[0] - z[lowest]:.3f} {z.unit}, lowest at t = {z.time[lowest]:.2f} s")
print(f"rolls up to {abs(roll.values).max():.4f} {roll.unit}")
print(f"the walls press with up to {force.values.max():.0f} {force.unit} together")
print(f"a sensor in the axle sees up to {sensor.values.max():.0f} {sensor.unit}")

# how wrong is this? The run says so itself, in each signal's unit
for name, error in run.estimated_error.items():
    print(f"{name}: about {error:.1e} {run.signals[name].unit} off")
print("verdict:", run.verdict)
