"""Errors of valid input that admits no solution."""


class RefusedError(RuntimeError):
    """A packing, a fit or a p-box that fails its own test; the message gives the numbers."""


class UnfitDataError(RefusedError, ValueError):
    """The same where other data or settings are the only cure, and no other seed is."""
