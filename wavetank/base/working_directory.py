"""Refusal of settings files of libraries in the current directory."""

import os
from pathlib import Path

from wavetank.base.errors import InputError

SETTINGS = ".petscrc", "petscrc", "petsc.cfg", "ucx.conf", "dolfinx_jit_options.json", "ffcx_options.json"


def check_working_directory() -> None:
    """Raise ``InputError`` for a settings file of a library in the current directory, except in the home of the user.

    PETSc loads libraries named in its file, UCX (of Open MPI) writes a log file named in its file, FFCx changes its
    quadrature.
    """
    here, home = Path.cwd(), Path("~").expanduser()
    settings = [name for name in SETTINGS if os.path.lexists(name)]
    if settings and not (home.exists() and here.samefile(home)):
        cure = "delete it, or work in another directory; your own may be in your home directory"
        raise InputError(f"{here / settings[0]}: a library would execute or write what it names; {cure}.")
