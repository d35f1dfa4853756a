"""The fuzzy stiffness of a cell: its constants and loss factors over α-cuts of fuzzy inputs.

Inputs are parameters of the radius map (a1 … a4, or fraction), Young's moduli and Poisson's ratios
of the phases (matrix_modulus, inclusion_poisson; of the user's own mesh NAME_modulus), and their
loss factors (matrix_loss). Loss factors are no coordinates of the samples: those of the cell are
linear in them to first order, so that each sample gives the bounds over all of their α-cuts.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from typing import TYPE_CHECKING, Any, Unpack, cast

import numpy as np

from alphacut.base.arrays import Array, on_one_blas_thread
from alphacut.base.errors import FailedError, checked_number, require, require_choice
from alphacut.base.extras import extra_named
from alphacut.fuzzy import Crisp, FuzzyNumber, Knowledge
from alphacut.fuzzy.result import Bounds, Ends, Nature
from alphacut.fuzzy.sets.boxes import levels
from alphacut.fuzzy.sets.claimed import widest_cut
from alphacut.fuzzy.sets.numbers import Cut, fuzzy_number
from alphacut.rve.cell.cell import AnyPhase, Phase, Phases
from alphacut.rve.result.cell_model import AnyModel
from alphacut.rve.result.engineering_constants import (
    FREE,
    NAMES,
    PLANE_STRAIN,
    engineering_constants,
)
from alphacut.rve.result.loss_factors import (
    CONSTANTS,
    MAX_FIRST_ORDER,
    loss_factors,
    phase_loss_cuts,
)
from alphacut.rve.result.moduli import AVERAGES, require_average
from alphacut.rve.result.result import HomogenisedStiffness
from alphacut.rve.series.fibre_constants import fibre_constants
from alphacut.stochastic import RadiusMap, ThetaDistribution
from alphacut.stochastic.theta.quadrature import between_nodes

if TYPE_CHECKING:
    import xarray

    from alphacut.fuzzy.plans.design import Plan
    from alphacut.fuzzy.propagation import CampaignOptions

SUFFIXES = {PLANE_STRAIN: "", FREE: "_free"}
"""What is added to the name of a constant along x and y, by its definition."""
FIBRES = ("E_T", "E_L", "nu_LT", "G_T", "G_L")
"""Constants across (T) and along (L) the fibres; see `fibre_constants`."""
QUANTITIES = (
    "E",
    "nu",
    "s11",
    "s12",
    "E_T",
    "E_L",
    "nu_LT",
    "G_T",
    "G_L",
    "E_x",
    "E_y",
    "nu_xy",
    "G_xy",
    "E_x_free",
    "E_y_free",
    "nu_xy_free",
    "G_xy_free",
)
"""Outputs with α-cuts: moduli and stresses in Pa; s11 and s12 are mean stresses, eq. 15."""


@dataclass(frozen=True, eq=False, kw_only=True)
class LossCuts:
    """α-cuts of the loss factors of E, G and K.

    Args:
        E: Lower and upper bounds of that of Young's modulus, shape (levels,) each.
        G: Bounds of that of the shear modulus.
        K: Bounds of that of the bulk modulus.
        error: Their declared absolute errors by name; empty where none are declared.
        nature: Guarantee of the bounds.
    """

    E: Ends
    G: Ends
    K: Ends
    error: dict[str, float]
    nature: Nature

    @property
    def cuts(self) -> dict[str, Array]:
        """Lower and upper bounds by the names of `CONSTANTS`, shape (levels, 2) each."""
        return {name: np.stack(getattr(self, name), axis=1) for name in CONSTANTS}


@dataclass(frozen=True, eq=False)
class FuzzyStiffness:
    """Fuzzy homogenised constants of a cell, with their errors and samples.

    Args:
        bounds: Of the outputs `QUANTITIES` in SI, of those that the model gives, with samples.
        theta: Values of θ at which the stress curves of the samples are kept, shape (points,).
        average: Name of the average of the stiffness that E and ν are of.
        model: Name of the model.
        error: Declared relative error of E by source.
        checks: Largest violation of each property that right results have, by name.
        losses: Loss factors; None where the phases have none.
    """

    bounds: Bounds
    theta: Array
    average: str
    model: str
    error: Mapping[str, float]
    checks: Mapping[str, float]
    losses: LossCuts | None

    @property
    def modulus(self) -> FuzzyNumber:
        """Fuzzy Young's modulus E in Pa; between two levels the wider α-cut holds."""
        return fuzzy_number(self.bounds.alpha, self.cuts("E"))

    @property
    def loss_factor(self) -> FuzzyNumber | None:
        """Fuzzy loss factor of E; None where the phases have none."""
        if self.losses is None:
            return None
        return fuzzy_number(self.bounds.alpha, self.losses.cuts["E"])

    @property
    def guarantee(self) -> Nature:
        """What the bounds of E promise; those of all other constants are attained."""
        return self.bounds.nature_of("E")

    def cuts(self, name: str) -> Array:
        """Return lower and upper bounds of one of `QUANTITIES` in SI, shape (levels, 2)."""
        return np.stack(self.bounds.bounds(name), axis=1)

    @property
    def constants(self) -> tuple[str, ...]:
        """Names of those `QUANTITIES` that the model gives."""
        return tuple(name for name in QUANTITIES if name in self.bounds.outputs)

    @property
    def systems(self) -> int:
        """Number of linear systems that were solved for the samples."""
        return int(self._samples("systems").sum())

    @property
    def curve_error(self) -> float:
        """Declared relative error of the samples' stress at a single θ, beside that of means.

        It is that of samples which share solutions: their means are far more accurate than their
        stress at a single θ, see `modulus_basis`. 0 where each sample is solved by itself.
        """
        return float(self._samples("curve_error").max())

    def _samples(self, output: str) -> Array:
        """Return an output of `CellSamples` at all samples, shape (samples, …)."""
        assert self.bounds.samples is not None
        return self.bounds.samples.values.output(output)

    def __str__(self) -> str:
        """Return a text of some lines without a newline at the end.

        The first two have the model, the number of samples, the time in s, the average and the
        relative error of E. Then follows a line for each constant and loss factor with its α-cuts
        on the first and the last level, in SI, and their guarantee.
        """
        error = f"{sum(self.error.values()):.1e}" if self.error else "not declared"
        lines = [
            f"fuzzy stiffness by {self.model}: {self.bounds.evaluations} samples,"
            f" {self.bounds.seconds:.2g} s; E and ν of {self.average}",
            f"relative error of E: {error}",
        ]
        for name in self.constants:
            lines.append(self._cut_text(name, self.cuts(name), self.bounds.nature_of(name)))
        for name, cuts in self._loss_cuts.items():
            lines.append(self._cut_text(f"loss factor of {name}", cuts, Nature.ATTAINED))
        return "\n".join(lines)

    def _cut_text(self, name: str, cuts: Array, guarantee: Nature) -> str:
        """Return a line with a constant's cuts on the first and last level, and their guarantee.

        Args:
            name: Name at the beginning of the line.
            cuts: Lower and upper bounds at rising levels, shape (levels, 2), in SI.
            guarantee: Written in brackets at the end.
        """
        first, last = self.bounds.alpha[[0, -1]]
        widest, narrowest = cuts[0], cuts[-1]
        return (
            f"{name}: α = {first:g}: {widest[0]:.6g} … {widest[1]:.6g};"
            f" α = {last:g}: {narrowest[0]:.6g} … {narrowest[1]:.6g} ({guarantee})"
        )

    @property
    def _loss_cuts(self) -> dict[str, Array]:
        """α-cuts of the loss factors by name, shape (levels, 2) each; empty for none."""
        return {} if self.losses is None else self.losses.cuts

    __repr__ = __str__

    def to_csv(self, path: str) -> None:
        """Write a CSV file with a row for each constant and each α-level.

        The columns are constant, alpha, lower and upper (bounds in SI: moduli and stresses in Pa)
        and guarantee. Loss factors are not written.

        Args:
            path: Name of the file, which is replaced; an OSError if it cannot be written.
        """
        lines = ["constant,alpha,lower,upper,guarantee"]
        for name in self.constants:
            guarantee = self.bounds.nature_of(name)
            lower, upper = self.bounds.bounds(name)
            for level, alpha in enumerate(self.bounds.alpha):
                ends = f"{float(lower[level])!r},{float(upper[level])!r}"
                lines.append(f"{name},{alpha:g},{ends},{guarantee}")
        with open(path, "w", encoding="utf-8") as file:
            file.write("\n".join(lines) + "\n")

    def to_dataset(self) -> xarray.Dataset:
        """Return a dataset in SI of α-cuts, of the inputs that reach them, and of the samples.

        Returns:
            Dataset with, for each constant NAME, the variables NAME, bounds of shape (alpha,
            bound); NAME_at, the inputs at which they are attained, shape (alpha, bound, parameter);
            and NAME_sample, its values at all samples. Then loss_NAME, shape (alpha, bound), where
            phases have loss factors; `point`, the inputs of the samples, shape (sample, parameter);
            and `curve11`, their stresses σ11 over θ, shape (sample, theta), whose attribute
            "relative_error" is the error of a stress at a single θ.

        Raises:
            MissingLibraryError: xarray is not installed.
        """
        with extra_named():
            import xarray

        bounds = self.bounds
        assert bounds.samples is not None
        cut = ("alpha", "bound")
        variables: dict[str, Any] = {}
        for name in self.constants:
            units = {"units": "1" if name.startswith("nu") else "Pa"}
            column = bounds.column(name)
            points = np.stack([bounds.lower_at[:, column], bounds.upper_at[:, column]], axis=1)
            variables[name] = (cut, self.cuts(name), units)
            variables[f"{name}_at"] = ((*cut, "parameter"), points)
            variables[f"{name}_sample"] = ("sample", self._samples(name), units)
        for name, loss_cuts in self._loss_cuts.items():
            variables[f"loss_{name}"] = (cut, loss_cuts)
        variables["point"] = (("sample", "parameter"), bounds.samples.points)
        of_curves = {"units": "Pa", "relative_error": self.curve_error}
        variables["curve11"] = (("sample", "theta"), self._samples("curve11"), of_curves)
        coordinates = {
            "theta": self.theta,
            "alpha": bounds.alpha,
            "bound": ["lower", "upper"],
            "parameter": list(bounds.inputs),
        }
        return xarray.Dataset(variables, coordinates)


