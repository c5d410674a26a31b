"""``python -m gyrofree`` is the command line."""

from gyrofree.cli import main

if __name__ == "__main__":
    main()
