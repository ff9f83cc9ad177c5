"""A command that ends with the study that has begun it, however that ends: as by SIGTERM, between two steps of a run.

python -m wavetank.study.tied run CASE ...

Its standard input is a pipe that the study holds open and never writes to: the system closes it with its process.
"""

import os
import runpy
import signal
import threading


def _end_with_input() -> None:
    while os.read(0, 1):
        pass
    os.kill(os.getpid(), signal.SIGTERM)


if __name__ == "__main__":
    threading.Thread(target=_end_with_input, daemon=True).start()
    runpy.run_module("wavetank", run_name="__main__")
