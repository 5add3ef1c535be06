"""`python -m mocapflow` is `mocapflow`."""

from mocapflow.cli import main

if __name__ == "__main__":
    main()
