"""Linear structures M(p) q̈ + D(p) q̇ + K(p) q = −M(p) ι a(t) + Σ b_i(p) f_i(t) (section 6.1).

A structure is written once, as an `Assembly` over both number types: jets at S parameter sets,
which `evaluate` condenses to `Matrices`, and Taylor models over a box. In shapes, … is the S
parameter sets of jets, and nothing for Taylor models.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Generic, Self, TypeGuard, TypeVar, cast

import numpy as np

from alphacut.base.arrays import Array, Ints, Mask
from alphacut.base.errors import RefusedError, require
from alphacut.frame.calculus.jet import Jet, concatenate, inverse, variables
from alphacut.frame.calculus.taylor_model import TaylorModel
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.records.history import Accelerogram, History
from alphacut.frame.structures.loads import Force, distinct_histories
from alphacut.frame.structures.model import Dynamics, StructureModel

Number = TypeVar("Number", Jet, TaylorModel)


@dataclass(frozen=True, eq=False)
class Assembly(Generic[Number]):
    """A structure of n unknowns and m outputs with its parameters as jets or as Taylor models.

    Its damping is D = dashpots + a M + b K_springs + 2 M Φ diag(ζ_k ω_k) Φᵀ M.

    Args:
        mass: M, shape (…, n, n), in kg.
        springs: K of the springs, shape (…, n, n), in N/m.
        weights: What weights take from K (P-Delta), the same shape; None for nothing.
        dashpots: Their part of D, shape (…, n, n), in N s/m.
        rayleigh: a in 1/s and b in s, shape (…) each.
        ratios: ζ, shape (…) each: none, one of all modes, or one of each by rising frequency.
        q0: Initial displacements, shape (…, n), in m.
        v0: Initial velocities, shape (…, n), in m/s.
        row_factors: What the outputs' rows are multiplied by, shape (…, m).
        rows: What outputs take of [q; v], shape (m, 2n), or (…, m, 2n) where parameters are in it.
        accelerated: What they take of absolute accelerations, shape (m, n).
        pattern: ι, how the unknowns move rigidly with the ground, shape (n,).
        massive: Unknowns that have mass, rising.
        loads: Forces on unknowns that have mass.
        columns: Each of them at the amplitude 1 of its history, shape (…, n, F), in N, impulses in
            N s; None where there are none.
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
        return self.springs if self.weights is None else self.springs - self.weights

    @property
    def forces(self) -> Number | None:
        """Columns b, one a history of forces, shape (…, n, H), in N; None without one."""
        keys = [force.history and force.history.identity for force in self.loads]
        columns = [history.identity for history in distinct_histories(self.loads)]
        return self._summed(np.array([[key == x for x in columns] for key in keys], float))

    @property
    def static(self) -> Number | None:
        """Force under which the structure rests at the start besides q0, shape (…, n, 1)."""
        histories = [force.history for force in self.loads]
        first = [x.values(np.zeros(1))[0] if x and x.is_static else 0.0 for x in histories]
        return self._summed(np.array(first, float)[:, None])

    @property
    def impulse(self) -> Number | None:
        """Impulse at t = 0, shape (…, n, 1), in N s; v0 comes before it."""
        return self._summed(np.array([[float(force.history is None)] for force in self.loads]))

    def _summed(self, weight: Array) -> Number | None:
        """Σ_F b_F weight_Fk over all forces, shape (…, n, k); None where all are zero."""
        return self.columns @ weight if self.columns is not None and weight.any() else None


def stack(values: Sequence[Number]) -> Number:
    """Joins numbers shape (…) to one of shape (…, e)."""
    return type(values[0]).stack(values)