def fuzzy_stiffness(
    model: AnyModel,
    radius: RadiusMap | ThetaDistribution,
    phases: Phases,
    inputs: Mapping[str, FuzzyNumber | float],
    method: Plan | None = None,
    *,
    alpha: Sequence[float] | None = None,
    average: str | None = None,
    **campaign: Unpack[CampaignOptions],
) -> FuzzyStiffness:
    """Return the α-cuts of the homogenised constants of a cell with fuzzy inputs.

    Samples that differ in the particle's Young's modulus alone share a mesh. A model whose declared
    errors take a reference solution declares them at the nominal inputs alone. Where mechanics
    proves the signs of all inputs' effects on E, and `method` uses them, the bounds of E are
    guaranteed, and are tested by a coarser model.

    Args:
        model: A model of the cell, such as `PrismModel()`.
        radius: Radius map at the nominal inputs; of the user's own mesh the law of θ.
        phases: Phases at the nominal inputs.
        inputs: Fuzzy numbers in SI by the names of parameters: fields of the radius map, and of
            phase NAME ("matrix", "inclusion") NAME_modulus, NAME_poisson and NAME_loss.
        method: Plan of the samples; `General()` if not given.
        alpha: Rising levels; 0, ¼, ½, ¾, 1 if not given.
        average: Average of a plane stiffness that E and ν are of, "axes" (eq. 16) or "isotropic";
            that of the model's results if not given. Of spheres it is Hill's average in space,
            whatever is given.
        campaign: Further arguments of `propagate`: workers, executor, store, identity, progress.

    Returns:
        FuzzyStiffness: E as the fuzzy number `modulus`, the α-cuts of all `constants` in `cuts`,
        their `guarantee` and declared `error`, and `bounds`, the samples of the campaign.

    Raises:
        RefusedError: An input is no parameter, or a value is not allowed.
        CampaignError: Samples failed; the others are in the store.
        FailedError: A coarser model contradicts guaranteed bounds.

    Example:
        >>> from alphacut.fuzzy import Triangular
        >>> from alphacut.rve import Phase, SeriesModel
        >>> from alphacut.stochastic import HermiteMap
        >>> phases = [Phase(20e9), Phase(80e9)]
        >>> inputs = {"inclusion_modulus": Triangular(75e9, 80e9, 85e9)}
        >>> radius = HermiteMap(0.2, 0.1, 0.6, 0.1)
        >>> found = fuzzy_stiffness(SeriesModel(), radius, phases, inputs, progress=False)
        >>> [f"{end / 1e9:.2f} GPa" for end in found.modulus.cut(0)]
        ['22.69 GPa', '22.85 GPa']
    """
    # Plans of samples take time to import, and an image has none.
    from alphacut.fuzzy import General, propagate

    if average is not None:
        require_average(average)
    cell = FuzzyCell.of(radius, phases, inputs)
    alpha_levels = tuple(levels(4) if alpha is None else alpha)
    loss_cuts = cell.loss_cuts(alpha_levels)
    # Models may solve for a few moduli of the particle and interpolate between them; so they are
    # told the range.
    modulus = cell.inputs.get("inclusion_modulus")
    sample_model = model.for_samples(
        None if modulus is None else widest_cut(modulus), energies=loss_cuts is not None
    )
    function = CellSamples(sample_model, cell, average=average, loss_cuts=loss_cuts)
    # Samples that are alike in these inputs differ in the particle's modulus alone, and share a
    # mesh.
    shared = tuple(name for name in cell.inputs if name != "inclusion_modulus")
    bounds = propagate(
        function,
        cell.inputs,
        method or General(),
        alpha=alpha_levels,
        shared=shared or tuple(cell.inputs),
        knowledge=proved_signs(model, cell),
        **campaign,
    )
    # A reference solution costs more than a sample: one at the nominal inputs stands for all.
    reference = None
    if model.errors_by_reference:
        reference = replace(function, model=model).solve([cell.nominal])[0]
    error = _errors_of_modulus(bounds, reference)
    losses = None
    if loss_cuts is not None:
        losses = _cuts_of_losses(bounds, reference, loss_cuts, has_particle=cell.has_particle)
    if bounds.nature_of("E") is Nature.GUARANTEED:
        # A proof is tested by solutions of another resolution.
        coarse = replace(function, model=sample_model.coarser())
        require_consistent(bounds, coarse, error=sum(error.values()))
    words = model.convention
    # Spheres have Hill's average in space, whatever average of a plane stiffness is asked for.
    if average is not None and words in AVERAGES.values():
        words = AVERAGES[average]
    return FuzzyStiffness(
        bounds=bounds,
        theta=function.theta,
        average=words,
        model=model.name,
        error=error,
        checks=_largest_by_name(bounds, kind="check"),
        losses=losses,
    )


