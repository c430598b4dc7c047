"""Two masters, two steps: how wrong is each, and with which order does the error fall?"""

import orchestrator

comparison = orchestrator.compare("oscillator", masters=["iqn_ils", "gauss_seidel"], macro_steps=[0.02, 0.01], stop=1.0)

for run in comparison.runs:
    error = run.signals["left.position"].relative_max_error
    print(
        f"{run.master:14s} H = {run.macro_step:g} s  error {error:.1e}  {run.iterations_per_step:.1f} iterations a step"
    )
for master, orders in comparison.observed_order.items():
    print(f"{master:14s} order {orders['left.position']:.2f}")
print("within the tolerance of the scenario:", comparison.passed)
