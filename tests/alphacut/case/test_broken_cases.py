"""A generator breaks the paper's case in known ways; each time the broken key is named, and
harmless changes change nothing.
"""

import random
import re
import shutil
import sys
import tomllib
from dataclasses import replace
from pathlib import Path

import pytest

from alphacut.case.key import UnknownValueError
from alphacut.case.load import lines_of_keys, load, section_of
from alphacut.case.schema import every_key
from alphacut.case.sections.structures import Frame
from alphacut.entry import main
from alphacut.io.problem import BadInput
from alphacut.stages.readiness import ready

CASE = Path(__file__).parents[3] / "cases" / "paper.toml"
PAPER = CASE.read_text(encoding="utf-8")
LINES = PAPER.splitlines()
KEYS = {
    key: line for key, line in lines_of_keys(PAPER).items() if "." in key and "=" in LINES[line - 1]
}
SCHEMA = every_key()
OUT_OF_RANGE = {"text": '""', "choice": '"nothing"', "choices": "[]", "integer": "-1"}


def entry(key):
    """The schema's entry of a key of the case."""
    return SCHEMA[re.sub(r"\[\d+\]", "", key)]


def with_line(key, change):
    """The case with the line of `key` changed; the comment behind it is dropped."""
    lines = list(LINES)
    name, _, value = lines[KEYS[key] - 1].partition("=")
    value = re.sub(r"\s+#.*$", "", value).strip()
    lines[KEYS[key] - 1] = change(name.strip(), value)
    return "\n".join(lines) + "\n"


def break_unit(generator):
    key = generator.choice([key for key in KEYS if entry(key).unit and '"' in LINES[KEYS[key] - 1]])
    wrong = generator.choice([" apples", " K", ""])
    return key, with_line(
        key,
        lambda name, value: (
            f"{name} = " + re.sub(r'([\d\]])\s*[A-Za-z][^"]*"', rf'\1{wrong}"', value)
        ),
    )


def break_key(generator):
    key = generator.choice(list(KEYS))
    bare = key.rpartition(".")[2]
    at = generator.randrange(len(bare))
    wrong = bare[:at] + generator.choice("xyz_") + bare[at + 1 :] + "q"
    return f"{key.rpartition('.')[0]}.{wrong}", with_line(
        key, lambda name, value: f"{wrong} = {value}"
    )


def break_type(generator):
    key = generator.choice(list(KEYS))
    wrong = generator.choice(["true", "{ a = 1 }", "1979-05-27"])
    return key, with_line(key, lambda name, value: f"{name} = {wrong}")


def break_order(generator):
    key = generator.choice(
        [
            "radius.a2",
            "radius.a4",
            "cell.inclusion_modulus",
            "frame.modulus",
            "modulus.alpha",
            "envelope.alpha",
            "radius.theta",
        ]
    )
    swap = re.compile(r"\[([^\],]+),(.*),\s*([^\],]+)\]|\[([^\],]+),\s*([^\],]+)\]")

    def change(name, value):
        return f"{name} = " + swap.sub(
            lambda m: f"[{m[3]},{m[2]}, {m[1]}]" if m[1] else f"[{m[5]}, {m[4]}]", value
        )

    return key, with_line(key, change)


def break_range(generator):
    key = generator.choice([key for key in KEYS if entry(key).allowed or entry(key).choices])
    kind = entry(key).kind
    if kind in OUT_OF_RANGE:
        return key, with_line(key, lambda name, value: f"{name} = {OUT_OF_RANGE[kind]}")
    return key, with_line(
        key,
        lambda name, value: (
            f"{name} = " + re.sub(r"(?<![\w.])(\d[\d.]*)(?=[^\d.]*$)", r"-77.7", value)
        ),
    )


def break_encoding(generator):
    key = generator.choice(list(KEYS))
    marked = with_line(key, lambda name, value: f"{name} = {value} # \ue000")
    return key, marked.encode().replace(
        "\ue000".encode(), generator.choice([b"\xff", b"\xe4", b"\xc3("])
    )


