"""Errors of valid input that admits no solution."""


class RefusedError(RuntimeError):
    """A packing, a fit or a p-box that fails its own test; the message gives the numbers."""
