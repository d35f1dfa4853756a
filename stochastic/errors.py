"""What is raised when a well-formed wish cannot be granted."""


class RefusedError(RuntimeError):
    """A packing, a fit or a p-box that would not meet its own test; the message gives the numbers."""
