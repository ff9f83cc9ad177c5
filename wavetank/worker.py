"""A command in a process of a study: ``python -m wavetank.worker COMMAND ...`` prints exit code and cause as JSON."""

import json
import os
import sys

from wavetank.__main__ import main as execute
from wavetank.errors import WavetankError


def main() -> int:
    """Execute the command in ``sys.argv`` without output; print its exit code and cause as JSON."""
    report, cause = sys.stdout, ""
    sys.argv.append("--debug")  # which raises errors
    with open(os.devnull, "w") as sys.stdout:
        try:
            code = execute()
        except WavetankError as error:
            code, cause = error.exit_code, str(error)
    sys.stdout = report
    print(json.dumps([code, cause]))
    return code


if __name__ == "__main__":
    sys.exit(main())
