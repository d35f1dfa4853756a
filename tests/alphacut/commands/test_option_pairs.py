"""Every pair of options of every command changes the result, is refused by name, or is explained.

The pairs are those of the parsers themselves: an option that is new has to be given a value here.
"""

import hashlib
import itertools
import shutil

import numpy as np
import pytest

from alphacut.entry import COMMANDS, main, parsers
from alphacut.fuzzy import Store
from tests.alphacut.commands.watch import told, watch

CASE = """
schema = 1
title = "cheap"
about = "Coarse enough for hundreds of runs."
stages = {stages}

[radius]
a1 = 0.3
a2 = [0.05, 0.1, 0.15]
a3 = 0.5
a4 = 0.1

[cell]
matrix_modulus = "20 GPa"
matrix_poisson = 0.3
inclusion_modulus = "80 GPa"
inclusion_poisson = 0.3

[mesh]
layers = 2
size = 0.6

[modulus]
method = "series"
plan = "reduced"
alpha = [0, 0.5, 1]
tolerance = 0.1

[frame]
second_moment = "1e-6 m^4"
masses = ["[9, 10, 11] t"]
lengths = "[2.4, 2.5, 2.6] m"
dampers = "50 N s/m"
damper_placement = "ground"
displacements = "10 mm"
velocities = "0 m/s"
{modulus}
[envelope]
fuzzy = ["m"]
alpha = [0]
method = "auto"
duration = "2 s"
step = "0.5 s"
"""
LIMITED = """
[exceedance]
output = "v1"
limit = "25 mm/s"
"""
MEASURED = """
[update]
measured = "modes.csv"
learn = ["E"]
frequency_deviation = 0.01
"""
MODES = "mode,frequency [Hz],q1\n1,0.315,1\n"
PACKED = """
schema = 1
title = "packed"
about = "A few discs."
stages = ["microstructure"]

[microstructure]
seed = 1
bootstrap = 100

[microstructure.packing]
packings = 5
discs = 40
area_fraction = 0.2
smallest_radius = "1 mm"
largest_radius = "2 mm"
"""
IMAGED = """
schema = 1
title = "imaged"
about = "A few pixels."
stages = ["image"]

[cell]
image = "a.npy"
pixel = "2 µm"
labels = [0, 1]
modulus = ["20 GPa", "80 GPa"]
poisson = [0.3]

[modulus]
alpha = [0, 1]
"""
VALUES = {
    "--json": ("-", "out.json"),
    "--radius": ("0.4",),
    "--quiet": ((),),
    "--a2": ("0.11",),
    "--a4": ("0.11",),
    "--inclusion-modulus": ("81 GPa",),
    "--layers": ("3",),
    "--mesh-size": ("0.9",),
    "--interface": ("sign",),
    "--plan": ("general",),
    "--alpha": ("0.4",),
    "--fuzzy": ("m,l",),
    "--duration": ("3",),
    "--step": ("0.25",),
    "--certify": ("1e-3",),
    "--most": ("0.3",),
    "--modulus": ("25 GPa",),
    "--exclude": ("modal",),
    "--best-effort": ((),),
    "--stiffness": ((),),
    "--export": ("card.json",),
    "--cross-check": ("series,prism",),
    "--workers": ("2",),
    "--resume": ((),),
    "--fresh": ((),),
    "--strict": ((),),
    "--quick": ((),),
    "--no-figures": ((),),
    "--explain": ((),),
    "--fields": ((),),
    "--csv": ("tables",),
}
"""Values of every option, none for a flag."""
RECORDED = "time [s],acceleration [m/s^2]\n0,0\n0.1,1\n0.2,-1\n0.3,0.5\n0.4,0\n"
OWN = {
    ("cell", "--set"): ("cell.matrix_poisson=0.25",),
    ("cell", "--method"): ("prism",),
    ("cell", "--tolerance"): ("1e-6",),
    ("cell", "--exclude"): ("table",),
    ("mesh", "--set"): ("radius.a1=0.45",),
    ("mesh", "--out"): ("other.vtu",),
    ("modulus", "--set"): ("cell.matrix_poisson=0.25",),
    ("modulus", "--method"): ("auto",),
    ("modulus", "--tolerance"): ("1e-6",),
    ("modulus", "--exclude"): ("table",),
    ("modulus", "--store"): ("kept.db",),
    ("modulus", "--out"): ("modulus.nc",),
    ("envelope", "--set"): ("frame.dampers=60 N s/m",),
    ("envelope", "--method"): ("vertex",),
    ("envelope", "--tolerance"): ("1e-5",),
    ("envelope", "--out"): ("envelope.nc",),
    ("tolerances", "--duration"): ("1",),
    ("tolerances", "--set"): ("frame.dampers=60 N s/m",),
    ("run", "--set"): ("frame.dampers=60 N s/m",),
    ("run", "--out"): ("other",),
    ("check", "--set"): ("frame.lengths=[2.8, 3, 3.2] m",),
    ("microstructure", "--set"): ("microstructure.seed=2",),
    ("microstructure", "--out"): ("particles",),
    ("report", "--out"): ("page.html",),
    ("image", "--set"): ("cell.poisson=[0.25]",),
    ("image", "--out"): ("image.nc",),
    ("update", "--set"): ("update.frequency_deviation=0.02",),
    ("update", "--modulus"): ("[21, 25, 29] GPa",),
    ("update", "--out"): ("learned",),
    ("spectrum", "--damping"): ("2 %",),
    ("spectrum", "--shortest"): ("0.1 s",),
    ("spectrum", "--longest"): ("2 s",),
    ("spectrum", "--count"): ("9",),
    ("spectrum", "--out"): ("spectrum",),
    ("measure-next", "--set"): ("frame.dampers=60 N s/m",),
    ("measure-next", "--output"): ("v1",),
    ("measure-next", "--out"): ("advice",),
}
EXPLAINED = {
    ("--quiet", "--json"): "as with --json -",
    ("--best-effort", ""): "above the tolerance",
    ("--resume", ""): "the default",
    ("", "--explain"): "run nothing",
}
"""An option (or any), beside which other one (or any) it may be idle, and what help says so."""
BASE = {"mesh": ["--out", "mesh.vtu"]}
PRISM = ("--method", "prism")
MISSED = ("--tolerance", "1e-9")
NEEDED = {
    ("cell", "--layers"): PRISM,
    ("cell", "--mesh-size"): PRISM,
    ("cell", "--interface"): PRISM,
    ("cell", "--stiffness"): PRISM,
    ("cell", "--best-effort"): (*PRISM, *MISSED),
    ("cell", "--exclude"): ("--method", "auto"),
    ("modulus", "--exclude"): ("--method", "auto"),
    ("modulus", "--best-effort"): (*PRISM, *MISSED, "--alpha", "1"),
    ("envelope", "--best-effort"): ("--method", "graph-follower", *MISSED),
    ("envelope", "--workers"): ("--certify", "1e-3"),
    ("microstructure", "--no-figures"): ("--out", "particles"),
    ("run", "--best-effort"): (
        *("--set", "envelope.method=graph-follower"),
        *("--set", "envelope.tolerance=1e-9 m"),
    ),
}
"""Options that are refused alone, with those that they need; --strict is to refuse, no more."""
NEEDS_RESULTS = {"run": ("--fresh",), "modulus": ("--store", "--resume")}