@dataclass(frozen=True)
class FuzzyCell:
    """A cell at nominal values, and the fuzzy numbers of its parameters.

    Args:
        radius: Radius map, or law of θ, at the nominal values.
        phases: Phases by name at the nominal values: "matrix" and "inclusion", or those of a mesh.
        inputs: Fuzzy numbers in SI of the parameters that samples differ in, one at least.
        losses: Loss factors of the phases, in their order; empty for none.
        has_particle: Whether the phases are matrix and particle, as most models take them.
    """

    radius: RadiusMap | ThetaDistribution
    phases: Mapping[str, AnyPhase]
    inputs: Mapping[str, FuzzyNumber]
    losses: tuple[FuzzyNumber, ...]
    has_particle: bool

    @classmethod
    def of(
        cls,
        radius: RadiusMap | ThetaDistribution,
        phases: Phases,
        inputs: Mapping[str, FuzzyNumber | float],
    ) -> FuzzyCell:
        """Return the cell with fuzzy inputs that the arguments of `fuzzy_stiffness` describe.

        Args:
            radius: Radius map over θ at the nominal inputs; of the user's own mesh the distribution
                of θ.
            phases: Matrix and inclusion at the nominal inputs, or a mapping from names to phases of
                a mesh.
            inputs: Numbers or fuzzy numbers in SI by the names of parameters: the float fields of
                `radius`, and NAME_modulus, NAME_poisson and NAME_loss of phase NAME.

        Returns:
            Cell whose `inputs` are all but the loss factors, or a crisp "unchanged" if there are no
            others, since a campaign needs one; and whose `losses` are those of all phases in their
            order, by `inputs` or else as the phase states, and empty if all are 0.

        Raises:
            RefusedError: An input is no parameter of the radius or of a phase, or no finite number,
                a loss factor may be negative, or phases without names are not two.
        """
        named = _phases_by_name(phases)
        parameters = _parameters(radius, named)
        numbers: dict[str, FuzzyNumber] = {}
        for name, number in inputs.items():
            require_choice("input", name, parameters)
            if isinstance(number, FuzzyNumber):
                numbers[name] = number
            else:
                numbers[name] = Crisp(checked_number(name, number))
            low = widest_cut(numbers[name]).lower
            is_allowed = low >= 0 or not name.endswith("_loss")
            require(is_allowed, name, value=f"from {low:g}", allowed="loss factors of 0 or more")

        # Loss factors are no coordinates of the samples: the stiffness does not depend on them, and
        # those of the cell are linear in them. A campaign needs one input at least.
        sampled = {name: x for name, x in numbers.items() if not name.endswith("_loss")}
        if not sampled:
            sampled = {"unchanged": Crisp(1.0)}
        losses = []
        for name, phase in named.items():
            stated = Crisp(phase.loss or 0.0)
            losses.append(numbers.get(f"{name}_loss", stated))
        if not any(widest_cut(number).upper > 0 for number in losses):
            losses = []
        has_particle = not isinstance(phases, Mapping)
        return cls(radius, named, sampled, tuple(losses), has_particle)

    @property
    def nominal(self) -> dict[str, float]:
        """Nominal values of the inputs."""
        return {name: number.nominal for name, number in self.inputs.items()}

    def loss_cuts(self, alpha: Sequence[float]) -> Array | None:
        """Return α-cuts of the phases' loss factors, shape (levels, 2, phases); None for none."""
        if not self.losses:
            return None
        return phase_loss_cuts(self.losses, alpha)

    def radius_at(self, values: Mapping[str, float]) -> RadiusMap | ThetaDistribution:
        """Return the radius map, or the distribution of θ, at values of the inputs."""
        names = _field_names(self.radius)
        changes = {name: x for name, x in values.items() if name in names}
        if not changes:  # such as of a map that is no dataclass
            return self.radius
        return cast("RadiusMap", replace(cast("Any", self.radius), **changes))

    def phases_at(self, values: Mapping[str, float]) -> dict[str, AnyPhase]:
        """Return the phases by name, with the fields that inputs replace.

        Args:
            values: Values of the inputs in SI by name. NAME_FIELD, such as matrix_modulus, is the
                field FIELD of the phase NAME; other inputs are ignored, and fields without one stay
                nominal.
        """
        found = {}
        for name, phase in self.phases.items():
            inputs = {field: f"{name}_{field}" for field in _field_names(phase)}
            changes = {field: values[x] for field, x in inputs.items() if x in values}
            found[name] = replace(cast("Any", phase), **changes)
        return found

    def support(self, name: str) -> Cut:
        """Return the smallest and the largest value of a phase's parameter, fuzzy or not.

        For a fuzzy number from measured values they are the ends of the widest cut that the values
        determine.
        """
        if name in self.inputs:
            return widest_cut(self.inputs[name])
        phase, _, parameter = name.partition("_")
        value = getattr(self.phases[phase], parameter)
        return Cut(value, value)


