"""`python -m legato` is the console script."""

from legato.cli.main import main

if __name__ == "__main__":
    main()