class LinearSystem(StructureModel):
    """Base of structures whose matrices are smooth functions of named parameters.

    A kind of linear structure gives `parameters`, `outputs`, `assembly` and `entry_roundings`, and
    `ground`, `loads` and `ratios` where it has them. Until columns yield it is linear as well.
    """

    @property
    def dynamics(self) -> Dynamics:
        """Linear, unless columns yield."""
        return Dynamics.LINEAR

    @property
    def ratios(self) -> Collection[str | float]:
        """Damping ratios, numbers or names of parameters: none, one, or one a mode."""
        return ()

    @property
    def entry_roundings(self) -> int:
        """Largest number of roundings in the computation of an entry of M, K and output rows."""
        raise NotImplementedError

    def assembly(self, p: Mapping[str, Number]) -> Assembly[Number]:
        """Return the structure with its parameters as jets or as Taylor models."""
        raise NotImplementedError

    @property
    def is_at_rest(self) -> bool:
        """Whether nothing is displaced or moves at the start, at the nominal parameters."""
        matrices, _ = evaluate(self, (), np.zeros((1, 0)), derivatives=False)
        return not (matrices.q0.value.any() or matrices.v0.value.any())

    def elastic(self) -> LinearSystem:
        """Return the structure with its initial stiffness, whose columns do not yield."""
        return self

    def moved_by(self, ground: Accelerogram) -> Self:
        """Return the structure with another base excitation."""
        moved: Any = replace(cast("Any", self), ground=ground)
        return cast("Self", moved)

    def require_dissipation(self, lowest: Mapping[str, float]) -> None:
        """Refuse a structure that is not known to lose energy everywhere in a box of parameters.

        It follows from how the structure is written, not from samples of it.

        Args:
            lowest: Least value of each parameter in the box; all are within their ranges.

        Raises:
            UnprovedError: Unknowns have no mass, or a term of the damping may feed energy into the
                structure.
        """
        raise UnprovedError(f"nothing is known about the parameters of a {type(self).__name__}")


def has_matrices(model: object) -> TypeGuard[LinearSystem]:
    """Return whether an object is a structure that is linear, at least until columns yield."""
    return isinstance(model, StructureModel) and model.dynamics is not Dynamics.SMOOTH


def histories(system: LinearSystem) -> dict[str, History]:
    """Histories of all loads by name, in the order of `Matrices.pushes`: load, force1, …."""
    of_ground = {} if system.ground is None else {"load": system.ground}
    of_forces = enumerate(distinct_histories(system.loads), start=1)
    return of_ground | {f"force{k}": history for k, history in of_forces}


@dataclass(frozen=True, eq=False)
class Matrices:
    """The structure at S parameter sets, each entry a jet, its massless unknowns condensed.

    Units are those of `Assembly`. Shapes are (S, n, n) of `mass`, `damping` and `stiffness`, (S, n,
    1) of `q0`, `v0`, `static` and `impulse`, (S, n, H) of `forces`, (n, 1) of `rigid`, which is ι,
    and (m, n) of `accelerated`: accelerations that outputs read besides their rows, to which a
    force on the same unknown adds at once.
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

    @cached_property
    def inverse_mass(self) -> Jet:
        """M⁻¹, shape (S, n, n)."""
        return inverse(self.mass)

    @property
    def start(self) -> Jet:
        """Initial state [q; v], shape (S, 2n, 1)."""
        q0, v0 = self.q0, self.v0
        if self.static is not None:
            q0 = q0 + inverse(self.stiffness) @ self.static
        if self.impulse is not None:
            v0 = v0 + self.inverse_mass @ self.impulse
        return concatenate([q0, v0], -2)

    def pushes(self, *, ground: bool) -> Jet:
        """Accelerations by a unit of each load, the ground's first, shape (S, n, L)."""
        shape = (*self.mass.value.shape[:-1], int(ground))
        columns = [self.mass.like(-np.broadcast_to(self.rigid[:, : int(ground)], shape))]
        if self.forces is not None:
            columns.append(self.inverse_mass @ self.forces)
        return concatenate(columns, -1)

    @property
    def feeds(self) -> Jet | None:
        """What a unit of each force adds to outputs at once, shape (S, m, H); None if nothing."""
        if self.forces is None or not self.accelerated.any():
            return None
        fed: Jet = self.accelerated @ self.pushes(ground=False)
        return fed


