"""``python -m orchestrator``, and what the installed program calls: the command line under the last net, imports too."""

import sys

from orchestrator.cli.net import under_the_net


def main() -> None:
    """Run the command line and end the process with its exit status."""
    with under_the_net(sys.argv[1:]):
        from orchestrator.cli.commands import main as run

        run()


if __name__ == "__main__":
    main()