def break_by_truncation(generator):
    key = generator.choice(
        [
            key
            for key in KEYS
            if key.startswith(("radius.", "cell.", "mesh.", "frame.")) and entry(key).required
        ]
    )
    text = "\n".join(LINES[: KEYS[key]])
    end = text.rindex("=") + 1
    return key, text[: end + generator.choice([0, 1])]


WAYS = [
    break_unit,
    break_key,
    break_type,
    break_order,
    break_range,
    break_encoding,
    break_by_truncation,
]


@pytest.mark.parametrize("seed", range(105))
def test_a_broken_case_exits_2_and_names_the_broken_key(seed, tmp_path, capfd):
    way = WAYS[seed % len(WAYS)]
    key, text = way(random.Random(seed))
    path = tmp_path / "case.toml"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    status = main(["run", str(path), "--out", str(tmp_path / "results"), "--json", "-"])
    out, err = capfd.readouterr()
    assert (status, out) == (2, ""), f"{way.__name__} of {key} went through"
    assert "Traceback" not in err
    (line,) = err.splitlines()  # one problem, one line: nothing that only follows from it
    assert re.match(r"alphacut: \S+case\.toml(:\d+)?: \S", line), err
    assert re.search(rf": {re.escape(key)}\b", line), f"{way.__name__} of {key}:\n{err}"
    assert [file.name for file in tmp_path.iterdir()] == ["case.toml"]


def meant_otherwise(text, broken):
    """Whether a change of a case changed what it says; a flag that became another flag is fine."""
    try:
        before, after = tomllib.loads(text), tomllib.loads(broken)
    except (tomllib.TOMLDecodeError, TypeError):
        return True
    return before != after and str(before).replace("False", "True") != str(after).replace(
        "False", "True"
    )


@pytest.mark.parametrize(
    "name", ["building", "concrete", "porous", "tower", "pendulum", "paper-literal"]
)
def test_a_break_of_any_shipped_case_is_one_line(name, tmp_path, monkeypatch):
    text = CASE.with_stem(name).read_text(encoding="utf-8")
    lines = text.splitlines()
    keys = {
        key: line
        for key, line in lines_of_keys(text).items()
        if "." in key and "=" in lines[line - 1]
    }
    for variable, value in (("PAPER", text), ("LINES", lines), ("KEYS", keys)):
        monkeypatch.setattr(sys.modules[__name__], variable, value)
    for file in CASE.parent.glob("*.csv"):
        shutil.copy(file, tmp_path)
    path, tried = tmp_path / "case.toml", 0
    for seed in range(60):
        try:
            key, broken = WAYS[seed % len(WAYS)](random.Random(seed))
        except (IndexError, KeyError):  # this case has no such key
            continue
        if not meant_otherwise(text, broken):
            continue
        path.write_bytes(broken if isinstance(broken, bytes) else broken.encode())
        with pytest.raises(BadInput) as caught:
            ready(load(path))
        (problem,) = caught.value.problems
        assert key.rpartition(".")[2] in problem.key, f"{key}: {problem}"
        tried += 1
    assert tried > 35


def test_problems_of_single_values_hide_none_of_the_case_as_a_whole(tmp_path):
    text = PAPER
    for old, new in (
        ('matrix_modulus = "20 GPa"', 'matrix_modulus = "20 GP"'),
        ("a2 = [0.001, 0.1, 0.3145]", "a2 = [0.001, 0.1, 90]"),
        ('step = "0.01 s"', 'step = "0.013 s"'),
    ):
        assert old in text
        text = text.replace(old, new, 1)
    path = tmp_path / "case.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(BadInput) as caught:
        load(path)
    keys = [problem.key for problem in caught.value.problems]
    assert keys[:2] == ["radius.a2", "cell.matrix_modulus"]
    assert len(keys) > 2
    assert all(re.fullmatch(r"(envelope|study\[\d\])\.duration", key) for key in keys[2:])