def _phases_by_name(phases: Phases) -> dict[str, AnyPhase]:
    """Return phases by name, "matrix" and "inclusion" where they have none."""
    if isinstance(phases, Mapping):
        return dict(phases)
    require(len(phases) == 2, "phases", value=len(phases), allowed="matrix and inclusion")
    matrix, inclusion = phases
    return {"matrix": matrix, "inclusion": inclusion}


def _field_names(value: object) -> tuple[str, ...]:
    """Return the names of a dataclass's fields; none of another object."""
    if not is_dataclass(value):
        return ()
    return tuple(field.name for field in fields(value))


def _parameters(radius: object, phases: Mapping[str, AnyPhase]) -> tuple[str, ...]:
    """Return the names that inputs may have: numbers of the radius, and NAME_FIELD of phases."""
    names = [name for name in _field_names(radius) if isinstance(getattr(radius, name), float)]
    for name, phase in phases.items():
        has = _field_names(phase)
        names += [f"{name}_{x}" for x in ("modulus", "poisson", "loss") if x in has]
    return tuple(names)


@dataclass(frozen=True, eq=False)
class CellSamples:
    """The function from points of the fuzzy inputs to the outputs of the cell, in SI.

    Args:
        model: Model of the cell.
        cell: The cell and its fuzzy inputs.
        average: As that of `fuzzy_stiffness`.
        loss_cuts: α-cuts of the phases' loss factors, shape (levels, 2, phases), if any.
    """

    model: Any
    cell: FuzzyCell
    average: str | None
    loss_cuts: Array | None

    @property
    def theta(self) -> Array:
        """Values of θ at which stress curves are kept, shape (61,)."""
        # On a mesh of the user's own the radius map is replaced by the distribution of θ itself.
        distribution: Any = getattr(self.cell.radius, "distribution", self.cell.radius)
        return np.asarray(np.linspace(distribution.lower, distribution.upper, 61))

    def solve(self, points: Sequence[Mapping[str, float]]) -> list[HomogenisedStiffness]:
        """Return the results of the cell at some points of the fuzzy inputs, in their order.

        Args:
            points: Values of the inputs in SI by name, one point at least. They differ in the
                Young's modulus of the particle alone, so that matrix and radius are those of the
                first point.

        Raises:
            RefusedError: The model refuses the phases or the radius, or the results lack what the
                average needs.
            FailedError: The model does not reach its accuracy.
        """
        cells = [self.cell.phases_at(point) for point in points]
        radius = self.cell.radius_at(points[0])
        if self.cell.has_particle:
            inclusions = [phases["inclusion"] for phases in cells]
            results = self.model.solve(radius, cells[0]["matrix"], inclusions)
        else:
            results = [self.model.solve(radius, phases)[0] for phases in cells]
        if self.average is None:
            return list(results)
        return [result.with_average(self.average) for result in results]

    @on_one_blas_thread
    def __call__(self, points: Sequence[Mapping[str, float]]) -> list[dict[str, float | Array]]:
        """Return the outputs at each point by name, moduli and stresses in Pa.

        Args:
            points: Values of the inputs in SI by name, one point at least, which differ in the
                Young's modulus of the particle alone.

        Returns:
            For each point "E", "nu", the mean stresses "s11" and "s12" of the paper's eq. 15, and
            the constants across and along fibres and along x and y that the result has; "systems",
            the number of linear systems; the stress curve "curve11" over `self.theta` with the
            error "curve_error"; "error:space" and "error:theta" of E; "check:NAME"; and, with loss
            factors, "loss_lower" and "loss_upper", shape (levels, 3) for E, G, K, with
            "loss_error".

        Raises:
            FailedError: The model does not reach its accuracy, or no isotropic solid has such
                moduli.
            RefusedError: The model refuses the phases or the radius.
        """
        return [self._outputs(result) for result in self.solve(points)]

    def _outputs(self, result: HomogenisedStiffness) -> dict[str, float | Array]:
        """Return the outputs of one result by name, moduli and stresses in Pa.

        Args:
            result: Result of the cell; with strain energies where `self.loss_cuts` is set.

        Returns:
            "E", "nu", the mean stresses "s11" and "s12", and those of the constants across and
            along fibres and along x and y that the result has; "systems", the number of linear
            systems; "curve11", σ11 at `self.theta`, with "curve_error"; "error:space" and
            "error:theta", relative errors of E, 0 if not declared; "check:NAME", relative
            violations; and, if `self.loss_cuts` is set, "loss_lower" and "loss_upper", shape
            (levels, 3) for E, G and K, with "loss_error", shape (3,), 0 if not declared.

        Raises:
            FailedError: No isotropic solid has such moduli: 2 G_T exceeds 3 (C11 + C12).
        """
        require_isotropic(result)
        curve = result.curve
        s11, s12 = curve.mean
        outputs: dict[str, float | Array] = {
            "E": result.modulus,
            "nu": result.poisson,
            "s11": s11,
            "s12": s12,
        }
        if result.is_of_fibres:
            constants = fibre_constants(result).values
            outputs |= {name: constants[name] for name in FIBRES}
        outputs |= plane_constants_by_name(result)
        outputs["systems"] = len(result.iterations)
        outputs["curve11"] = between_nodes(curve.theta, curve.s11, self.theta)
        outputs["curve_error"] = curve.error
        for source in ("space", "theta"):
            outputs[f"error:{source}"] = result.error.get(source, 0.0)
        for name, violation in result.checks.items():
            outputs[f"check:{name}"] = violation
        if self.loss_cuts is not None:
            bounds, errors = loss_bounds(result, self.loss_cuts)
            outputs["loss_lower"] = bounds[:, 0]
            outputs["loss_upper"] = bounds[:, 1]
            # Arrays of samples hold no NaN: an error that is not declared is 0 here.
            outputs["loss_error"] = np.nan_to_num(errors)
        return outputs


