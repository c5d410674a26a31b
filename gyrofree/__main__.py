"""``python -m gyrofree`` is the command line."""

from gyrofree.commands.main import main

if __name__ == "__main__":
    main()
