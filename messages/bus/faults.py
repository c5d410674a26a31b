"""Why a process is not on the bus."""


class BusUnavailable(ConnectionError):
    """No router answered in the time given."""


class IdentityError(BusUnavailable):
    """A process has no certificate for the bus; says what to do."""
