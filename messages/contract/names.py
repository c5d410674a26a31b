"""What a name on the bus looks like."""

import re

NAME = re.compile(r"[a-z][a-z0-9_-]{0,31}")