def require_isotropic(result: HomogenisedStiffness) -> None:
    """Refuse E and ν of a cell whose stiffness no isotropic solid has."""
    if not result.has_isotropic_constants:
        value, cure = f"{result.modulus / 1e9:.4g} GPa", "take the stiffness of `alphacut cell`"
        raise FailedError(f"E would be {value}: 2 G_T exceeds 3 (C11 + C12)", cure)


def plane_constants_by_name(result: HomogenisedStiffness) -> dict[str, float]:
    """Return those constants along x and y that a result has, moduli in Pa."""
    found: dict[str, float] = {}
    for definition, constants in engineering_constants(result).items():
        names = [name + SUFFIXES[definition] for name in NAMES]
        found |= dict(zip(names, map(float, constants.values), strict=True))
    return found


def proved_signs(model: AnyModel, cell: FuzzyCell) -> Knowledge:
    """Return the signs of the inputs' effects on E where mechanics proves them, else no knowledge.

    If both phases have one crisp Poisson's ratio ν ≥ 0 and one phase is the stiffer for all values,
    more of it can only stiffen the cell. For fibres A = 2 C33 and B = C11 + C12 rise (the paper's
    eq. 16), and with them E = 3A/2 − A²/(2B); for spheres the bulk modulus and both averages of the
    shear modulus rise, and with them E. The radius Σ a_i h_i(θ) rises with a1, a2 and a3, since
    h_i ≥ 0, and falls with a4, since h4 ≤ 0 (the paper's eq. 12).

    Args:
        model: Model of the cell; only one whose errors are of rounding keeps these signs.
        cell: The cell with its fuzzy inputs.

    Returns:
        For each input of a1 … a4, fraction, matrix_modulus and inclusion_modulus that the cell has,
        1 if E rises with it and −1 if it falls; empty if a condition is not met: an inexact model,
        no particle, phases that are not isotropic, Poisson's ratios that differ, are fuzzy or
        negative, or moduli whose supports overlap.
    """
    is_isotropic = all(isinstance(phase, Phase) for phase in cell.phases.values())
    if not (model.is_exact and cell.has_particle and is_isotropic):
        return Knowledge()
    poisson = cell.support("matrix_poisson")
    is_same = poisson == cell.support("inclusion_poisson") and poisson.lower == poisson.upper
    if not is_same or poisson.lower < 0:
        return Knowledge()
    matrix = cell.support("matrix_modulus")
    inclusion = cell.support("inclusion_modulus")
    # Where both moduli are equal, more of either phase changes nothing.
    if inclusion.lower >= matrix.upper:
        effect = 1  # of more inclusion on E
    elif inclusion.upper <= matrix.lower:
        effect = -1
    else:
        return Knowledge()
    signs = {
        "a1": effect,
        "a2": effect,
        "a3": effect,
        "a4": -effect,
        "fraction": effect,
        "matrix_modulus": 1,
        "inclusion_modulus": 1,
    }
    of_inputs = {name: {"E": sign} for name, sign in signs.items() if name in cell.inputs}
    # What mechanics proves is tested at two points of each cut; signs that users state at 16.
    return Knowledge(signs=of_inputs, source="as mechanics proves of exact cells", tests=2)


