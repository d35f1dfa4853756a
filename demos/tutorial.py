# ---
# jupytext:
#   text_representation: {extension: .py, format_name: percent}
# kernelspec: {display_name: Python 3, language: python, name: python3}
# ---

# %% [markdown]
# # Tutorial: the paper's chain
#
# From an uncertain radius to the envelope of a frame, in five steps. Each step is one call. Run
# it with `./enter python demos/tutorial.py`; it takes a minute.
#
# ## 1. The random radius
#
# The cell has one round particle of random radius. Its radius is a cubic map of a standard normal
# θ, cut at ±3 (eq. 12). The two slopes of the map are fuzzy.

# %%
import numpy as np

from alphacut.fuzzy import Triangular, propagate
from alphacut.rve import Phase, SeriesModel
from alphacut.stochastic import HermiteMap, gauss_rule

radius = HermiteMap(0.1337, 0.1, 0.8663, 0.1692)
rule = gauss_rule(radius.distribution, points=8)
print(f"area fraction {rule.mean(np.pi / 4 * radius(rule.nodes) ** 2):.4f}")

# %% [markdown]
# The particles themselves, and the map that follows from them, are the first stage of
# `cases/concrete.toml`.
#
# ## 2. The cell
#
# One crisp cell: matrix of 20 GPa, particle of 80 GPa. The series is exact; `PrismModel()`
# is the paper's finite element on the product of cell and θ.

# %%
series = SeriesModel()
matrix = Phase(20e9, 0.3)
cell = series.solve(radius, matrix, [Phase(80e9, 0.3)])[0]
print(f"E = {cell.modulus / 1e9:.4f} GPa (paper: 24.7561 GPa)")

# %% [markdown]
# ## 3. The fuzzy modulus
#
# Three inputs are fuzzy. A triangle has its support and its most plausible value. `propagate`
# finds the range of E at every level, and says what the bounds are worth.

# %%
inputs = {
    "a2": Triangular(0.001, 0.1, 0.3145),
    "a4": Triangular(0.001, 0.1692, 0.9975),
    "E_i": Triangular(75e9, 80e9, 85e9),
}


def modulus(a2: float, a4: float, E_i: float) -> float:
    """E of eq. 16, in Pa."""
    map_ = HermiteMap(0.1337, a2, 0.8663, a4)
    return series.solve(map_, matrix, [Phase(E_i, 0.3)])[0].modulus


E = propagate(modulus, inputs, progress=False)
print(E)

# %% [markdown]
# ## 4. The frame
#
# The paper's frame has three storeys. Masses are fuzzy too. The envelope holds every motion that
# is possible at each level. Linear structures with few inputs are proved.

# %%
from alphacut.frame import StoreyFrame, envelope

frame = StoreyFrame(
    masses=(20e3, 10e3, 5e3),
    lengths=(2.5, 2.7, 2.7),
    modulus=24.7561e9,
    second_moment=1e-6,
    dampers=(50.0, 50.0, 50.0),
    damper_placement="ground",
    q0=(0.01, 0.03, 0.08),
    v0=(0.0, -0.5, -0.5),
)
fuzzy = {"E": E.number(), "m1": Triangular(19e3, 20e3, 21e3)}
motion = envelope(frame, fuzzy, duration=5.0, step=0.01, progress=False)
print(motion)

# %% [markdown]
# ## 5. A picture

# %%
import matplotlib.pyplot as plt

figure, axes = plt.subplots(figsize=(7.2, 3.6), layout="constrained")
for level, alpha in enumerate(motion.alpha):
    band = motion.lower[level, :, 0], motion.upper[level, :, 0]
    shade = plt.get_cmap("YlGnBu")(0.25 + 0.65 * alpha)
    axes.fill_between(motion.time, *band, color=shade, lw=0, label=f"α = {alpha:g}")
axes.set(xlabel="time (s)", ylabel="displacement of the first floor (m)")
axes.legend(loc="upper left", bbox_to_anchor=(1, 1), frameon=False)
plt.show()

# %% [markdown]
# ## All of it from a case
#
# A case file holds the same with a unit on every value. These commands run it, with every figure
# of the paper:
#
# ```console
# ./enter python -m alphacut check cases/paper.toml
# ./enter python -m alphacut run cases/paper.toml --workers 2
# ./enter python -m alphacut report results/paper
# ```
#
# ## Pitfalls
#
# - Numbers in Python are in SI units. Cases have units.
# - `print(E)` says *attained*, *estimated* or *guaranteed*. Only the last is proved.