def choices(command, parser):
    """Every option with each of its values, as a list of words."""
    found = []
    for action in parser._actions:
        name = action.option_strings[-1] if action.option_strings else ""
        if name in ("", "--help"):
            continue
        values = OWN.get((command, name)) or VALUES.get(name)
        assert values, f"{command} {name} has no value in this test"
        found += [[name, *([value] if value else [])] for value in values]
    return found


def pairs(command, parser):
    """Every two different options of a command."""
    every = itertools.combinations(choices(command, parser), 2)
    return [(first, second) for first, second in every if first[0] != second[0]]


class Watched:
    """Runs of one command, each in a folder of its own, with all that they do and compute."""

    def __init__(self, command, folder, monkeypatch, capfd):
        self.command, self.folder, self.monkeypatch, self.capfd = (
            command,
            folder,
            monkeypatch,
            capfd,
        )
        self.events, self.known, self.base = [], {}, list(BASE.get(command, []))
        watch(command_modules=COMMANDS.values(), events=self.events, monkeypatch=monkeypatch)
        self.results = folder / "results"
        self.results.mkdir()
        self.prepare(self.results)

    def prepare(self, place):
        """Results of earlier runs, for options that go on from them."""
        self.monkeypatch.chdir(place)
        self.write_case(place)
        if self.command == "modulus":
            assert main(["modulus", "case.toml", "--store", "kept.db", "--quiet"]) == 0
            assert main(["modulus", "case.toml", "--resume", "--quiet"]) == 0
        if self.command in ("run", "report"):
            for more in ([], ["--out", "other"], ["--quick"]):
                if not more or self.command == "run":
                    assert main(["run", "case.toml", "--quiet", *more]) == 0

    def write_case(self, place):
        """The case of the command."""
        stages = '["modulus", "envelope"]' if self.command in ("run", "check") else '["envelope"]'
        stages = '["modulus"]' if self.command == "modulus" else stages
        plain = self.command in ("envelope", "measure-next")
        own = 'modulus = "25.5 GPa"\n' if plain else ""
        own += 'outputs = ["q1", "v1"]\n' if self.command == "measure-next" else ""
        text = CASE.format(stages=stages, modulus=own)
        if self.command == "tolerances":
            text = CASE.format(stages=stages, modulus='modulus = "25.5 GPa"\n') + LIMITED
        if self.command == "report":
            text = CASE.format(stages='["envelope"]', modulus='modulus = "25.5 GPa"\n')
        if self.command == "update":
            text = CASE.format(stages=stages, modulus='modulus = "[20, 25.5, 30] GPa"\n') + MEASURED
            text = text.replace('fuzzy = ["m"]', 'fuzzy = ["m", "E"]')
            (place / "modes.csv").write_text(MODES, encoding="utf-8")
        own = {"microstructure": PACKED, "image": IMAGED, "spectrum": RECORDED}
        text = own.get(self.command, text)
        Store(place / "a.db").close()
        np.save(place / "a.npy", np.pad(np.ones((4, 4), int), 4))
        (place / "case.toml").write_text(text, encoding="utf-8")

    def run(self, *words, results=False):
        """Exit status, output, files and computations of one run."""
        key = (*self.base, *words, results)
        if key not in self.known:
            place = self.folder / str(len(self.known))
            if results or self.command == "report":
                shutil.copytree(self.results, place)
            else:
                place.mkdir()
                self.write_case(place)
            self.monkeypatch.chdir(place)
            self.events.clear()
            subject = {"report": "results/case", "repair": "a.db"}.get(self.command, "case.toml")
            before = {path: stamp(path) for path in place.rglob("*")}
            status = main([self.command, subject, *self.base, *words])
            out, err = self.capfd.readouterr()
            files = sorted(
                f"{path.relative_to(place)} {content(path)}"
                for path in place.rglob("*")
                if path.is_file() and before.get(path) != stamp(path)
            )
            self.known[key] = (status, told(out), told(err), files, list(self.events))
            shutil.rmtree(place)
        return self.known[key]


