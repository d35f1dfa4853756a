"""Vibration of structures with fuzzy parameters.

Example:
    >>> from alphacut.frame import INTEGRATORS
    >>> sorted(INTEGRATORS)  # by the words of a case file
    ['exact', 'midpoint']
"""

from typing import TYPE_CHECKING

from alphacut.base.first_use import at_first_use

if TYPE_CHECKING:
    from alphacut.frame.analyses.angles import AnglePeaks, over_angles
    from alphacut.frame.analyses.decision import Decision, decide
    from alphacut.frame.analyses.floor_spectrum import FloorSpectrum, floor_spectrum
    from alphacut.frame.analyses.fragility import Fragility, fragility
    from alphacut.frame.analyses.incremental import ScaledPeaks, incremental
    from alphacut.frame.analyses.limits import Limit
    from alphacut.frame.analyses.peaks import Peak, peaks
    from alphacut.frame.analyses.probability import Probability, probability
    from alphacut.frame.analyses.sensitivity import Sensitivity, sensitivity
    from alphacut.frame.analyses.spectral_scaling import ScaledSuite, scale_suite
    from alphacut.frame.analyses.spectrum_accuracy import SpectrumAccuracy, spectrum_accuracy
    from alphacut.frame.analyses.spectrum_checks import (
        SpectrumChecks,
        drift_sensitivity,
        spectrum_checks,
    )
    from alphacut.frame.analyses.spectrum_response import SpectrumResponse, spectrum_response
    from alphacut.frame.analyses.static_bounds import StaticBounds, static_bounds
    from alphacut.frame.analyses.suites import SuitePeaks, over_records
    from alphacut.frame.analyses.tolerances import Tolerances, tolerances
    from alphacut.frame.calculus.unproved import UnprovedError
    from alphacut.frame.dynamics.flow import LinearFlow
    from alphacut.frame.dynamics.integrators import INTEGRATORS, Exact, Midpoint
    from alphacut.frame.dynamics.nonlinear import LagrangianFlow
    from alphacut.frame.identification.cover import learned_envelope
    from alphacut.frame.identification.identify import Identified, RefutedError, identify
    from alphacut.frame.identification.learned import LearnedInputs, Prediction, Predictions
    from alphacut.frame.identification.modes import MeasuredMode, measured_mode
    from alphacut.frame.identification.read_modes import read_modes
    from alphacut.frame.methods.auto import Auto
    from alphacut.frame.methods.dual import DualProof
    from alphacut.frame.methods.graph_follower import GraphFollower
    from alphacut.frame.methods.improved_follower import ImprovedFollower
    from alphacut.frame.methods.method import METHODS
    from alphacut.frame.methods.proof import Proof
    from alphacut.frame.methods.sampled import Sampled
    from alphacut.frame.propagation import envelope, require_envelope
    from alphacut.frame.records.history import Accelerogram, History
    from alphacut.frame.records.suite import read_record, read_suite
    from alphacut.frame.result import Envelope
    from alphacut.frame.spectra.asce7 import asce7_multi_period, asce7_two_period
    from alphacut.frame.spectra.eurocode8 import eurocode8_spectrum
    from alphacut.frame.spectra.response_spectrum import (
        RotatedSpectra,
        record_spectrum,
        response_spectrum,
        rotated_spectra,
        spectral_acceleration,
    )
    from alphacut.frame.spectra.target import TargetSpectrum, read_spectrum
    from alphacut.frame.structures.affine import affine_terms
    from alphacut.frame.structures.isolator import BilinearIsolator
    from alphacut.frame.structures.lagrangian import LagrangianSystem, pendulum
    from alphacut.frame.structures.loads import Force
    from alphacut.frame.structures.material_damping import damping_from_loss
    from alphacut.frame.structures.matrix import MatrixStructure
    from alphacut.frame.structures.quantities import Output, Parameter
    from alphacut.frame.structures.read_matrix import read_matrix, read_unknowns
    from alphacut.frame.structures.storey import StoreyFrame

