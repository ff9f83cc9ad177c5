"""The current directory, from which libraries read settings when they are loaded."""

import os
from pathlib import Path

from wavetank.errors import InputError

SETTINGS = ".petscrc", "petscrc", "petsc.cfg", "ucx.conf", "dolfinx_jit_options.json", "ffcx_options.json"


def check_working_directory() -> None:
    """Raise ``InputError`` for a file in the current directory that a library would read its settings from.

    PETSc loads the libraries that such a file names, UCX, of Open MPI, writes the log that it names, FFCx changes how
    exactly it integrates. In the user's home such a file is the user's.
    """
    here, home = Path.cwd(), Path("~").expanduser()
    settings = [name for name in SETTINGS if os.path.lexists(name)]
    if settings and not (home.exists() and here.samefile(home)):
        cure = "delete it, or work in another directory; your own may be in your home directory"
        raise InputError(f"{here / settings[0]}: a library would execute or write what it names; {cure}.")
