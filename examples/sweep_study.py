# ---
# jupyter:
#   jupytext:
#     text_representation:
#       extension: .py
#       format_name: percent
# ---

# %% [markdown]
# # Where on the span may it land, and how surely?
# A notebook in the percent format: Jupyter opens it with jupytext, `python examples/sweep_study.py` runs it.

# %%
import orchestrator

STOP = 1.5  # s; the first swing down, which is the deepest

MAP = {
    "scenario": "landing_200m_point9_physical",
    "solver": "monolithic",
    "estimate": False,
    "set": {"simulation.stop_time": STOP},
    "vary": {"landing.position": [20.0, 60.0, 100.0], "robot.parameters.mass": [38.0, 90.0]},
    "refine": {"landing.position": 20.0, "outline": "verdict"},
}

# %% [markdown]
# ## The map
# Runs are added between two points of which one is safe and the other is not, until they are 20 m apart.

# %%
if __name__ == "__main__":  # workers import this file, and are not to start it again
    study = orchestrator.sweep(MAP, out="map")
    print(study)
    for line in study.safe_ranges:
        print(line)
    study.map("landing.position", "robot.parameters.mass").savefig("map.pdf")

# %% [markdown]
# The table as arrays (`study.frame()` gives it to pandas): which limit binds where it is nearest?

# %%
if __name__ == "__main__":
    table = study.table
    worst = table["least_margin"].argmin()
    print(f"least margin {table['least_margin'][worst]:.2f} of {table['binding'][worst]}")
    print(f"  {table['robot.parameters.mass'][worst]:g} kg at {table['landing.position'][worst]:g} m")

# %% [markdown]
# ## The probability
# Near the outline it matters what is not known exactly. Of 40 drawn landings: how many are safe, and what does it hang on?

# %%
NEAR = {
    **{key: MAP[key] for key in ("scenario", "solver", "estimate")},
    "set": {"simulation.stop_time": STOP, "landing.position": 40.0},
    "sample": {
        "count": 40,
        "robot.parameters.mass": {"normal": [60.0, 5.0]},
        "cable.parameters.mass_damping": {"uniform": [0.5, 1.5]},
    },
    "sensitivity": {"count": 8},
}

# %%
if __name__ == "__main__":
    near = orchestrator.sweep(NEAR, out="near")
    chance = near.probability[0].of["all"]
    print(f"safe with a probability of {chance.interval[0]:.2f} to {chance.interval[1]:.2f}")
    for name, indices in near.sensitivity[0].of["least_margin"].items():
        print(f"  {name}: {indices.total.estimate:.2f} of the variance of the least margin")
