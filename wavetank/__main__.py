"""The command line, ``wavetank`` or ``python -m wavetank``: Ctrl-C is one line from the first moment on."""

import json
import os
import sys

from wavetank.base.errors import InputError, WavetankError, printable
from wavetank.base.working_directory import check_working_directory


def main() -> int:
    """Run the command line; return its exit code."""
    try:
        check_working_directory()
        from wavetank.cli import main as commands
    except InputError as error:
        print(f"wavetank: {printable(str(error))}", file=sys.stderr)
        return error.exit_code
    except KeyboardInterrupt:
        print("wavetank: interrupted by SIGINT", file=sys.stderr)
        return 1
    return commands()


def report() -> None:
    """Execute the command in ``sys.argv`` without output; print its exit code and cause as JSON, for a study."""
    standard_output, cause = sys.stdout, ""
    sys.argv.append("--debug")  # which raises errors
    with open(os.devnull, "w") as sys.stdout:
        try:
            code = main()
        except WavetankError as error:
            code, cause = error.exit_code, str(error)
    sys.stdout = standard_output
    print(json.dumps([code, cause]))


if __name__ == "__main__":
    sys.exit(main())
