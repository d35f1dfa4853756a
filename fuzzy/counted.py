"""A count with its noun."""


def counted(number: int, noun: str) -> str:
    """Such as 1 sample, 12,000 samples."""
    return f"{number:,} {noun}{'' if number == 1 else 's'}"
