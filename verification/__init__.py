"""Studies that hold the computed physics against closed forms, invariants and independent methods.

`python -m verification` runs them and writes `docs/verification.md` and its figures; a name (``cable.statics``) or a
section (``cable``) runs that part alone and leaves the rest of the page as it is. Each section is a package with a
tuple `STUDIES` of its modules; a study is a module with `TITLE`, a docstring that becomes its text, and
``run(figures: Path) -> Result``.
"""
