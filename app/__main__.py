"""Entry point of `slipstand`: the desktop without arguments, else the command line."""

import sys


def main() -> None:
    """Run what the arguments ask for. Nothing heavy is imported before it is known to be needed."""
    if sys.argv[1:] == ["--version"]:
        from app.version import __version__

        sys.stdout.write(f"slipstand {__version__}\n")
        return
    from app.cli import run

    run()


if __name__ == "__main__":
    main()