def require_consistent(bounds: Bounds, coarse: CellSamples, *, error: float) -> None:
    """Require that a coarser model agrees with guaranteed cuts of E at points inside them.

    The points are the midpoints of the narrowest and of the widest cut of the inputs.

    Args:
        bounds: The cuts of E and of the inputs, at rising levels.
        coarse: Samples by the coarser model; two are solved here.
        error: Relative error of E that the cuts declare.

    Raises:
        FailedError: E at such a point lies outside a cut that contains the point by more than the
            errors of both.
    """
    cuts = np.stack(bounds.bounds("E"), axis=1)
    for alpha in bounds.alpha[[-1, 0]]:
        midpoint = {name: float(np.mean(x.cut(alpha))) for name, x in bounds.inputs.items()}
        result = coarse.solve([midpoint])[0]
        # Both models have errors: the cut by its declared one, the coarse one by its own.
        value = result.modulus
        slack = value * (error + sum(result.error.values()))
        # The point lies in the cuts of the inputs on this level and on all lower ones.
        for low, high in cuts[bounds.alpha <= alpha]:
            if not low - slack <= value <= high + slack:
                what = f"E of a cell inside a cut is {value / 1e9:.9g} GPa, the cut"
                what += f" {low / 1e9:.9g} … {high / 1e9:.9g} GPa"
                raise FailedError(f"the proof is wrong: {what}", "keep the case and report it")


