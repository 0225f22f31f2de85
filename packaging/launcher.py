"""What the executable of a frozen build runs."""

from slipstand.__main__ import main

if __name__ == "__main__":
    main()
