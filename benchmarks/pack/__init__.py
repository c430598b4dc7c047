"""A public benchmark pack: co-simulation of stiff contact on a flexible line (docs/benchmarks.md).

python -m benchmarks.pack              runs all cases with all engines, writes docs/benchmarks.json, page and pictures
python -m benchmarks.pack --help       the rest: one case, one engine, references made anew, the pack for another group
"""
