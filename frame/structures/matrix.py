"""Linear structure from matrices M, D, K: sums of arrays times smooth factors."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, reduce
from math import inf, isfinite
from typing import Any, Self

import numpy as np

from alphacut.base.arrays import Array, Ints
from alphacut.base.errors import (
    RefusedError,
    checked_number,
    is_number,
    require,
    require_choice,
    require_numbers,
    require_sequence,
)
from alphacut.frame.calculus.polynomials import Jet, variables
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.records.history import Accelerogram
from alphacut.frame.structures.linear import (
    Assembly,
    LinearSystem,
    Number,
    evaluate,
    stack,
    undamped_modes,
)
from alphacut.frame.structures.loads import Factor, Force, require_loads
from alphacut.frame.structures.model import PlacedForce
from alphacut.frame.structures.quantities import RATIO, Output, Parameter, require_names

# The matrices M, D and K by the names of their fields.
KINDS = ("mass", "damping", "stiffness")
Terms = Sequence[tuple[Factor | str | float, Array]]


@dataclass(frozen=True, eq=False)
class MatrixStructure(LinearSystem):
    """M(p) q̈ + D(p) q̇ + K(p) q = −M(p) ι a(t) with M(p) = Σ_i f_i(p) M_i, likewise D and K.

    A factor is a number, the name of a parameter, or a function of all parameters in plain
    arithmetic, such as `lambda p: p["E"] * p["l"] ** -3`. Unknowns without mass follow the others,
    q_b = −K_bb⁻¹ K_ba q_a, and are condensed (Guyan 1965); outputs may read them.

    Args:
        parameters: All parameters with their nominal values, in SI units.
        mass: Pairs (factor, symmetric array (n, n)), in kg; an array may be sparse, as those that
            `scipy.io.mmread` reads. Empty of a structure that is asked at rest alone
            (`static_bounds`), whose forces may act on any unknown.
        stiffness: The same, in N/m.
        observed: Rows by output name (an `Output` gives its unit), each (n,) acting on
            displacements, (2n,) on displacements and velocities, or (3n,) on these and absolute
            accelerations q̈ + Σ ι a, those of the ground included. What is taken of accelerations
            has no row factor and is of unknowns with mass.
        damping: The same, in N s/m.
        q0: Initial displacements, shape (n,), in m; zero when None.
        v0: Initial velocities, shape (n,), in m/s; zero when None.
        ground: Base excitation, or None.
        pattern: ι, how the unknowns move rigidly with the ground, shape (n,); ones when None.
        ratios: The damping ratio ζ of all modes, a number or the name of a parameter, or one of
            each mode by rising frequency; added to `damping`, they follow the parameters through
            the modes. Empty for none.
        row_factors: Factor of an output's row by the output's name, as that of a member force; 1
            where none is given.
        loads: Forces on unknowns that have mass. The inertia forces of `components` are added to
            them.
        components: Further components of the ground motion beside `ground`: pairs (accelerogram,
            influence vector (n,)). All components have the same step and number of samples. An
            accelerogram may be None, of a structure that records of several components will move.

    Raises:
        RefusedError: A name or unit is out of alphabet, a shape is wrong, a number not finite, a
            factor names no parameter, an array is not symmetric, the mass of unknowns that have
            mass is not positive definite, one without mass has a damper, a force or no stiffness,
            or a ratio is outside [0, 1); or an output takes accelerations of unknowns
            without mass, or has a factor of them.

    Example:
        >>> import numpy as np
        >>> mass, stiffness = [("m", np.eye(2))], [("k", np.array([[2.0, -1.0], [-1.0, 1.0]]))]
        >>> rows = {"q2": np.array([0.0, 1.0])}
        >>> MatrixStructure({"m": 1e3, "k": 4e4}, mass, stiffness, rows).size
        2
    """

    parameters: Mapping[str, float]
    mass: Terms
    stiffness: Terms
    observed: Mapping[str, Array]
    damping: Terms = ()
    q0: Array | None = None
    v0: Array | None = None
    ground: Accelerogram | None = None
    pattern: Array | None = None
    ratios: Sequence[str | float] = ()
    row_factors: Mapping[str, Factor | str | float] = field(default_factory=dict)
    loads: Sequence[Force] = ()
    components: Sequence[tuple[Accelerogram | None, Array]] = ()

    def __post_init__(self) -> None:
        """Check all fields, and store arrays as dense, exactly symmetric ones.

        Terms and loads become tuples.

        Raises:
            RefusedError: A field is no mapping or sequence where it must be one, or is empty (mass,
                stiffness, observed); a name or unit is out of alphabet; a number is not finite; a
                vector or an array has a wrong shape, or an array is not symmetric; a factor names
                no parameter or gives no number; the mass of the unknowns that have mass is not
                positive definite; an unknown without mass has a damper, a force or no stiffness; a
                damping ratio is outside [0, 1), or their number is not 0, 1 or that of the modes;
                or components of the ground motion are not of one grid of times.
        """
        for name in ("parameters", "observed", "row_factors"):
            value = getattr(self, name)
            is_table = isinstance(value, Mapping)
            require(is_table, name, value=type(value).__name__, allowed="a dict by name")
        for kind in KINDS:
            require_sequence(kind, getattr(self, kind), "a list of pairs (factor, array)")
        require_sequence("ratios", self.ratios, "a list of damping ratios")
        for name, value in self.parameters.items():
            checked_number(f"parameter {name}", value)
        for name in ("stiffness", "observed"):
            require(len(getattr(self, name)) > 0, name, value=None, allowed="one entry at least")
        require_names("name of a parameter", self.parameters)
        require_names("name of an output", self.observed)
        require_loads(self.ground, self.loads)
        for kind in KINDS:
            terms = [self._term(kind, term) for term in getattr(self, kind)]
            object.__setattr__(self, kind, tuple(terms))
        self._require_components()
        # Copies of a structure have its inertia forces already, which are made anew.
        loads = [force for force in self.loads if not force.is_inertial]
        object.__setattr__(self, "loads", (*loads, *self._inertia_forces()))
        self._require_vectors()
        self._require_definite()
        for name, factor in self.row_factors.items():
            require_choice("row_factors", name, self.observed)
            self._require_factor(f"observed: {name}", factor)
        self._require_accelerations()
        self._require_forces_on_masses()
        self._require_ratios()

    def _require_components(self) -> None:
        """Check the components of the ground motion beside the first one.

        Raises:
            RefusedError: One is no pair of an accelerogram and an influence vector, or the samples
                of two components do not belong to the same times.
        """
        allowed = "a list of pairs (Accelerogram, influence vector)"
        require_sequence("components", self.components, allowed)
        for pair in self.components:
            is_pair = isinstance(pair, Sequence) and len(pair) == 2
            is_pair = is_pair and isinstance(pair[0], Accelerogram | None)
            require(is_pair, "components", type(pair).__name__, allowed)
            influence = pair[1]
            require_numbers("influence vector", influence)
            shape = np.shape(influence)
            require(
                shape == (self.size,), "influence vector", f"of shape {shape}", f"({self.size},)"
            )
        for other in self.accelerograms[1:]:
            self.accelerograms[0].require_times_of(other)

    @property
    def accelerograms(self) -> list[Accelerogram]:
        """Accelerograms of all components of the ground motion, of `ground` first."""
        grounds = [self.ground, *(ground for ground, _ in self.components)]
        return [ground for ground in grounds if ground is not None]

    def _inertia_forces(self) -> Iterator[Force]:
        """Yield the forces −M(p) ι a(t) = −Σ_i f_i(p) M_i ι a(t) of each component (ι, a).

        There is one force for each term of the mass, whose amplitude is the factor f_i.
        """
        for ground, influence in self.components:
            if ground is None:
                continue
            for factor, array in self.mass:
                yield Force(-array @ influence, factor, ground, is_inertial=True)

    def moved_by(self, ground: Accelerogram, *others: Accelerogram) -> Self:
        """Return the structure with another base excitation, an accelerogram for each component.

        Raises:
            RefusedError: There are more or fewer accelerograms than influence vectors.
        """
        count = len(self.components) + 1
        what = f"of {len(others) + 1} components"
        allowed = f"{count}, one for each influence vector"
        require(len(others) + 1 == count, "ground", what, allowed)
        influences = [influence for _, influence in self.components]
        components = list(zip(others, influences, strict=True))
        return replace(self, ground=ground, components=components)

    @cached_property
    def _rows(self) -> Array:
        """Rows of m outputs on displacements, velocities and accelerations, shape (m, 3n)."""
        rows = np.zeros((len(self.observed), 3 * self.size))
        for row, observed in zip(rows, self.observed.values(), strict=True):
            row[: len(observed)] = observed  # a shorter row acts on the first of them alone
        return rows

    def _require_accelerations(self) -> None:
        """Raise RefusedError if an output takes accelerations that the structure cannot give.

        Unknowns without mass follow the others, so that their acceleration depends on that of the
        ground at once. A factor would be one of what forces add to accelerations at once as well.
        """
        for k, name in enumerate(self.observed):
            row = self._rows[k, 2 * self.size :]
            if not row.any():
                continue
            key = f"observed: {name}"
            missing = self.massless[np.flatnonzero(row[self.massless])]
            value = f"accelerations of unknowns {missing}"
            require(not len(missing), key, value, "accelerations of unknowns that have mass")
            factor = self.row_factors.get(name, 1.0)
            if isinstance(factor, Monomial):
                factor = factor.simplest
            value = "accelerations times a factor"
            require(factor == 1, key, value, "accelerations as they are", "scale the row")

    def _require_forces_on_masses(self) -> None:
        """Raise RefusedError if a force acts on an unknown without mass, or has no amplitude.

        Without any mass the structure is asked at rest alone, where each unknown may be loaded.
        """
        for force in self.loads:
            self._require_factor("a force", force.amplitude)
            missing = self.massless[np.flatnonzero(np.asarray(force.at)[self.massless])]
            value = f"on unknowns {missing}"
            is_possible = not len(missing) or not self.mass
            require(is_possible, "force", value, allowed="on unknowns that have mass")

    def _require_ratios(self) -> None:
        """Check the damping ratios of the modes.

        There may be none, one for all modes, or as many as there are unknowns with mass. Each is a
        number, or the name of a parameter, whose nominal value is then meant.

        Raises:
            RefusedError: Their number is another one, a value is outside [0, 1), or no parameter
                has the name.
        """
        is_allowed = True
        for ratio in self.ratios:
            if isinstance(ratio, str):
                value = self.parameters.get(ratio, np.nan)
            else:
                value = ratio
            is_within = is_number(value) and RATIO.admits(value, value)
            is_allowed = is_allowed and is_within
        n_modes = len(self.massive)
        allowed = f"one for all modes, or {n_modes}, one for each"
        is_count = len(self.ratios) in (0, 1, n_modes)
        require(is_count, "ratios", f"{len(self.ratios)} damping ratios", allowed)
        allowed = f"one number or parameter, or one a mode, {RATIO.range}"
        require(is_allowed, "ratios", value=self.ratios, allowed=allowed)

    @property
    def size(self) -> int:
        """Number of unknowns n."""
        return int(np.shape((self.mass or self.stiffness)[0][1])[0])

    @cached_property
    def massive(self) -> Ints:
        """Indices of the unknowns that have mass, in rising order."""
        has_mass = np.zeros(self.size, bool)
        for _, array in self.mass:
            has_mass |= array.any(axis=1)
        return np.flatnonzero(has_mass)

    @cached_property
    def massless(self) -> Ints:
        """Indices of the unknowns that have no mass, in rising order."""
        return np.setdiff1d(np.arange(self.size), self.massive)

    def nominal_terms(self, kind: str) -> Array:
        """Return the terms f_i M_i of a matrix Σ f_i M_i at the nominal parameters.

        Args:
            kind: Which matrix: "mass", "damping" or "stiffness".

        Returns:
            Array of shape (terms, n, n) in SI units; (0, n, n) of a damping without terms.
        """
        factors = [float(_value_of(factor, self.parameters)) for factor, _ in getattr(self, kind)]
        return np.array(factors)[:, None, None] * self._arrays[kind]

    def _require_definite(self) -> None:
        """Check that M and K are positive definite where they must be, at the nominal parameters.

        M must be positive definite over the unknowns that have mass, `self.massive`. K must be
        positive definite over the others, `self.massless`, which must have no dampers. Over all
        unknowns K may be indefinite, unless a term of negative trace makes it so.

        Raises:
            RefusedError: One of these does not hold. The hint names a term with a negative trace,
                whose sign is probably wrong.
        """
        mass = self.nominal_terms("mass").sum(axis=0)
        massive = self.massive
        massless = self.massless
        of_massive = mass[np.ix_(massive, massive)]
        if not self.mass:
            return
        is_definite = len(massive) > 0 and np.linalg.eigvalsh(of_massive).min() > 0
        allowed = "a positive definite matrix of the unknowns that have mass"
        cure = "all rows and columns of unknowns that move have mass, coupled by a positive matrix"
        # An element's matrix is semidefinite, with a positive trace: a negative one tells which
        # term has the wrong sign.
        traces = np.trace(self.nominal_terms("mass"), axis1=1, axis2=2)
        if (traces < 0).any():
            cure = f"turn the sign of term {int(traces.argmin()) + 1}: it seems to be −M"
        value = "not positive definite"
        negative = np.flatnonzero(of_massive.diagonal() < 0)
        if negative.size:
            k = int(massive[negative[0]])
            value = f"not positive definite: {mass[k, k]:g} at [{k}, {k}]"
        require(is_definite, "mass", value, allowed=allowed, cure=cure)
        total = self.nominal_terms("stiffness").sum(axis=0)
        self._require_stable(total)
        # Condensation divides by K_bb. An eigenvalue below 1e-14 of the largest entry is the
        # rounding of a zero one, of an unknown that no spring holds.
        if not len(massless):
            return
        of_massless = total[np.ix_(massless, massless)]
        smallest = np.linalg.eigvalsh(of_massless).min() / np.abs(total).max()
        allowed = f"springs that hold the unknowns without mass, {massless[:5].tolist()}"
        require(smallest > 1e-14, "stiffness", value="not positive definite there", allowed=allowed)
        damped = [int(k) for k in massless if self._arrays["damping"][:, k].any()]
        value = f"of unknowns {damped[:5]} without mass"
        require(not damped, "damping", value, "dampers between those with mass")

    def _require_stable(self, stiffness: Array) -> None:
        """Check that no term of negative sign makes the stiffness indefinite.

        A term with a negative trace, as of weights (P-Delta), is allowed if no eigenvalue of the
        sum is below -1e-9 of the sum's largest entry. A sum without such a term is not checked.

        Args:
            stiffness: Sum of all terms at the nominal parameters, shape (n, n).

        Raises:
            RefusedError: There is a negative eigenvalue and a term of negative trace, whose place
                among the terms, from 1 on, the message names.
        """
        traces = np.trace(self.nominal_terms("stiffness"), axis1=1, axis2=2)
        negative = np.flatnonzero(traces < 0)
        if not len(negative):
            return
        # An unsupported structure has eigenvalues of 0, which rounding makes slightly negative.
        is_stable = np.linalg.eigvalsh(stiffness).min() >= -1e-9 * np.abs(stiffness).max()
        what = f"unstable, with a negative diagonal in term {negative[0] + 1}"
        cure = "turn the sign of that matrix or of its factor: it seems to be −K"
        require(bool(is_stable), "stiffness", what, "a stiffness without negative directions", cure)

    @property
    def outputs(self) -> tuple[Output, ...]:
        """Names of the observed quantities, with their units."""
        return tuple(map(Output, self.observed))

    def parameter(self, name: str) -> Parameter:
        """Return a parameter, whose range is known where it is a damping ratio."""
        if name in self.ratios:
            return Parameter(name, RATIO)
        return Parameter(name)

    def with_outputs(self, names: Sequence[str]) -> Self:
        """Return the structure, observed at some of its outputs alone."""
        super().with_outputs(names)
        observed = {name: row for name, row in self.observed.items() if name in names}
        factors = {name: factor for name, factor in self.row_factors.items() if name in names}
        return replace(self, observed=observed, row_factors=factors)

    def with_forces(self, forces: Sequence[PlacedForce]) -> tuple[Self, tuple[str, ...]]:
        """Return the structure under other forces, and the names of their amplitudes.

        Args:
            forces: For each force its `place`, the index of the unknown on which it acts; its
                nominal `amplitude` in N, or in N s of an impulse; and its `history`, None for an
                impulse at t = 0. They replace the loads that the structure has.

        Returns:
            The structure, whose parameters "F1", "F2" … are the amplitudes; parameters of these
            names are overwritten. And these names, in the order of the forces.

        Raises:
            RefusedError: A force acts on an unknown without mass, or its amplitude is not a finite
                number.
            IndexError: There is no such unknown.
        """
        names = tuple(f"F{number}" for number in range(1, len(forces) + 1))
        unit_vectors: Array = np.eye(self.size)
        loads: list[Force] = []
        parameters = dict(self.parameters)
        for name, force in zip(names, forces, strict=True):
            loads.append(Force(unit_vectors[force.place], name, force.history))
            parameters[name] = force.amplitude
        return replace(self, loads=loads, parameters=parameters), names

    def require_dissipation(self, lowest: Mapping[str, float]) -> None:
        """Raise an error if it is not known that the structure loses energy everywhere in a box.

        The damping matrix D = Σ_i f_i D_i is dissipative if no factor f_i is negative and no array
        D_i has a negative eigenvalue. Both are checked. A factor must be a number or a parameter,
        which is smallest at its lower end; of functions nothing is known.

        Args:
            lowest: Smallest value of each parameter in the box, in SI units, by name.

        Raises:
            UnprovedError: The structure has unknowns without mass, a factor of M, D or K that is a
                function (products of powers are functions), or a damping term with a negative
                factor or eigenvalue.
        """
        if len(self.massless):
            raise UnprovedError("unknowns without mass are condensed", "take the method dual")
        for kind in KINDS:
            if any(callable(factor) for factor, _ in getattr(self, kind)):
                raise UnprovedError(f"{kind} has a factor that is a function")
        for factor, array in self.damping:
            # The array is nonnegative but for the rounding of its eigenvalues, a few units of 1e-16
            # of the largest one.
            eigenvalues = np.linalg.eigvalsh(array)
            is_definite = eigenvalues[0] >= -1e-14 * np.abs(eigenvalues).max()
            if _value_of(factor, lowest) < 0 or not is_definite:
                raise UnprovedError(
                    "a term of the damping has a negative factor or an indefinite array: it may"
                    " feed energy into the structure"
                )

    def _term(self, kind: str, term: Any) -> tuple[Factor | str | float, Array]:
        """Return the factor and the array of one term of a matrix, checked and simplified.

        Args:
            kind: "mass", "damping" or "stiffness".
            term: What the user gave: a pair of a factor (a number, the name of a parameter, or a
                function of all parameters) and an array, dense or sparse.

        Returns:
            The factor, in which a product of powers of parameters has become a number or a name
            where it is one; and the dense array, shape (n, n), made exactly symmetric.

        Raises:
            RefusedError: The term is no such pair, the factor gives no number, or the array is not
                square with n rows, not finite, or not symmetric to 1e-9 of its largest entry. n is
                the number of rows of the first array.
        """
        is_pair = isinstance(term, Sequence) and not isinstance(term, str) and len(term) == 2
        value = type(term).__name__
        require(is_pair, f"term of {kind}", value, allowed="pairs (factor, array)")
        factor, value = term
        self._require_factor(kind, factor)
        if isinstance(factor, Monomial):
            factor = factor.simplest
        if hasattr(value, "toarray"):
            value = value.toarray()
        key = f"array of {kind}"
        cure = "all matrices have as many rows and columns as there are unknowns"
        try:
            array = np.asarray(value)
        except ValueError:  # as NumPy refuses rows of different lengths
            raise RefusedError(key, "of uneven rows", "a square array", cure) from None
        require(array.ndim == 2, key, f"of shape {array.shape}", "a square array", cure)
        # the first array of all has been checked before the others
        size = np.shape((self.mass or self.stiffness)[0][1])[0]
        is_square = array.shape == (size, size)
        require(is_square, key, f"of shape {array.shape}", f"({size}, {size})", cure)
        require_numbers(kind, array)
        require_symmetric(key, array, range(size))
        # Eigenvalue solvers read one triangle alone, and proofs bound entries: so the mean of both
        # triangles is taken, which is symmetric to the last bit.
        return factor, np.asarray((array + array.T) / 2, float)

    def _require_factor(self, kind: str, factor: Factor | str | float) -> None:
        """Check that a factor gives a number that can be differentiated.

        Args:
            kind: What the factor is of, for the message.
            factor: A number, the name of a parameter, or a function of all parameters by name. A
                function is called once with jets, numbers that carry their derivatives, at the
                nominal values.

        Raises:
            RefusedError: The factor is no number and gives none, names no parameter, or uses an
                operation that jets do not have. Errors of a function other than KeyError,
                TypeError, AttributeError and ValueError leave as they are.
        """
        # One parameter is differentiated: that is enough to find operations that jets do not have.
        names = list(self.parameters)
        nominal = np.array([list(self.parameters.values())], float)
        try:
            value = _value_of(factor, variables(nominal, names, names[:1]))
        except KeyError as failure:
            name = str(failure.args[0])
            raise RefusedError(f"factor of {kind}", name, ", ".join(names)) from None
        except (TypeError, AttributeError, ValueError) as failure:
            value = failure
        allowed = f"arithmetic to one number, of {', '.join(names)}"
        is_number = isinstance(value, Jet | float | int | np.number)
        require(is_number, f"factor of {kind}", value=repr(value), allowed=allowed)

    def _require_vectors(self) -> None:
        """Check initial values, pattern, rows of outputs and forces, vectors over the n unknowns.

        Initial values and the pattern may be None. Each vector has n finite numbers; the row of an
        output may have 2n, for displacements and velocities, or 3n, for accelerations as well.

        Raises:
            RefusedError: A vector has another shape, or an entry that is no finite number.
        """
        n = self.size
        vectors: list[tuple[str, Any]]
        vectors = [(name, getattr(self, name)) for name in ("q0", "v0", "pattern")]
        vectors += [(f"observed: {name}", row) for name, row in self.observed.items()]
        vectors += [("force", force.at) for force in self.loads]
        for name, value in vectors:
            if value is None:
                continue
            require_numbers(name, value)
            shapes = [(n,)]
            if name.startswith("observed"):
                shapes += [(2 * n,), (3 * n,)]
            shape = np.shape(value)
            allowed = " or ".join(map(str, shapes))
            require(shape in shapes, name, f"of shape {shape}", allowed)

    def assembly(self, p: Mapping[str, Number]) -> Assembly[Number]:
        """Return matrices, output rows and loads of the structure at given parameters.

        Args:
            p: All parameters by name: jets at S parameter sets (values with derivatives), or Taylor
                models over a box (polynomials with error bounds).

        Returns:
            Assembly of numbers of the type of `p`: mass, stiffness of the springs and damping
            matrix, shape (…, n, n); initial displacements and velocities, shape (…, n); constant
            rows of the m outputs on [q; v], shape (m, 2n), and on absolute accelerations, shape
            (m, n), and their factors, shape (…, m); the force vector of each load at its amplitude,
            shape (…, n, loads), None without loads. Here … stands for S with jets and for nothing
            with Taylor models. There is no Rayleigh damping, and no P-Delta.
        """
        n = self.size
        zero: Number = lifted(0.0, p)
        # Σ_i f_i(p) M_i as one contraction of the factors with the stacked arrays
        matrices = {
            kind: values_of([factor for factor, _ in getattr(self, kind)], p).contract(arrays)
            for kind, arrays in self._arrays.items()
        }
        columns: Number | None = None
        if self.loads:
            amplitudes = values_of([force.amplitude for force in self.loads], p)
            unit_forces = np.array([force.at for force in self.loads], float)
            columns = amplitudes[..., None, :] * unit_forces.T
        return Assembly(
            mass=matrices["mass"],
            springs=matrices["stiffness"],
            weights=None,
            dashpots=matrices["damping"],
            rayleigh=(zero, zero),
            ratios=[lifted(ratio, p) for ratio in self.ratios],
            q0=self._start(self.q0, zero),
            v0=self._start(self.v0, zero),
            row_factors=values_of([self.row_factors.get(x, 1.0) for x in self.observed], p),
            rows=self._rows[:, : 2 * n],
            accelerated=self._rows[:, 2 * n :],
            pattern=np.ones(n) if self.pattern is None else np.asarray(self.pattern, float),
            massive=self.massive,
            loads=self.loads,
            columns=columns,
        )

    def _start(self, values: Array | None, zero: Number) -> Number:
        """Return initial values as a number of the type of `zero`; 0 where none are given."""
        given: Array = np.zeros(self.size)
        if values is not None:
            given = np.asarray(values)
        return zero.like(np.broadcast_to(given, (*zero.value.shape, self.size)))

    @cached_property
    def _arrays(self) -> dict[str, Array]:
        """Arrays of the terms of M, D and K by their kinds, shape (terms, n, n) each."""
        arrays: dict[str, Array] = {}
        for kind in KINDS:
            terms = [array for _, array in getattr(self, kind)]
            arrays[kind] = np.array(terms, float).reshape(-1, self.size, self.size)
        return arrays


def values_of(factors: Sequence[Factor | str | float], p: Mapping[str, Number]) -> Number:
    """Return the values of e factors at parameters of shape (…) as one number of shape (…, e)."""
    if not factors:
        zero: Number = lifted(0.0, p)
        return zero.like(np.zeros((*zero.value.shape, 0)))
    return stack([lifted(factor, p) for factor in factors])


def lifted(factor: Factor | str | float, p: Mapping[str, Number]) -> Number:
    """Return the value of a factor at parameters, as a number of their type, shape (…)."""
    value = _value_of(factor, p)
    like: Number = next(iter(p.values()))
    if isinstance(value, type(like)):
        return value
    return like.like(np.full(like.value.shape, float(value)))


def _value_of(factor: Factor | str | float, p: Mapping[str, Any]) -> Any:
    """Return the value of a factor: a number, the name of a parameter, or a function of them."""
    if isinstance(factor, str):
        return p[factor]
    if callable(factor):
        return factor(p)
    return factor


def require_symmetric(key: str, array: Array, names: Sequence[object]) -> None:
    """Raise an error if an array differs from its transpose by more than 1e-9 of its largest entry.

    A smaller difference is rounding.

    Args:
        key: What the array is, for the message.
        array: Shape (n, n), with n ≥ 1.
        names: Names of its n rows and columns, for the message.

    Raises:
        RefusedError: The array is not symmetric; the message has the two entries that differ most.
    """
    asymmetry = np.abs(array - array.T)
    i, j = divmod(int(asymmetry.argmax()), len(array))  # entries are counted row by row
    is_symmetric = asymmetry[i, j] <= 1e-9 * np.abs(array).max()
    pair = f"[{names[i]}, {names[j]}] is {array[i, j]:g}, [{names[j]}, {names[i]}]"
    what = f"not symmetric: {pair} is {array[j, i]:g}"
    require(is_symmetric, key, what, "symmetric arrays", cure="mirror one triangle")


def modal_energy_fractions(system: MatrixStructure, terms: Sequence[int] | Ints) -> Array:
    """Return the fraction of the strain energy of each mode in some terms of K, shape (modes,).

    With K = Σ K_i it is Σ φᵀK_i φ / φᵀK φ over the chosen terms K_i, for the undamped modes φ by
    rising frequency. To first order the loss factor of a mode is the mean of those of its parts
    with these weights (Johnson and Kienholz, AIAA Journal 20, 1284, 1982). The modes are those at
    nominal values; there are as many as unknowns with mass. The fraction of a mode without strain
    energy, such as a rigid motion, is arbitrary or NaN.

    Args:
        system: The structure.
        terms: Indices of the terms among those of the stiffness, from 0 on; one index counts as
            often as it is given.

    Raises:
        IndexError: There is no such term.
    """
    # Every unknown is observed, so that the rows give the modes also at the unknowns without mass,
    # which `evaluate` condenses. Damping by ratios would need the modes that are sought.
    unit: Array = np.eye(system.size)
    every_unknown = {f"u{k}": unit[k] for k in range(system.size)}
    observed = replace(system, observed=every_unknown, row_factors={}, ratios=())
    matrices, rows = evaluate(observed, (), np.zeros((1, 0)), derivatives=False)
    modes = undamped_modes(matrices.mass.value[0], matrices.stiffness.value[0])[1]
    shapes = rows.value[0, :, : len(modes)] @ modes
    springs = system.nominal_terms("stiffness")
    energies = np.einsum("ik,tij,jk->tk", shapes, springs, shapes)
    return np.asarray(energies[terms].sum(axis=0) / energies.sum(axis=0))


@dataclass(frozen=True)
class Monomial:
    """The function c Π pᵢ^kᵢ of named parameters, read from text without evaluating it.

    Args:
        coefficient: c.
        powers: Names with their whole exponents, none 0.

    Example:
        >>> Monomial.parse("12*E*I/l^3")({"E": 2.0, "I": 3.0, "l": 2.0})
        9.0
    """

    coefficient: float
    powers: tuple[tuple[str, int], ...]

    @classmethod
    def parse(cls, text: str) -> Self:
        """Return the monomial of a text such as "12*E*I/l^3".

        The text is a product or quotient of factors, by ``*`` and ``/``. A factor is the name of a
        parameter or a number in plain digits, and may have a whole exponent of up to three digits
        behind ``^`` or ``**``. Each ``/`` divides by the one factor behind it. Names are not
        checked against parameters here; those whose exponents add up to 0 are left out.

        Raises:
            RefusedError: The text is another kind of expression, or its number is not finite, as in
                "1/0".
        """
        # A name or a number with a whole exponent, as l^3 or 12.
        one_factor = re.compile(
            r"\s*(?:(?P<name>[A-Za-z_][A-Za-z0-9_]*)"
            r"|(?P<number>[0-9]*\.?[0-9]+(?:[eE][-+]?[0-9]+)?))"
            r"\s*(?:(?:\^|\*\*)\s*(?P<power>-?[0-9]{1,3}))?\s*"
        )
        coefficient = 1.0
        powers: dict[str, int] = {}
        # A single * or / is an operator, and ** is part of a factor: the texts between the
        # operators are the factors.
        tokens = re.split(r"(?<!\*)([*/])(?!\*)", text)
        operators = ["*", *tokens[1::2]]
        for operator, token in zip(operators, tokens[::2], strict=True):
            match = one_factor.fullmatch(token)
            if match is None:
                allowed = 'a product of powers of parameters, as "1", "Ec" or "2*E*I*l^-2"'
                raise RefusedError("factor", repr(text[:60]), allowed)
            power = int(match["power"] or 1)
            if operator == "/":
                power = -power
            if name := match["name"]:
                powers[name] = powers.get(name, 0) + power
            else:
                try:
                    coefficient *= float(match["number"]) ** power
                except ArithmeticError:  # 1/0, or 10^1000
                    coefficient = inf
        allowed = "a finite number beside the parameters"
        require(isfinite(coefficient), "factor", repr(text[:60]), allowed)
        return cls(coefficient, tuple((name, k) for name, k in powers.items() if k))

    def __str__(self) -> str:
        """Return the factors as they are parsed, such as 12*E*I*l^-3."""
        factors = [name if power == 1 else f"{name}^{power}" for name, power in self.powers]
        if self.coefficient != 1 or not factors:
            factors.insert(0, f"{self.coefficient:g}")
        return "*".join(factors)

    @property
    def simplest(self) -> Monomial | str | float:
        """The monomial in its simplest form.

        This is the coefficient, a float, if there are no powers; the name of the parameter if it is
        a single one with the coefficient 1 and the exponent 1; else the monomial itself. Proofs
        know more of numbers and of parameters than of functions.
        """
        if not self.powers:
            return self.coefficient
        # The text of a monomial is the name of a parameter only if it has no other factor.
        is_name = self.powers == ((str(self), 1),)
        if is_name:
            return str(self)
        return self

    def __call__(self, p: Mapping[str, Any]) -> Any:
        """Return the value at parameters, numbers, arrays or anything with × and powers."""
        factors = [p[name] if power == 1 else p[name] ** power for name, power in self.powers]
        # nothing is multiplied by 1, which would add rounding to a Taylor model
        if self.coefficient != 1 or not factors:
            factors.insert(0, self.coefficient)
        return reduce(lambda product, factor: factor * product, factors)
