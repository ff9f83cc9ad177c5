"""Where messages go."""

import os

from mpi4py import MPI
from rich.console import Console


def console() -> Console:
    """Return where messages go: standard output, of rank 0 alone.

    Open MPI gives its ranks a terminal that passes on whole lines only: no bar would be seen there.
    """
    terminal = False if "OMPI_COMM_WORLD_SIZE" in os.environ else None
    return Console(quiet=MPI.COMM_WORLD.rank != 0, soft_wrap=True, force_terminal=terminal)