def _largest_by_name(bounds: Bounds, *, kind: str) -> dict[str, float]:
    """Return the largest value over all samples of each output whose name is KIND:NAME, by NAME.

    Args:
        bounds: Bounds with their samples.
        kind: The kind, such as "check" or "error". Without outputs of this kind the result is
            empty.
    """
    assert bounds.samples is not None
    values = bounds.samples.values
    return {
        name.partition(":")[2]: float(values.output(name).max())
        for name, _ in values.layout
        if name.startswith(f"{kind}:")
    }


def _errors_of_modulus(bounds: Bounds, reference: HomogenisedStiffness | None) -> dict[str, float]:
    """Return the relative error of E by source: of the reference, else the largest of samples."""
    if reference is not None:
        return dict(reference.error)
    largest = _largest_by_name(bounds, kind="error")
    return {name: error for name, error in largest.items() if error}


def loss_bounds(result: HomogenisedStiffness, cuts: Array) -> tuple[Array, Array]:
    """Return bounds of the loss factors of E, G and K over α-cuts of the phases' loss factors.

    To first order they are linear in the phases' loss factors, so that each is extreme at ends of
    the cuts.

    Args:
        result: Result of a cell, with the strain energies of its phases.
        cuts: Lower and upper end at each α-level of each phase's loss factor, the same of its K and
            G, shape (levels, 2, phases).

    Returns:
        Lower and upper bounds, shape (levels, 2, 3), and the declared absolute errors of the upper
        bounds in the first cut, shape (3,), NaN where the model declares none; the last axis is E,
        G, K.
    """
    assert result.energies is not None
    fractions, _ = result.energies.energy_fractions(result.constants_of)  # (phases, 2, 3)

    # To first order the loss factor of a constant is the sum of those of the phases times their
    # energy fractions. So it is extreme where each phase has the end of its cut that the sign of
    # its fraction says. A fraction may be negative: E of the plane can fall where a phase becomes
    # stiffer in shear.
    slopes = fractions.sum(axis=1).T  # (constants, phases)
    lower = cuts[:, 0, np.newaxis]
    upper = cuts[:, 1, np.newaxis]
    minima = np.where(slopes >= 0, lower, upper)
    maxima = np.where(slopes >= 0, upper, lower)
    phase_losses = np.stack([minima, maxima], axis=1)  # (levels, 2, constants, phases)
    corners = np.stack([phase_losses, phase_losses], axis=-1)  # of K and of G
    errors = np.empty(len(CONSTANTS))
    for constant, name in enumerate(CONSTANTS):
        errors[constant] = loss_factors(result, corners[0, 1, constant]).errors[name]
    if corners.max() <= MAX_FIRST_ORDER:
        return np.einsum("lecpx,pxc->lec", corners, fractions), errors

    # Large loss factors are taken at the same corners, by complex moduli where the model has them.
    bounds = np.empty(corners.shape[:3])
    for level, end, constant in np.ndindex(bounds.shape):
        found = loss_factors(result, corners[level, end, constant])
        bounds[level, end, constant] = found.values[CONSTANTS[constant]]
    return bounds, errors


