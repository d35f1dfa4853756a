"""Mechanical systems by a Lagrangian L(q, v; p) and forces F(q, v; p); smooth ODEs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

from alphacut.base.errors import RefusedError, checked_number, require
from alphacut.base.extras import extra_named
from alphacut.frame.structures.model import Dynamics, StructureModel
from alphacut.frame.structures.quantities import Output, require_names

if TYPE_CHECKING:
    from sympy import Expr, Matrix

Symbols = Sequence[Any]
Named = Mapping[str, Any]
Function = Callable[[Symbols, Symbols, Named], Any]


@dataclass(frozen=True, eq=False)
class LagrangianSystem(StructureModel):
    """A system with n coordinates, given by plain Python functions of (q, v, p).

    The functions are called with symbols. They may use arithmetic, whole and fractional powers, and
    the smooth functions of SymPy (`sympy.sin`, `cos`, `tan`, `exp`, `log`, `sqrt`); those of `math`
    and NumPy do not go.

    Args:
        coordinates: Number of coordinates n.
        parameters: All parameters with their nominal values, in SI units.
        lagrangian: L(q, v, p), with q and v sequences of n and p a mapping from names.
        initial: The initial state (q0, v0) from p, n numbers each.
        observed: Outputs by name, each a function of (q, v, p); `Output` names give a unit.
        force: Generalised forces F(q, v, p), n of them; None for none.

    Raises:
        RefusedError: A name or unit is out of alphabet, L is not quadratic in v, a coordinate has
            no inertia, or a function asks for what is not there or gives a list of another length.
            Functions that are not smooth are refused when a trajectory is computed.

    Example:
        >>> oscillator = LagrangianSystem(
        ...     coordinates=1,
        ...     parameters={"m": 1.0, "k": 4.0},
        ...     lagrangian=lambda q, v, p: p["m"] * v[0] ** 2 / 2 - p["k"] * q[0] ** 2 / 2,
        ...     initial=lambda p: ([0.1], [0.0]),
        ...     observed={"q1": lambda q, v, p: q[0]},
        ... )
        >>> oscillator.coordinates
        1
    """

    coordinates: int
    parameters: Mapping[str, float]
    lagrangian: Function
    initial: Callable[[Named], tuple[Symbols, Symbols]]
    observed: Mapping[str, Function]
    force: Function | None = None

    def __post_init__(self) -> None:
        """Check numbers and functions, calling each function once with symbols.

        Raises:
            RefusedError: `coordinates` is no whole number from 1 on; `parameters` or `observed` is
                empty, has a name out of alphabet, or a parameter is no finite number; the
                Lagrangian is not quadratic in the velocities v; a coordinate has no inertia at the
                initial state of the nominal parameters; or a function asks for a name, a coordinate
                or an operation that is not there, or gives another count of expressions than it
                must.
        """
        checked_number("coordinates", self.coordinates, whole=True, least=1)
        for name in ("parameters", "observed"):
            mapping = getattr(self, name)
            has_entries = isinstance(mapping, Mapping) and bool(mapping)
            require(has_entries, name, value=mapping, allowed="values by name, one at least")
            require_names(f"name in {name}", mapping)
        for name, value in self.parameters.items():
            checked_number(f"parameter {name}", value)

        # The variational integrator solves for velocities from momenta ∂L/∂v, which is linear if
        # ∂²L/∂v² has no velocity in it.
        eq = self.symbols
        is_quadratic = not eq.mass.free_symbols & set(eq.v)
        allowed = "functions quadratic in v"
        require(is_quadratic, "lagrangian", value=eq.mass.tolist(), allowed=allowed)
        for name in self.observed:
            self.output(name, eq.v)
        # Without inertia a momentum does not tell the velocity: the matrix ∂²L/∂v² is singular. It
        # is checked at one point, since symbols do not tell whether a determinant can vanish.
        # 1e-300 is 0 but for underflow.
        q0, v0 = self.start()
        at_start = dict(zip(list(eq.q) + list(eq.v), q0 + v0, strict=True))
        nominal = {eq.p[name]: value for name, value in self.parameters.items()}
        has_inertia = abs(eq.mass.subs(at_start).subs(nominal).evalf().det()) >= 1e-300
        allowed = "inertia of each coordinate"
        require(has_inertia, "mass of the lagrangian", "singular", allowed)

    def start(self) -> tuple[list[Expr], list[Expr]]:
        """Return the initial state (q0, v0) as expressions in the parameters, n of each."""
        p = self.symbols.p
        n = self.coordinates
        q0 = _expressions("initial", lambda: self.initial(p)[0], p, n)
        v0 = _expressions("initial", lambda: self.initial(p)[1], p, n)
        return q0, v0

    def output(self, name: str, velocity: Symbols) -> Expr:
        """Return an output as a SymPy expression in coordinates, velocities and parameters.

        Args:
            name: Name of the output.
            velocity: The n expressions or symbols that stand for the velocities.

        Raises:
            RefusedError: The function of the output does not give one expression.
        """
        q = list(self.symbols.q)
        p = self.symbols.p
        function = self.observed[name]
        values = _expressions(f"observed: {name}", lambda: [function(q, list(velocity), p)], p)
        return values[0]

    @property
    def outputs(self) -> tuple[Output, ...]:
        """Names of the observed quantities, with their units."""
        return tuple(map(Output, self.observed))

    @property
    def dynamics(self) -> Dynamics:
        """Nonlinear and smooth, by what SymPy can differentiate."""
        return Dynamics.SMOOTH

    @cached_property
    def symbols(self) -> Equations:
        """The equations of motion in symbols."""
        return Equations(self)


class Equations:
    """Symbols of a system, and the terms of its equations of motion d/dt(∂L/∂v) = ∂L/∂q + F.

    Attributes:
        q: Symbols of the coordinates, a column of n.
        v: Symbols of the velocities, a column of n.
        p: Symbols of the parameters by name.
        momentum: ∂L/∂v, a column of n.
        push: ∂L/∂q + F, a column of n.
        mass: ∂²L/∂v², n × n.
    """

    def __init__(self, system: LagrangianSystem) -> None:
        with extra_named():
            import sympy

        n = system.coordinates
        q = sympy.Matrix(sympy.symbols(f"q:{n}", real=True))
        v = sympy.Matrix(sympy.symbols(f"v:{n}", real=True))
        p = {name: sympy.Symbol(f"p_{name}", real=True) for name in system.parameters}
        state = (list(q), list(v), p)
        (L,) = _expressions("lagrangian", lambda: [system.lagrangian(*state)], p)
        momentum = sympy.Matrix([L.diff(x) for x in v])
        push = sympy.Matrix([L.diff(x) for x in q])
        if force := system.force:
            push += sympy.Matrix(_expressions("force", lambda: force(*state), p, n))
        self.q = q
        self.v = v
        self.p = p
        self.momentum = momentum
        self.push = push
        self.mass = momentum.jacobian(v)

    def velocity(self, momentum: Matrix) -> Matrix:
        """Return the velocities that give a column of momenta, which are linear in them."""
        at_rest = self.momentum.subs({x: 0 for x in self.v})
        return self.mass.LUsolve(momentum - at_rest)


def _expressions(
    name: str, values: Callable[[], Any], parameters: Named, count: int = 1
) -> list[Expr]:
    """Return the SymPy expressions that a function of the user gives for symbols.

    Args:
        name: What the function is of, for the message.
        values: Calls the function with symbols of coordinates, velocities and parameters, and
            returns a sequence of expressions or numbers.
        parameters: Symbols of the parameters by name, for the message.
        count: Number of expressions that it must give.

    Returns:
        List of `count` expressions; numbers have become expressions.

    Raises:
        RefusedError: The function gives another number of expressions, or something that is none;
            or it raises KeyError, IndexError, TypeError or AttributeError, as for an unknown name.
            Its other errors are not caught.
    """
    import sympy

    allowed = f"functions of {', '.join(parameters)} and the coordinates by arithmetic and the"
    allowed += " smooth functions of SymPy"
    # The function is the user's: names that it asks for and operations that symbols do not have are
    # refused with what it may use. Other errors are its own, and are not caught.
    try:
        expressions = [sympy.sympify(value) for value in values()]
    except (KeyError, IndexError, TypeError, AttributeError, sympy.SympifyError) as failure:
        raise RefusedError(name, repr(failure), allowed) from None
    fits = len(expressions) == count and all(isinstance(value, sympy.Expr) for value in expressions)
    require(fits, name, value=expressions, allowed=f"{count} by coordinate, {allowed}")
    return expressions


def pendulum(
    *,
    mass: float = 1.0,
    length: float = 1.0,
    damping: float = 0.1,
    gravity: float = 9.81,
    phi0: float = 1.5,
    omega0: float = 0.0,
) -> LagrangianSystem:
    """Return a damped pendulum, L = m l² φ̇²/2 + m g l cos φ, under the moment -d φ̇.

    Its parameters are named "m", "l", "d", "g", "phi_0" and "omega_0". Its outputs are "force", the
    tension m l φ̇² + m g cos φ of the bar in N, and "phi", the angle φ in rad from the lowest
    position.

    Args:
        mass: m in kg, above 0.
        length: l in m, above 0.
        damping: d in N m s/rad, not below 0.
        gravity: g in m/s², above 0.
        phi0: Initial angle in rad.
        omega0: Initial angular velocity in rad/s.

    Raises:
        RefusedError: An argument is no such number.

    Example:
        >>> pendulum(length=2.0).outputs
        ('force', 'phi')
    """
    for name, value in {"mass": mass, "length": length, "gravity": gravity}.items():
        checked_number(name, value, positive=True)
    checked_number("damping", damping, least=0)
    return LagrangianSystem(
        coordinates=1,
        parameters=dict(m=mass, l=length, d=damping, g=gravity, phi_0=phi0, omega_0=omega0),
        lagrangian=_lagrangian,
        initial=_initial,
        observed={"force": _bar_force, "phi": _angle},
        force=_moment,
    )


def _lagrangian(q: Symbols, v: Symbols, p: Named) -> Expr:
    from sympy import cos

    return p["m"] * p["l"] ** 2 * v[0] ** 2 / 2 + p["m"] * p["g"] * p["l"] * cos(q[0])


def _initial(p: Named) -> tuple[Symbols, Symbols]:
    return [p["phi_0"]], [p["omega_0"]]


def _bar_force(q: Symbols, v: Symbols, p: Named) -> Expr:
    from sympy import cos

    return p["m"] * p["l"] * v[0] ** 2 + p["m"] * p["g"] * cos(q[0])


def _angle(q: Symbols, v: Symbols, p: Named) -> Expr:
    return q[0]


def _moment(q: Symbols, v: Symbols, p: Named) -> Symbols:
    return [-p["d"] * v[0]]
