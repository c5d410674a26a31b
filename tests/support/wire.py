"""A line without a pseudo-terminal, for tests of simulated boards."""


class Wire:
    """Takes what a board sends."""

    connected = True

    def __init__(self):
        self.data = bytearray()

    def write(self, data):
        self.data += data
        return True

    def read(self):
        return b""

    def close(self):
        pass