def _cuts_of_losses(
    bounds: Bounds,
    reference: HomogenisedStiffness | None,
    phase_cuts: Array,
    *,
    has_particle: bool,
) -> LossCuts:
    """Return the α-cuts of the loss factors of E, G and K over all samples of a campaign.

    They reach from the smallest lower bound of all samples in a cut to the largest upper one.

    Args:
        bounds: Bounds of the samples' outputs "loss_lower[level][constant]" and "loss_upper…",
            where the constants 0, 1 and 2 are E, G and K, with the samples.
        reference: Result at the nominal inputs, whose errors are declared; None to declare the
            largest errors of the samples.
        phase_cuts: α-cuts of each phase's loss factor, shape (levels, 2, phases).
        has_particle: Whether the phases are matrix and particle. On a mesh of the user's own no
            error is declared without a reference.

    Returns:
        `E`, `G` and `K`, lower and upper bounds of shape (levels,) each; `error`, their absolute
        errors by name, of the reference or else the largest of the samples, or empty; and `nature`,
        which says that the bounds are attained.
    """
    lower: Array = np.empty((len(CONSTANTS), len(bounds.alpha)))
    upper: Array = np.empty_like(lower)
    # The bounds of sample outputs are over each α-cut of the inputs; of an output that itself
    # belongs to a level only the cut of this level is used.
    for constant, level in np.ndindex(lower.shape):
        column = f"[{level}][{constant}]"
        lower[constant, level] = bounds.bounds(f"loss_lower{column}").lower[level]
        upper[constant, level] = bounds.bounds(f"loss_upper{column}").upper[level]
    cuts = {name: Ends(lower[k], upper[k]) for k, name in enumerate(CONSTANTS)}
    error: dict[str, float] = {}
    assert bounds.samples is not None
    if reference is not None:
        _, errors = loss_bounds(reference, phase_cuts)
        error = dict(zip(CONSTANTS, map(float, errors), strict=True))
    elif has_particle:
        errors = bounds.samples.values.output("loss_error").max(axis=0)
        error = dict(zip(CONSTANTS, map(float, errors), strict=True))
    return LossCuts(**cuts, error=error, nature=Nature.ATTAINED)
