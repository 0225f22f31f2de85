"""The command line: words in, words and JSON out."""


def run() -> None:
    """Run the command that `sys.argv` names, and exit with its code."""
    from app.cli.commands import app

    app()
