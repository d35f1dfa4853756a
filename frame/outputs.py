"""Outputs of structures and their units."""


def output_unit(name: str) -> str:
    """SI unit of an output by its name."""
    kind = name.rstrip("0123456789")
    return {
        "q": "m",
        "drift": "m",
        "v": "m/s",
        "a": "m/s^2",
        "shear": "N",
        "base_shear": "N",
        "roof": "m",
        "force": "N",
        "phi": "rad",
    }.get(kind, "SI")
