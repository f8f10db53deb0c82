"""`python -m legato` is the console script."""

from legato.cli.entry import run

if __name__ == "__main__":
    run()