def evaluate(
    system: LinearSystem,
    names: Sequence[str],
    points: Array,
    *,
    derivatives: bool,
    by_ratios: bool = True,
) -> tuple[Matrices, Jet]:
    """A structure's matrices and rows C at points (S, d) of d parameters, in SI units.

    Output is C [q; v], C of shape (S, m, 2n). Other parameters keep their nominal values. With
    `derivatives` all are differentiated by `names`, twice. Without `by_ratios` damping lacks the
    part that is given by ratios of the modes, which needs all modes.
    """
    fixed = {name: x for name, x in system.parameters.items() if name not in names}
    values = np.hstack([points, np.tile(list(fixed.values()), (len(points), 1))])
    p = variables(values, [*names, *fixed], names if derivatives else ())
    full = system.assembly(p)
    n, a = len(full.pattern), full.massive
    mass, stiffness, damping = full.mass, full.stiffness, full.dashpots
    for factor, matrix in zip(full.rayleigh, (full.mass, full.springs), strict=True):
        if factor.value.any() or factor.first.any():
            damping = damping + factor[:, None, None] * matrix
    rows: Jet | Array = full.rows
    if len(a) < n:  # unknowns b without mass are condensed, q_b = −K_bb⁻¹ K_ba q_a (Guyan 1965)
        b, inner = np.setdiff1d(np.arange(n), a), (slice(None), a[:, None], a)
        follow = -(inverse(stiffness[:, b[:, None], b]) @ stiffness[:, b[:, None], a])
        mass, damping = mass[inner], damping[inner]
        stiffness = stiffness[inner] + stiffness[:, a[:, None], b] @ follow
        # columns of displacements, then of velocities
        columns = [full.rows[:, a + k] + full.rows[:, b + k] @ follow for k in (0, n)]
        rows = concatenate(columns, -1)
    if full.ratios and by_ratios:
        damping = damping + modal_damping(mass, stiffness, full.ratios)
    forces, static, impulse = (x and x[:, a] for x in (full.forces, full.static, full.impulse))
    matrices = Matrices(
        mass=mass,
        damping=damping,
        stiffness=stiffness,
        q0=full.q0[:, a, None],
        v0=full.v0[:, a, None],
        rigid=full.pattern[a, None],
        accelerated=full.accelerated[:, a],
        forces=forces,
        static=static,
        impulse=impulse,
    )
    if full.accelerated.any():  # q̈ + ι a = −M⁻¹ (K q + D v) + M⁻¹ b f
        reading = matrices.accelerated @ matrices.inverse_mass
        rows = rows - reading @ concatenate([stiffness, damping], -1)
    return matrices, full.row_factors[..., None] * rows


def undamped_modes(mass: Array, stiffness: Array) -> tuple[Array, Array]:
    """λ = ω², rising, and modes φ of K φ = λ M φ with φᵀM φ = 1, shapes (…, n) and (…, n, n)."""
    inverse_factor = np.linalg.inv(np.linalg.cholesky(mass))  # L⁻¹ of M = L Lᵀ
    transposed = inverse_factor.swapaxes(-1, -2)
    squared, vectors = np.linalg.eigh(inverse_factor @ stiffness @ transposed)
    return squared, transposed @ vectors


def modal_damping(mass: Jet, stiffness: Jet, ratios: Sequence[Jet]) -> Jet:
    """D = M Φ diag(2 ζ_k ω_k) Φᵀ M, shape (S, n, n), in N s/m, with its derivatives.

    It follows the parameters through the modes Φ, and is not frozen at their nominal values. Modes
    of one ratio may have equal frequencies.

    M and K are symmetric and positive definite, shape (S, n, n). There is one ratio ζ, shape (S,),
    of all modes, or one of each mode by rising frequency.

    Raises:
        RefusedError: A stiffness is not positive definite, but for rounding.
    """
    squared, X = undamped_modes(mass.value, stiffness.value)
    ratio = (squared / np.maximum(abs(squared).max(-1, keepdims=True), 1e-300)).min()
    what = f"such that a squared frequency is {ratio:.1e} of the greatest"
    cure = "support what moves freely, join storeys that are too stiff, or give dampers"
    require(ratio > 1e-12, "stiffness", value=what, allowed="more than 1e-12 of it", cure=cure)
    Y, A = X.swapaxes(-1, -2) @ mass.value, inverse(mass) @ stiffness
    G, omega = Y @ A.first @ X, np.sqrt(squared)
    total, number = mass * 0.0, np.full(squared.shape[-1], 0)
    if len(ratios) > 1:
        entries = [(x.value.tobytes(), x.first.tobytes(), x.second.tobytes()) for x in ratios]
        same = [[x == y for y in entries] for x in entries]
        number = np.argmax(same, axis=1)  # that of the first mode with the same ratio
    for k in np.unique(number):
        # f(A) of f(λ) = 2 √λ for the modes of this ratio, 0 for others
        quotients, second_quotients = _divided_differences(omega, number == k)
        f = [np.where(number == k, 2 * omega, 0.0)[:, None] * X, quotients * G]
        pairs = np.einsum("sikj,asik,bskj->absij", second_quotients, G, G, optimize=True)
        bend = quotients * (Y @ A.second @ X) + pairs + pairs.swapaxes(0, 1)
        of_modes = Jet.of(f[0] @ Y, X @ f[1] @ Y, X @ bend @ Y)  # Daleckii, Krein 1965
        total = total + ratios[k][:, None, None] * (mass @ of_modes)
    return total


