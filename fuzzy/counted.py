"""A count with its noun, and a range that may be one number."""


def counted(number: int, noun: str) -> str:
    """Such as 1 sample, 12,000 samples."""
    return f"{number:,} {noun}{'' if number == 1 else 's'}"


def ranged(low: float, high: float) -> str:
    """Such as 0.25 … 0.5; one number where both ends read the same."""
    return " … ".join(dict.fromkeys((f"{low:.6g}", f"{high:.6g}")))
