"""The dynamic contract: an FMU is started, loaded and stepped, and its answers are held against mechanics.

`orchestrator.landing.contract` reads what an FMU says of itself; here it is asked. Each finding is a `Row`.

- `bench` makes experiments: inputs over a time, in so many steps, from one start
- `general` has what any FMU must do; `means` what the exchange rests on; `masters` what follows for coupling
- `robot`, with `loads`, `body` and `motion`; `cable`; `contact`: what each contract adds
- `dynamic` puts a trial together
"""