def require_modal_order(mass: Array, stiffness: Array, ratios: Array) -> None:
    """Refuse modes of unequal damping ratio (n,) that change places between parameter sets.

    M and K are given at S sets, the nominal ones first, shape (S, n, n).
    """
    shapes = undamped_modes(mass, stiffness)[1]
    similarity = np.abs(shapes[0].T @ mass[0] @ shapes)  # of nominal shapes (rows) and others
    nominal = similarity.argmax(1)  # the nominal mode that each mode is most like, (S, n)
    for _, k in np.argwhere(ratios[nominal] != ratios):
        pair = f"modes {min(k, nominal[:, k].min()) + 1} and {max(k, nominal[:, k].max()) + 1}"
        what = f"unequal where {pair} may cross"
        cure = "give both the same ratio, or take narrower inputs"
        raise RefusedError("damping ratios", what, "modes apart", cure)


def _divided_differences(omega: Array, inside: Mask) -> tuple[Array, Array]:
    """f[λ_i, λ_j], (S, n, n), and f[λ_i, λ_k, λ_j], (S, n, n, n), of f = 2 √λ `inside`, else 0."""
    # modes inside may have equal λ, not one inside and one outside
    both_inside, sums = inside[:, None] & inside, omega[:, :, None] + omega[:, None]
    gaps = omega[:, :, None] ** 2 - omega[:, None] ** 2
    one_inside = inside[:, None] != inside
    f, safe = np.where(inside, 2 * omega, 0.0), np.where(one_inside, gaps, 1.0)
    first = np.where(
        both_inside, 2 / sums, np.where(one_inside, (f[:, :, None] - f[:, None]) / safe, 0.0)
    )
    # f[x, y, z] = (f[x, y] − f[y, z]) / (x − z) by a pair of which one is inside, one outside
    i_k = (first[:, :, None] - first[:, None]) / safe[..., None]
    i_j = (first[..., None] - first[:, None]) / safe[:, :, None]
    closed = -2 / (sums[..., None] * sums[:, None] * sums[:, :, None])
    mixed = np.where(one_inside[..., None], i_k, np.where(one_inside[:, None], i_j, 0.0))
    return first, np.where(both_inside[..., None] & inside, closed, mixed)


def frequencies(system: LinearSystem) -> Array:
    """Undamped angular frequencies at the nominal parameters, rising, shape (n,), in rad/s."""
    return modal_damping_ratios(system)[0]


def modal_damping_ratios(system: LinearSystem) -> tuple[Array, Array]:
    """Undamped ω in rad/s and ratios φᵀDφ/(2ω) of all modes at nominal values, shape (n,) each."""
    modes = nominal_modes(system)
    return modes.frequencies, modes.damping_ratios


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


def nominal_modes(system: LinearSystem) -> NominalModes:
    """Return the undamped modes at the nominal parameters."""
    matrices, _ = evaluate(system, (), np.zeros((1, 0)), derivatives=False)
    M, D, K = (x.value[0] for x in (matrices.mass, matrices.damping, matrices.stiffness))
    squared, shapes = undamped_modes(M, K)
    omega = np.sqrt(np.maximum(squared, 0.0))
    ratios = np.einsum("ik,ij,jk->k", shapes, D, shapes) / np.maximum(2 * omega, 1e-300)
    influence = matrices.rigid[:, 0]
    participation = shapes.T @ M @ influence
    return NominalModes(omega, ratios, participation**2, float(influence @ M @ influence))
