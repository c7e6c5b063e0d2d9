"""`python -m golem` is `golem`."""

from golem.cli import main

if __name__ == "__main__":
    main()
