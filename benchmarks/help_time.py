"""CPU time of `mocapflow --help` beside the smallest command line of the same library, in turns.

    python benchmarks/help_time.py

The tests count modules instead: they can't be failed by a slow or busy machine.
"""

from __future__ import annotations

import resource
import subprocess
import sys

TURNS = 10
SMALLEST = "import sys, typer; sys.argv[1:] = ['--help']; typer.run(lambda: None)"
OURS = "import sys; from mocapflow import cli; sys.argv[1:] = ['--help']; cli.main()"


def main() -> None:
    """Print the least time of each, and their ratio."""
    turns = [(processor_seconds(SMALLEST), processor_seconds(OURS)) for _ in range(TURNS)]
    smallest, ours = (min(times) for times in zip(*turns, strict=True))
    print(f"mocapflow --help {1000 * ours:.0f} ms, the smallest {1000 * smallest:.0f} ms: {ours / smallest:.2f} times")


def processor_seconds(code: str) -> float:
    """Return the CPU time of a fresh interpreter that runs this code."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([sys.executable, "-c", code], check=True, stdout=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


if __name__ == "__main__":
    main()
