"""`python -m slipstand`: the program."""

from app.__main__ import main

if __name__ == "__main__":
    main()
