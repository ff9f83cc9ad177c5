"""The command line, ``wavetank`` or ``python -m wavetank``: Ctrl-C is one line from the first moment on."""

import sys

from wavetank.errors import InputError, printable
from wavetank.working_directory import check_working_directory


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


if __name__ == "__main__":
    sys.exit(main())
