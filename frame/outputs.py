"""Outputs of structures and their units."""


def output_unit(name: str) -> str:
    """SI unit of an output by its name."""
    kind = name.rstrip("0123456789")
    return {
        "q": "m",
        "drift": "m",
        "v": "m/s",
        "a": "m/s^2",
        "ar": "m/s^2",
        "shear": "N",
        "base_shear": "N",
        "roof": "m",
        "force": "N",
        "phi": "rad",
    }.get(kind, "SI")


def output_words(name: str) -> str:
    """An output in words, with its name: "displacement of floor 3 (q3)"; else the name."""
    kind, place = name.rstrip("0123456789"), name[len(name.rstrip("0123456789")) :]
    words = {
        "q": "displacement of floor",
        "v": "velocity of floor",
        "a": "acceleration of floor",
        "ar": "acceleration relative to the ground of floor",
        "drift": "drift of storey",
        "shear": "shear force of storey",
    }.get(kind)
    return f"{words} {place} ({name})" if words and place else name.replace("_", " ")
