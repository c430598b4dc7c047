"""``python -m orchestrator``: the command line."""

from orchestrator.cli.commands import main

main()
