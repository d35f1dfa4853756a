"""Linear structures M(p) q̈ + D(p) q̇ + K(p) q = −M(p) ι a(t) + Σ b_i(p) f_i(t) (section 6.1).

A structure is written once, as an `Assembly` over both number types: jets at S parameter sets,
which `evaluate` condenses to `Matrices`, and Taylor models over a box. In shapes, … stands for the
S parameter sets of jets, and for nothing of Taylor models.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Generic, NamedTuple, Self, TypeGuard, TypeVar, cast

import numpy as np

from alphacut.base.arrays import Array, Ints, Mask
from alphacut.base.errors import RefusedError, require
from alphacut.frame.calculus.polynomials import Jet, concatenate, inverse, variables
from alphacut.frame.calculus.taylor_model import TaylorModel
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.records.history import Accelerogram, History
from alphacut.frame.structures.loads import Force, adds_at_once, distinct_histories, history_keys
from alphacut.frame.structures.model import Dynamics, StructureModel

Number = TypeVar("Number", Jet, TaylorModel)


@dataclass(frozen=True, eq=False)
class Assembly(Generic[Number]):
    """A structure of n unknowns and m outputs whose parameters are jets or Taylor models.

    Its damping matrix is D = dashpots + a M + b K_springs + 2 M Φ diag(ζ_k ω_k) Φᵀ M.

    Args:
        mass: M, shape (…, n, n), in kg.
        springs: Stiffness K_springs of the springs, shape (…, n, n), in N/m.
        weights: What weights subtract from the stiffness (P-Delta), the same shape; None for none.
        dashpots: Damping matrix of the dashpots, shape (…, n, n), in N s/m.
        rayleigh: a in 1/s and b in s, shape (…) each.
        ratios: ζ, shape (…) each: none, one of all modes, or one of each by rising frequency.
        q0: Initial displacements, shape (…, n), in m.
        v0: Initial velocities, shape (…, n), in m/s.
        row_factors: Factors of the rows of the outputs, shape (…, m).
        rows: Coefficients of the outputs on [q; v], shape (m, 2n), or (…, m, 2n) if they depend on
            parameters.
        accelerated: Coefficients of the outputs on absolute accelerations, shape (m, n).
        pattern: ι, the displacements under a unit displacement of the ground, shape (n,).
        massive: Indices of the unknowns that have mass, rising.
        loads: Forces on unknowns that have mass.
        columns: Each of them at the amplitude 1 of its history, shape (…, n, forces), in N, that of
            an impulse in N s; None without forces.
    """

    mass: Number
    springs: Number
    weights: Number | None
    dashpots: Number
    rayleigh: tuple[Number, Number]
    ratios: list[Number]
    q0: Number
    v0: Number
    row_factors: Number
    rows: Array | Number
    accelerated: Array
    pattern: Array
    massive: Ints
    loads: Sequence[Force]
    columns: Number | None

    @property
    def stiffness(self) -> Number:
        """K, shape (…, n, n), in N/m."""
        if self.weights is None:
            return self.springs
        return self.springs - self.weights

    @property
    def forces(self) -> Number | None:
        """Force on the unknowns under a unit of each load history, shape (…, n, histories), in N.

        A column is the sum of all loads with one history, at their amplitudes; columns stand in the
        order of the first use of their histories. None if no load has a history, as with impulses
        alone. Over parameter sets the result is a jet (values with derivatives), and … counts the
        sets; over a box it is a Taylor model (polynomials with error bounds), without the axis ….
        """
        # Forces with equal histories share a column, which halves the work of a response.
        keys = history_keys(self.loads)
        distinct = [key for key in dict.fromkeys(keys) if key is not None]
        belongs = np.array([[key == other for other in distinct] for key in keys], float)
        return self._summed(belongs.reshape(len(keys), len(distinct)))

    @property
    def static(self) -> Number | None:
        """Force under which the structure rests at the start besides q0, shape (…, n, 1)."""
        first_values = np.zeros((len(self.loads), 1))
        for row, force in zip(first_values, self.loads, strict=True):
            if force.history is not None and force.history.is_static:
                row[:] = force.history.values(np.zeros(1))
        return self._summed(first_values)

    @property
    def impulse(self) -> Number | None:
        """Impulse at t = 0, shape (…, n, 1), in N s; v0 is the velocity before it."""
        return self._summed(np.array([[float(force.history is None)] for force in self.loads]))

    def _summed(self, weights: Array) -> Number | None:
        """Return weighted sums of the vectors of the loads, shape (…, n, k).

        Args:
            weights: One row for each load, in their order, and k columns, shape (loads, k).

        Returns:
            Column j is the sum of the loads, each at its amplitude, times weights[:, j]. Over
            parameter sets the result is a jet (values with derivatives), and … counts the sets;
            over a box it is a Taylor model, without the axis …. None if there are no loads, or all
            weights are 0.
        """
        if self.columns is None or not weights.any():
            return None
        return self.columns @ weights


def stack(values: Sequence[Number]) -> Number:
    """Return e numbers of shape (…) as one number of shape (…, e)."""
    return type(values[0]).stack(values)


def in_periods(assembly: Assembly[Number], ratio: Number, is_velocity: Mask) -> Assembly[Number]:
    """Return a structure in the time τ = r t, in which loads of the frequency r f0 have f0.

    With ẋ = r dx/dτ the equation M q̈ + D q̇ + K q = b f becomes r² M q″ + r D q′ + K q = b f, where
    ′ is d/dτ. Displacements and forces are those of the structure, at the same part of a period.

    Args:
        assembly: The structure in the time t. No output observes accelerations.
        ratio: r above 0, shape (…).
        is_velocity: Which outputs are velocities, shape (outputs,); others are none in part.
    """
    a, b = assembly.rayleigh
    factors = [ratio if is_one else ratio**0 for is_one in is_velocity]
    return replace(
        assembly,
        mass=assembly.mass * (ratio**2)[..., None, None],
        dashpots=assembly.dashpots * ratio[..., None, None],
        # a M + b K times r, where M is r² times as large.
        rayleigh=(a * ratio**-1, b * ratio),
        # Damping ratios need no factor: frequencies of modes are 1/r times as large.
        v0=assembly.v0 * (ratio**-1)[..., None],
        row_factors=assembly.row_factors * stack(factors),
    )


class LinearSystem(StructureModel):
    """Base of structures whose matrices are smooth functions of named parameters.

    A kind of linear structure gives `parameters`, `outputs` and `assembly`, and `ground`, `loads`
    and `ratios` where it has them. Until columns yield it is linear as well.
    """

    @property
    def dynamics(self) -> Dynamics:
        """Linear, unless columns yield."""
        return Dynamics.LINEAR

    @property
    def ratios(self) -> Collection[str | float]:
        """Damping ratios, numbers or names of parameters: none, one, or one a mode."""
        return ()

    def assembly(self, p: Mapping[str, Number]) -> Assembly[Number]:
        """Return the structure with its parameters as jets or as Taylor models.

        Args:
            p: All parameters by name, of one type and shape.
        """
        raise NotImplementedError

    @property
    def is_at_rest(self) -> bool:
        """Whether nothing is displaced or moves at the start, at the nominal parameters."""
        matrices, _ = evaluate(self, (), np.zeros((1, 0)), derivatives=False)
        return not (matrices.q0.value.any() or matrices.v0.value.any())

    def elastic(self) -> LinearSystem:
        """Return the structure with its initial stiffness, whose columns do not yield."""
        return self

    def moved_by(self, ground: Accelerogram, *others: Accelerogram) -> Self:
        """Return the structure with another base excitation.

        Args:
            ground: Its accelerogram.
            others: Further components, which only a `MatrixStructure` may have.

        Raises:
            RefusedError: There are further components.
        """
        what = f"of {len(others) + 1} components"
        require(not others, "ground", what, "one component, of a frame with one direction")
        moved: Any = replace(cast("Any", self), ground=ground)
        return cast("Self", moved)

    def require_dissipation(self, lowest: Mapping[str, float]) -> None:
        """Raise an error if it is not known that the structure loses energy everywhere in a box.

        Knowledge comes from how the structure is written, not from samples of it. Of a structure in
        general nothing is known, so that this method always raises; kinds of structures that know
        more override it, and return None where damping is dissipative.

        Args:
            lowest: Smallest value of each parameter in the box, in SI units, by name; all are
                within their ranges.

        Raises:
            UnprovedError: Dissipation is not known.
        """
        raise UnprovedError(f"nothing is known about the parameters of a {type(self).__name__}")


def has_matrices(model: object) -> TypeGuard[LinearSystem]:
    """Return whether an object is a structure that is linear, at least until columns yield."""
    return isinstance(model, StructureModel) and model.dynamics is not Dynamics.SMOOTH


def histories(system: LinearSystem) -> dict[str, History]:
    """Return the histories of all loads by name.

    The base acceleration comes first and is named "load". The histories of the forces follow as
    "force1", "force2" … in the order of their first use; equal histories appear once. Those of the
    inertia forces of further components of the ground motion are "component2" …, numbered as they
    stand among all. Impulses have no history. A structure without loads gives an empty dictionary.
    """
    named: dict[str, History] = {}
    if system.ground is not None:
        named["load"] = system.ground
    loads = system.loads
    of_loads = zip(distinct_histories(loads), adds_at_once(loads), strict=True)
    for number, (history, is_force) in enumerate(of_loads, start=1):
        named[f"force{number}" if is_force else f"component{number + 1}"] = history
    return named


@dataclass(frozen=True, eq=False)
class Matrices:
    """The structure at S parameter sets, each entry a jet, its massless unknowns condensed.

    Units are those of `Assembly`.

    Args:
        mass: M, shape (S, n, n).
        damping: D, shape (S, n, n).
        stiffness: K, shape (S, n, n).
        q0: Initial displacements, shape (S, n, 1).
        v0: Initial velocities, shape (S, n, 1).
        rigid: ι, shape (n, 1).
        accelerated: Coefficients of the outputs on absolute accelerations, shape (m, n). A force on
            an accelerated unknown adds to the output at once.
        forces: Force under a unit of each history, shape (S, n, H); None without one.
        static: Force under which the structure rests at the start, shape (S, n, 1), if any.
        impulse: Impulse at t = 0, shape (S, n, 1), if any.
        at_once: Whether each history is that of a force, which adds to absolute accelerations at
            once; not that of an inertia force. Shape (H,).
    """

    mass: Jet
    damping: Jet
    stiffness: Jet
    q0: Jet
    v0: Jet
    rigid: Array
    accelerated: Array
    forces: Jet | None = None
    static: Jet | None = None
    impulse: Jet | None = None
    at_once: Mask = field(default_factory=lambda: np.zeros(0, bool))

    @cached_property
    def inverse_mass(self) -> Jet:
        """M⁻¹, shape (S, n, n)."""
        return inverse(self.mass)

    @property
    def start(self) -> Jet:
        """Initial state [q; v] in m and m/s, shape (S, 2n, 1): n displacements, then n velocities.

        The given displacements are increased by those under the static force, K⁻¹ f, and the given
        velocities by those that the impulse J at t = 0 adds, M⁻¹ J. S counts the parameter sets;
        derivatives by the parameters are carried along (a jet).

        Raises:
            numpy.linalg.LinAlgError: There is a static force and K is singular.
        """
        q0 = self.q0
        v0 = self.v0
        # A static force has acted for ever, so that the structure rests under it, K q = f. An
        # impulse changes momenta M v at once.
        if self.static is not None:
            q0 = q0 + inverse(self.stiffness) @ self.static
        if self.impulse is not None:
            v0 = v0 + self.inverse_mass @ self.impulse
        return concatenate([q0, v0], -2)

    def pushes(self, *, ground: bool) -> Jet:
        """Return the accelerations of the unknowns, at rest, under a unit of each load.

        Args:
            ground: Whether the first column is that of the base acceleration: -ι, where ι are the
                displacements of the unknowns under a unit displacement of the ground.

        Returns:
            Array with its derivatives by the parameters (a jet), shape (S, n, loads), over S
            parameter sets. Behind the base's column, if any, there is one for each history of the
            forces, M⁻¹ b with the force vector b in N, in m/s² for one unit of the history. There
            are none without forces.
        """
        # The slice of the one column of ι is empty without a ground, so that one concatenation
        # serves both cases.
        shape = (*self.mass.value.shape[:-1], int(ground))
        of_ground = np.broadcast_to(self.rigid[:, : int(ground)], shape)
        columns = [self.mass.like(-of_ground)]
        if self.forces is not None:
            columns.append(self.inverse_mass @ self.forces)
        return concatenate(columns, -1)

    @property
    def feeds(self) -> Jet | None:
        """Feedthrough: what a unit of each force history adds to the outputs at once.

        A force adds M⁻¹ b to accelerations at the moment at which it acts, and so to outputs that
        observe these; inertia forces add nothing to absolute ones. The shape is (S, outputs,
        histories) over S parameter sets, with derivatives by the parameters (a jet). It is None if
        no output observes an acceleration, or no force has a history.
        """
        if not self.at_once.any() or not self.accelerated.any():
            return None
        fed: Jet = self.accelerated @ self.pushes(ground=False)
        return fed * self.at_once


def evaluate(
    system: LinearSystem,
    names: Sequence[str],
    points: Array,
    *,
    derivatives: bool,
    by_ratios: bool = True,
) -> tuple[Matrices, Jet]:
    """Return the matrices of a structure and its output rows at S parameter sets.

    Args:
        system: The structure.
        names: Names of d parameters; others keep their nominal values.
        points: Their values in SI units, shape (S, d).
        derivatives: Whether all is differentiated by them, twice.
        by_ratios: Whether damping has the part that is given by ratios of the modes, which takes
            all modes.

    Returns:
        The matrices, whose unknowns all have mass, and the rows C, shape (S, m, 2n), of the outputs
        C [q; v].

    Raises:
        RefusedError: Damping is given by ratios, and the stiffness is not positive definite; or the
            structure has no mass.
        numpy.linalg.LinAlgError: The mass, or the stiffness of the massless unknowns, is singular.
    """
    fixed = {name: x for name, x in system.parameters.items() if name not in names}
    fixed_columns = np.tile(list(fixed.values()), (len(points), 1))
    values = np.hstack([points, fixed_columns])
    # All parameters are jets of the same type, and only the named ones have derivatives.
    p = variables(values, list(names) + list(fixed), names if derivatives else ())
    full = system.assembly(p)
    allowed = "masses of a structure that moves; static_bounds takes one at rest"
    require(len(full.massive) > 0, "mass", None, allowed)

    damping = full.dashpots
    # Rayleigh damping a M + b K is of the springs alone: weights on the storeys (P-Delta) reduce
    # the stiffness, and dissipate nothing.
    for factor, matrix in zip(full.rayleigh, (full.mass, full.springs), strict=True):
        # What is zero with its derivative adds nothing, and no rounding. A factor that is zero at
        # the nominal parameters may still be uncertain.
        if factor.value.any() or factor.first.any():
            damping = damping + factor[:, None, None] * matrix
    mass = full.mass
    stiffness = full.stiffness
    rows: Jet | Array = full.rows

    size = len(full.pattern)
    a = full.massive
    if len(a) < size:
        # Unknowns b without mass, damping and loads are in equilibrium with the others (Guyan
        # 1965): q_b = T q_a with T = −K_bb⁻¹ K_ba. Then K_aa + K_ab T is the stiffness.
        b = np.setdiff1d(np.arange(size), a)
        follow = -(inverse(stiffness[:, b[:, None], b]) @ stiffness[:, b[:, None], a])
        inner = (slice(None), a[:, None], a)
        mass = mass[inner]
        damping = damping[inner]
        stiffness = stiffness[inner] + stiffness[:, a[:, None], b] @ follow
        on_displacements = full.rows[:, a] + full.rows[:, b] @ follow
        on_velocities = full.rows[:, a + size] + full.rows[:, b + size] @ follow
        rows = concatenate([on_displacements, on_velocities], -1)
    if full.ratios and by_ratios:
        damping = damping + modal_damping(mass, stiffness, full.ratios)

    matrices = Matrices(
        mass=mass,
        damping=damping,
        stiffness=stiffness,
        q0=full.q0[:, a, None],
        v0=full.v0[:, a, None],
        rigid=full.pattern[a, None],
        accelerated=full.accelerated[:, a],
        forces=_rows_of(full.forces, a),
        static=_rows_of(full.static, a),
        impulse=_rows_of(full.impulse, a),
        at_once=adds_at_once(full.loads),
    )
    if full.accelerated.any():
        # the absolute acceleration is q̈ + ι a = −M⁻¹ (K q + D v) + M⁻¹ b f, whose last term
        # `Matrices.feeds` has
        on_forces = matrices.accelerated @ matrices.inverse_mass
        rows = rows - on_forces @ concatenate([stiffness, damping], -1)
    return matrices, full.row_factors[..., None] * rows


def _rows_of(forces: Jet | None, unknowns: Ints) -> Jet | None:
    """Return the rows of some unknowns, of forces (S, n, k); None where there are none."""
    if forces is None:
        return None
    return forces[:, unknowns]


def undamped_modes(mass: Array, stiffness: Array) -> tuple[Array, Array]:
    """Return the undamped modes K φ = λ M φ with φᵀM φ = 1.

    Args:
        mass: Symmetric positive definite matrices M, shape (…, n, n).
        stiffness: Symmetric matrices K, the same shape.

    Returns:
        The eigenvalues λ = ω², rising, shape (…, n), and the mode shapes as columns, shape
        (…, n, n).

    Raises:
        numpy.linalg.LinAlgError: A mass matrix is not positive definite.
    """
    # With M = L Lᵀ the problem is L⁻¹ K L⁻ᵀ y = λ y, φ = L⁻ᵀ y. NumPy solves this symmetric problem
    # for a stack of matrices at once; SciPy's solver of the generalised one takes one at a time.
    inverse_factor = np.linalg.inv(np.linalg.cholesky(mass))
    transposed = inverse_factor.swapaxes(-1, -2)
    squared, vectors = np.linalg.eigh(inverse_factor @ stiffness @ transposed)
    return squared, transposed @ vectors


def modal_damping(mass: Jet, stiffness: Jet, ratios: Sequence[Jet]) -> Jet:
    """Return the damping matrix D = M Φ diag(2 ζ_k ω_k) Φᵀ M with its derivatives.

    Arguments and result are jets: values at S parameter sets with their first and second
    derivatives by d inputs. D follows the parameters through the modes Φ, and is not frozen at
    their nominal values. Modes with the same ratio may have equal frequencies; modes with different
    ratios must have different ones, or the derivatives are infinite.

    Args:
        mass: Symmetric positive definite matrices M, shape (S, n, n), in kg.
        stiffness: Symmetric positive definite matrices K, the same shape, in N/m.
        ratios: One ratio ζ, shape (S,), of all modes, or one of each mode by rising frequency.

    Returns:
        D, shape (S, n, n), in N s/m.

    Raises:
        RefusedError: At a parameter set, the smallest eigenvalue ω² is not above 1e-12 of the
            largest.
        numpy.linalg.LinAlgError: A mass is not positive definite.
    """
    squared, shapes = undamped_modes(mass.value, stiffness.value)
    largest = np.maximum(abs(squared).max(-1, keepdims=True), 1e-300)
    # An eigenvalue below the rounding of the largest one, some n 1e-16 of it, is arbitrary, and the
    # derivative of √λ in D is infinite at 0.
    ratio = (squared / largest).min()
    what = f"such that a squared frequency is {ratio:.1e} of the largest"
    cure = "support what moves freely, join storeys that are too stiff, or give dampers"
    if ratio < -1e-10:
        cure = "a stiffness is negative: is a tolerance above 100 %, or the sign of a term wrong?"
    require(ratio > 1e-12, "stiffness", value=what, allowed="more than 1e-12 of it", cure=cure)

    number: Ints = np.zeros(squared.shape[-1], int)  # of the ratio of each mode
    if len(ratios) > 1:
        entries = [(x.value.tobytes(), x.first.tobytes(), x.second.tobytes()) for x in ratios]
        # the number of the first mode with the same ratio
        number = np.array([entries.index(entry) for entry in entries])

    # With A = M⁻¹ K = Φ diag(λ) Φ⁻¹ and Φ⁻¹ = Φᵀ M, D is M Σ_k ζ_k f_k(A), where f_k(λ) = 2 √λ of
    # the modes of ratio k and 0 of others. The derivatives of f(A) are (Daleckii and Krein, AMS
    # Transl. 47, 1965), with G_i = Φ⁻¹ A_i Φ and divided differences f[·]:
    #     (Φ⁻¹ f(A)_i Φ)_ab = f[λ_a, λ_b] (G_i)_ab,
    #     (Φ⁻¹ f(A)_ij Φ)_ab = f[λ_a, λ_b] (Φ⁻¹ A_ij Φ)_ab
    #         + Σ_c f[λ_a, λ_c, λ_b] ((G_i)_ac (G_j)_cb + (G_j)_ac (G_i)_cb).
    inverse_shapes = shapes.swapaxes(-1, -2) @ mass.value
    dynamic = inverse(mass) @ stiffness
    first = inverse_shapes @ dynamic.first @ shapes
    second = inverse_shapes @ dynamic.second @ shapes
    omega = np.sqrt(squared)
    total = mass * 0.0
    for k in np.unique(number):
        f = _divided_differences(omega, number == k)
        # two products without a search for their order, which takes longer
        weighted = f.second * first[..., np.newaxis]
        pairs = np.einsum("asikj,bskj->absij", weighted, first)
        bend = f.first * second + pairs + pairs.swapaxes(0, 1)
        value = np.where(number == k, 2 * omega, 0.0)[:, None] * shapes
        function = Jet.of(
            value @ inverse_shapes,
            shapes @ (f.first * first) @ inverse_shapes,
            shapes @ bend @ inverse_shapes,
        )
        total = total + ratios[k][:, None, None] * (mass @ function)
    return total


def require_modal_order(mass: Array, stiffness: Array, ratios: Array) -> None:
    """Raise an error if modes with unequal damping ratios change their order by frequency.

    The order at the nominal parameters is compared with the order at other parameter sets.

    Args:
        mass: M at S parameter sets, the nominal ones first, shape (S, n, n).
        stiffness: K at the same, shape (S, n, n).
        ratios: Damping ratios of the modes by rising frequency, shape (n,).

    Raises:
        RefusedError: At some set a mode is most similar to a nominal mode of another place, and the
            ratios of the two places differ.
        numpy.linalg.LinAlgError: A mass is not positive definite.
    """
    shapes = undamped_modes(mass, stiffness)[1]
    # Modal assurance by the mass: |φ_iᵀ M φ_k| is 1 of the same mode and 0 of another one at the
    # nominal parameters. A crossing shows as a mode that is most like another nominal one.
    similarity = np.abs(shapes[0].T @ mass[0] @ shapes)  # (S, nominal modes, modes)
    nominal = similarity.argmax(axis=1)  # the nominal mode that each mode is most like, (S, n)
    for _, k in np.argwhere(ratios[nominal] != ratios):
        pair = f"modes {min(k, nominal[:, k].min()) + 1} and {max(k, nominal[:, k].max()) + 1}"
        what = f"unequal where {pair} may cross"
        cure = "give both the same ratio, or take narrower inputs"
        raise RefusedError("damping ratios", what, "modes apart", cure)


class _DividedDifferences(NamedTuple):
    """First and second divided differences, shapes (S, n, n) and (S, n, n, n)."""

    first: Array
    second: Array


def _divided_differences(omega: Array, inside: Mask) -> _DividedDifferences:
    """Return the divided differences of f, where f is 2 √λ at some modes and 0 at the others.

    They are f[x, y] = (f(x) - f(y)) / (x - y) and f[x, y, z] = (f[x, y] - f[y, z]) / (x - z), or
    their limits where arguments are equal.

    Args:
        omega: ω = √λ > 0 of n modes at S parameter sets, shape (S, n). Two modes inside may have
            equal frequencies, and two outside as well. One inside and one outside must not: the
            differences are then infinite.
        inside: Modes where f is 2 √λ, shape (n,).

    Returns:
        `first`, f[λ_i, λ_j] by [set, i, j], shape (S, n, n); and `second`, f[λ_i, λ_k, λ_j] by
        [set, i, k, j], shape (S, n, n, n).
    """
    both_inside = inside[:, None] & inside
    one_inside = inside[:, None] != inside
    f = np.where(inside, 2 * omega, 0.0)
    sums = omega[:, :, None] + omega[:, None]
    gaps = omega[:, :, None] ** 2 - omega[:, None] ** 2
    # Quotients by gaps are used only for one mode inside and one outside; elsewhere a gap may be 0.
    safe_gaps = np.where(one_inside, gaps, 1.0)

    # 2 (√x − √y) / (x − y) = 2 / (√x + √y) has no cancellation where both modes are inside.
    quotients = (f[:, :, None] - f[:, None]) / safe_gaps
    mixed_first = np.where(one_inside, quotients, 0.0)
    first = np.where(both_inside, 2 / sums, mixed_first)

    # Inside, f[x, y, z] = −2 / ((√x + √y) (√y + √z) (√z + √x)). Else it is the quotient
    # (f[x, y] − f[y, z]) / (x − z) by a pair of which one mode is inside and one outside. Divided
    # differences do not depend on the order of their arguments, so any such pair may be x and z:
    # i and k here, else i and j, else none, and all are 0, since i, k and j are all outside.
    closed = -2 / (sums[..., None] * sums[:, None] * sums[:, :, None])
    by_i_k = (first[:, :, None] - first[:, None]) / safe_gaps[..., None]
    by_i_j = (first[..., None] - first[:, None]) / safe_gaps[:, :, None]
    by_i_j_or_none = np.where(one_inside[:, None], by_i_j, 0.0)
    mixed = np.where(one_inside[..., None], by_i_k, by_i_j_or_none)
    all_inside = both_inside[..., None] & inside
    second = np.where(all_inside, closed, mixed)
    return _DividedDifferences(first, second)


def frequencies(system: LinearSystem) -> Array:
    """Return the undamped ω at the nominal parameters, rising, shape (n,), in rad/s."""
    return nominal_modes(system).frequencies


@dataclass(frozen=True, eq=False)
class NominalModes:
    """Undamped modes φ of a structure at its nominal parameters, by rising frequency.

    Args:
        frequencies: Angular frequencies ω in rad/s, shape (n,).
        damping_ratios: φᵀ D φ / (2 ω), with φᵀ M φ = 1, shape (n,).
        effective_masses: (φᵀ M ι)² in kg, shape (n,): the mass of an oscillator with the mode's
            base shear. They add up to `moved_mass`.
        moved_mass: ιᵀ M ι in kg, the mass that moves with the ground in its direction.
    """

    frequencies: Array
    damping_ratios: Array
    effective_masses: Array
    moved_mass: float

    @property
    def periods(self) -> Array:
        """Natural periods in s, shape (n,); above 1e300 s of a mode without stiffness."""
        return np.asarray(2 * np.pi / np.maximum(self.frequencies, 1e-300))


def nominal_modes(system: LinearSystem) -> NominalModes:
    """Return the undamped modes φ of a structure at its nominal parameters, by rising frequency.

    They are K φ = ω² M φ with φᵀ M φ = 1, of the unknowns that have mass.

    Returns:
        Arrays of shape (modes,): `frequencies`, ω in rad/s, 0 of a mode with ω² ≤ 0;
        `damping_ratios`, φᵀ D φ / (2 ω); and `effective_masses`, (φᵀ M ι)² in kg, where ι are the
        displacements under a unit displacement of the ground. And the number `moved_mass`, ιᵀ M ι
        in kg, to which the effective masses add up.

    Raises:
        RefusedError: Damping is given by ratios of the modes, and the stiffness is not positive
            definite.
        numpy.linalg.LinAlgError: The mass, or the stiffness of unknowns without mass, is singular.
    """
    matrices, _ = evaluate(system, (), np.zeros((1, 0)), derivatives=False)
    mass = matrices.mass.value[0]
    damping = matrices.damping.value[0]
    squared, shapes = undamped_modes(mass, matrices.stiffness.value[0])
    omega = np.sqrt(np.maximum(squared, 0.0))
    # The damping matrix need not be diagonal in the modes. Its diagonal φᵀ D φ = 2 ζ ω is what
    # a mode dissipates to first order in D.
    modal_damping_constants = np.einsum("ik,ij,jk->k", shapes, damping, shapes)
    influence = matrices.rigid[:, 0]
    participation = shapes.T @ mass @ influence
    return NominalModes(
        frequencies=omega,
        # The floor gives a rigid mode, whose ratio has no meaning, a finite or infinite number.
        damping_ratios=modal_damping_constants / np.maximum(2 * omega, 1e-300),
        effective_masses=participation**2,
        moved_mass=float(influence @ mass @ influence),
    )
