"""The command line, ``wavetank`` or ``python -m wavetank``: Ctrl-C is one line from the first moment on."""

import sys


def main() -> int:
    """Run the command line; return its exit code."""
    try:
        from wavetank.cli import main as commands
    except KeyboardInterrupt:
        print("wavetank: interrupted by SIGINT", file=sys.stderr)
        return 1
    return commands()


if __name__ == "__main__":
    sys.exit(main())