__all__ = [
    "INTEGRATORS", "METHODS", "Accelerogram", "AnglePeaks", "Auto", "BilinearIsolator", "Decision",
    "DualProof", "Envelope", "Exact", "FloorSpectrum", "Force", "Fragility", "GraphFollower",
    "History", "Identified", "ImprovedFollower", "LagrangianFlow", "LagrangianSystem",
    "LearnedInputs", "Limit", "LinearFlow", "MatrixStructure", "MeasuredMode", "Midpoint", "Output",
    "Parameter", "Peak", "Prediction", "Predictions", "Probability", "Proof", "RefutedError",
    "RotatedSpectra", "Sampled", "ScaledPeaks", "ScaledSuite", "Sensitivity", "SpectrumAccuracy",
    "SpectrumChecks", "SpectrumResponse", "StaticBounds", "StoreyFrame", "SuitePeaks",
    "TargetSpectrum", "Tolerances", "UnprovedError", "affine_terms", "asce7_multi_period",
    "asce7_two_period", "damping_from_loss", "decide", "drift_sensitivity", "envelope",
    "eurocode8_spectrum", "floor_spectrum", "fragility", "identify", "incremental",
    "learned_envelope", "measured_mode", "over_angles", "over_records", "peaks", "pendulum",
    "probability", "read_matrix", "read_modes", "read_record", "read_spectrum", "read_suite",
    "read_unknowns", "record_spectrum", "require_envelope", "response_spectrum", "rotated_spectra",
    "scale_suite", "sensitivity", "spectral_acceleration", "spectrum_accuracy", "spectrum_checks",
    "spectrum_response", "static_bounds", "tolerances",
]  # fmt: skip
AT_FIRST_USE = {
    "INTEGRATORS": "dynamics.integrators",
    "METHODS": "methods.method",
    "Accelerogram": "records.history",
    "AnglePeaks": "analyses.angles",
    "Auto": "methods.auto",
    "BilinearIsolator": "structures.isolator",
    "Decision": "analyses.decision",
    "DualProof": "methods.dual",
    "Envelope": "result",
    "Exact": "dynamics.integrators",
    "FloorSpectrum": "analyses.floor_spectrum",
    "Force": "structures.loads",
    "Fragility": "analyses.fragility",
    "GraphFollower": "methods.graph_follower",
    "History": "records.history",
    "Identified": "identification.identify",
    "ImprovedFollower": "methods.improved_follower",
    "LagrangianFlow": "dynamics.nonlinear",
    "LagrangianSystem": "structures.lagrangian",
    "LearnedInputs": "identification.learned",
    "Limit": "analyses.limits",
    "LinearFlow": "dynamics.flow",
    "MatrixStructure": "structures.matrix",
    "MeasuredMode": "identification.modes",
    "Midpoint": "dynamics.integrators",
    "Output": "structures.quantities",
    "Parameter": "structures.quantities",
    "Peak": "analyses.peaks",
    "Prediction": "identification.learned",
    "Predictions": "identification.learned",
    "Probability": "analyses.probability",
    "Proof": "methods.proof",
    "RefutedError": "identification.identify",
    "RotatedSpectra": "spectra.response_spectrum",
    "Sampled": "methods.sampled",
    "ScaledPeaks": "analyses.incremental",
    "ScaledSuite": "analyses.spectral_scaling",
    "Sensitivity": "analyses.sensitivity",
    "SpectrumAccuracy": "analyses.spectrum_accuracy",
    "SpectrumChecks": "analyses.spectrum_checks",
    "SpectrumResponse": "analyses.spectrum_response",
    "StaticBounds": "analyses.static_bounds",
    "StoreyFrame": "structures.storey",
    "SuitePeaks": "analyses.suites",
    "TargetSpectrum": "spectra.target",
    "Tolerances": "analyses.tolerances",
    "UnprovedError": "calculus.unproved",
    "affine_terms": "structures.affine",
    "asce7_multi_period": "spectra.asce7",
    "asce7_two_period": "spectra.asce7",
    "damping_from_loss": "structures.material_damping",
    "decide": "analyses.decision",
    "drift_sensitivity": "analyses.spectrum_checks",
    "envelope": "propagation",
    "eurocode8_spectrum": "spectra.eurocode8",
    "floor_spectrum": "analyses.floor_spectrum",
    "fragility": "analyses.fragility",
    "identify": "identification.identify",
    "incremental": "analyses.incremental",
    "learned_envelope": "identification.cover",
    "measured_mode": "identification.modes",
    "over_angles": "analyses.angles",
    "over_records": "analyses.suites",
    "peaks": "analyses.peaks",
    "pendulum": "structures.lagrangian",
    "probability": "analyses.probability",
    "read_matrix": "structures.read_matrix",
    "read_modes": "identification.read_modes",
    "read_record": "records.suite",
    "read_spectrum": "spectra.target",
    "read_suite": "records.suite",
    "read_unknowns": "structures.read_matrix",
    "record_spectrum": "spectra.response_spectrum",
    "require_envelope": "propagation",
    "response_spectrum": "spectra.response_spectrum",
    "rotated_spectra": "spectra.response_spectrum",
    "scale_suite": "analyses.spectral_scaling",
    "sensitivity": "analyses.sensitivity",
    "spectral_acceleration": "spectra.response_spectrum",
    "spectrum_accuracy": "analyses.spectrum_accuracy",
    "spectrum_checks": "analyses.spectrum_checks",
    "spectrum_response": "analyses.spectrum_response",
    "static_bounds": "analyses.static_bounds",
    "tolerances": "analyses.tolerances",
}
"""Module of each exported name, which is imported at its first use: all of them take .1 s."""

__getattr__, __dir__ = at_first_use(__name__, AT_FIRST_USE)
