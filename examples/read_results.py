"""Results: written by a run, loaded again, and read without this program."""

import csv
import json

import orchestrator

run = orchestrator.run("drop_5cm", stop=0.3, out="drop", estimate="none")

# again from disk: what the directory holds is what the run had
old = orchestrator.load_run("drop")
force = old.signals["contact1.normal_force_max"]  # largest within each macro step
touch = old.signals["contact1.touch_time"][-1]
print(f"touches at t = {touch:.5f} s, largest force {force.values.max():.0f} {force.unit}")

# without this program: plain files
with open("drop/results.csv", newline="") as file:
    rows = list(csv.DictReader(file))
with open("drop/summary.json") as file:
    summary = json.load(file)
largest = max(float(row["contact1.normal_force_max"]) for row in rows)
print(f"results.csv: {len(rows)} rows, largest force {largest:.0f} N; {summary['unconverged_steps']} steps unconverged")