def test_what_rests_on_a_broken_key_is_not_told():
    frame = section_of(Frame, "frame", {"frame": {"outputs": ("q1",)}})
    assert frame.outputs == ("q1",)
    with pytest.raises(UnknownValueError):
        assert frame.masses
    case = load(CASE)
    with pytest.raises(UnknownValueError):
        replace(case, broken=frozenset({"frame.masses"})).asked("frame.masses")
    assert case.asked("frame.masses")


def shuffled_keys(generator):
    blocks = re.split(r"(?m)^(?=\[)", PAPER)
    shuffled = []
    for block in blocks:
        head, *rest = [line for line in block.splitlines() if not line.lstrip().startswith("#")]
        if '"""' in block or not block.startswith("["):
            shuffled.append(block)
            continue
        rest = [line for line in rest if line.strip()]
        generator.shuffle(rest)
        shuffled.append("\n".join([head, *rest]) + "\n")
    return "".join(shuffled)


def shuffled_sections(generator):
    head, *blocks = re.split(r"(?m)^(?=\[\w)", PAPER)
    studies = [
        i
        for i, block in enumerate(re.split(r"(?m)^(?=\[)", PAPER))
        if block.startswith("[[study]]")
    ]
    assert studies
    head, *blocks = re.split(r"(?m)^(?=\[(?!\[))", PAPER)
    generator.shuffle(blocks)
    return head + "".join(block if block.endswith("\n") else block + "\n" for block in blocks)


HARMLESS = {
    "keys in another order 1": shuffled_keys(random.Random(1)),
    "keys in another order 2": shuffled_keys(random.Random(2)),
    "keys in another order 3": shuffled_keys(random.Random(3)),
    "sections in another order 1": shuffled_sections(random.Random(1)),
    "sections in another order 2": shuffled_sections(random.Random(2)),
    "sections in another order 3": shuffled_sections(random.Random(3)),
    "no comments": re.sub(r"(?m)\s+# .*$|^#.*$", "", PAPER),
    "more comments": (
        PAPER.partition("[radius]")[0]
        + re.sub(r"(?m)$", "  # a comment", "[radius]" + PAPER.partition("[radius]")[2])
    ),
    "other line ends": PAPER.replace("\n", "\r\n"),
    "byte order mark": "\ufeff" + PAPER,
    "MPa": PAPER.replace('"20 GPa"', '"20000 MPa"'),
    "Pa": PAPER.replace('"20 GPa"', '"2e10 Pa"'),
    "MPa in a triangle": PAPER.replace('"[75, 80, 85] GPa"', '"[75000, 80000, 85000] MPa"'),
    "a unit for each": PAPER.replace('"[75, 80, 85] GPa"', '"[75 GPa, 80000 MPa, 8.5e10 Pa]"'),
    "kg": PAPER.replace('"[9.5, 10, 10.5] t"', '"[9500, 10000, 10500] kg"'),
    "cm": PAPER.replace('"2.5 m"', '"250 cm"'),
    "ms": PAPER.replace('"0.01 s"', '"10 ms"'),
    "km/h": PAPER.replace('"-0.5 m/s"', '"-1.8 km/h"'),
    "one for all floors": PAPER.replace('["50 N s/m", "50 N s/m", "50 N s/m"]', '["0.05 kN s/m"]'),
    "single quotes": PAPER.replace('"20 GPa"', "'20 GPa'"),
    "exponent": PAPER.replace("a1 = 0.1337", "a1 = 1337e-4"),
}


@pytest.mark.parametrize("name", HARMLESS)
def test_a_harmless_change_changes_no_value(name, tmp_path):
    assert HARMLESS[name] != PAPER
    changed, plain = tmp_path / "changed.toml", tmp_path / "plain.toml"
    changed.write_text(HARMLESS[name], encoding="utf-8", newline="")
    plain.write_text(PAPER, encoding="utf-8")
    ours, theirs = load(changed).sections, load(plain).sections
    if name == "one for all floors":
        assert ours.frame.dampers * 3 == theirs.frame.dampers
        ours = replace(ours, frame=replace(ours.frame, dampers=theirs.frame.dampers))
    assert ours == theirs
