"""Motion of a general Lagrangian system by an adaptive Runge–Kutta method, to test time steps with.

Dormand and Prince's method of order 8 (Hairer, Nørsett, Wanner 1993), with SymPy's own functions:
it shares neither scheme nor compiled code with the midpoint integrator that it judges.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from alphacut.frame.structures.lagrangian import LagrangianSystem
from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.refused import FailedError

RELATIVE = 1e-11
"""Error of a step as a share of the state."""


class ReferenceMotion:
    """Hamilton's equations of a system in coordinates q and momenta π.

    Args:
        system: The system.
    """

    def __init__(self, system: LagrangianSystem) -> None:
        import sympy

        eq, n = system.symbols, system.coordinates
        self.names, momenta = tuple(eq.p), sympy.Matrix(sympy.symbols(f"pi:{n}", real=True))
        velocity, (q0, v0) = eq.velocity(momenta), system.start()
        moving = dict(zip(eq.v, velocity, strict=True))
        start = dict(zip([*eq.q, *eq.v], [*q0, *v0], strict=True))
        arguments = [*eq.q, *momenta, *eq.p.values()]
        rates = [*velocity, *eq.push.subs(moving)]
        self._rates = sympy.lambdify(arguments, rates, "math")
        self._start = sympy.lambdify([*eq.p.values()], [*q0, *eq.momentum.subs(start)], "math")
        seen = [system.output(name, list(velocity)) for name in system.outputs]
        self._outputs = sympy.lambdify(arguments, seen, "math")

    def outputs(self, parameters: Mapping[str, float], times: Array) -> Array:
        """Return outputs by Dormand and Prince's method of order 8 at times from the start, (T, m).

        Raises:
            FailedError: The integration does not reach the last time.
        """
        from scipy.integrate import solve_ivp

        p = [float(parameters[name]) for name in self.names]
        start = np.array(self._start(*p), float)
        rates = np.array(self._rates(*start, *p), float)
        # sizes of the states, for the absolute tolerance
        size = np.maximum(np.abs(start), np.abs(rates) * float(times[-1]))
        found = solve_ivp(
            lambda _, state: self._rates(*state, *p),
            (float(times[0]), float(times[-1])),
            start,
            method="DOP853",
            t_eval=times,
            rtol=RELATIVE,
            atol=RELATIVE * np.where(size > 0, size, size.max() or 1.0),
        )
        if not found.success:
            raise FailedError(f"the reference motion: {found.message}")
        return np.array([self._outputs(*state, *p) for state in found.y.T], float)