def stamp(path):
    """When a file was written."""
    return path.stat().st_mtime_ns


def content(path):
    """Digest of a file whose bytes tell no time; else its size, nothing of a database."""
    if path.suffix in (".json", ".db", ".nc", ".html"):
        return told(path.read_text(encoding="utf-8")) if path.suffix == ".json" else ""
    return hashlib.sha256(path.read_bytes()).hexdigest()


def explained(parser, option, other):
    """Whether the help of an option says that it may be idle beside another one."""
    own = EXPLAINED.get((option, other)) or EXPLAINED.get((option, ""))
    helps = {name: a.help or "" for a in parser._actions for name in a.option_strings}
    others = EXPLAINED.get(("", other))
    return bool((own and own in helps[option]) or (others and others in helps[other]))


def ignored(watched, parser, first, second):
    """Those of two options that change nothing beside the other one."""
    needs = NEEDS_RESULTS.get(watched.command, ())
    needed = any(option[0] in needs for option in (first, second))
    for one, other in ((first, second), (second, first)):
        both = watched.run(*first, *second, results=needed)
        if both[0] == 2 or (both[0] == 1 and "is asked for" in both[2]):
            assert both[2].startswith("alphacut: ")
            return
        if both == watched.run(*other, results=needed) and not explained(parser, one[0], other[0]):
            yield f"{' '.join(one)} beside {' '.join(other)}"


@pytest.mark.parametrize("command", COMMANDS)
def test_no_option_is_ignored_beside_another(command, tmp_path, monkeypatch, capfd):
    if command in ("cell", "mesh"):
        pytest.importorskip("dolfinx")
    parser = parsers("alphacut", COMMANDS)[1][command]
    watched = Watched(command, tmp_path, monkeypatch, capfd)
    wrong = [line for pair in pairs(command, parser) for line in ignored(watched, parser, *pair)]
    assert "\n".join(wrong) == ""
    assert "\n".join(idle_beside_what_they_need(watched, parser)) == ""


def idle_beside_what_they_need(watched, parser):
    """Those ignored among pairs of an option that is refused alone, beside what it needs."""
    every = choices(watched.command, parser)
    needy = [one for one in every if one[0] != "--strict" and watched.run(*one)[0] == 2]
    plain = list(watched.base)
    for first in needy:
        watched.base = [*plain, *NEEDED.get((watched.command, first[0]), ())]
        assert watched.run(*first)[0] != 2, watched.run(*first)[2]
        for second in every:
            if second[0] not in (first[0], *watched.base):
                yield from ignored(watched, parser, first, second)
    watched.base = plain


def test_an_option_that_nobody_reads_is_seen(tmp_path, monkeypatch, capfd):
    real = COMMANDS["check"].arguments

    def arguments(parser):
        real(parser)
        parser.add_argument("--idle", action="store_true")

    monkeypatch.setattr(COMMANDS["check"], "arguments", arguments)
    monkeypatch.setitem(VALUES, "--idle", ((),))
    parser = parsers("alphacut", COMMANDS)[1]["check"]
    watched = Watched("check", tmp_path, monkeypatch, capfd)
    wrong = [line for pair in pairs("check", parser) for line in ignored(watched, parser, *pair)]
    assert {line.partition(" beside ")[0] for line in wrong} == {"--idle"}
    assert len(wrong) == 4


@pytest.mark.parametrize("command", COMMANDS)
def test_help_fits_on_a_screen(command, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    assert len(parsers("alphacut", COMMANDS)[1][command].format_help().splitlines()) <= 40
