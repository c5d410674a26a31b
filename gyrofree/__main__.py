"""``python -m gyrofree`` is the command line."""

import sys
from pathlib import Path

# -m puts the working folder before everything else, and with it whatever a person keeps there: an
# `estimator.py` of theirs is not ours. Where it is the very folder that has this package, it stays.
if not sys.flags.safe_path and Path(sys.path[0]) != Path(__file__).resolve().parents[1]:
    del sys.path[0]

if __name__ == "__main__":
    from gyrofree.commands.main import main

    main()
