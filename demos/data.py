# ---
# jupytext:
#   text_representation: {extension: .py, format_name: percent}
# kernelspec: {display_name: Python 3, language: python, name: python3}
# ---

# %% [markdown]
# # Fuzzy numbers from data
#
# **Goal.** A fuzzy number whose cuts hold the truth as often as they say, and a joint claim of
# several.
#
# Twelve measured stiffnesses. The cut at α holds the mean with probability 1 − α at least, if the
# values are normal.

# %%
import numpy as np

from alphacut.fuzzy import from_data, jointly, propagate

rng = np.random.default_rng(1)
stiffness = from_data(2e6 * (1 + 0.05 * rng.standard_normal(12)), "mean", law="normal")
print(stiffness)
print("α = 0.05:", stiffness.cut(0.05))

# %% [markdown]
# ## Does it hold?
#
# Draw the data anew a thousand times, and count the cuts that hold the true mean.

# %%
held = 0
for _ in range(1000):
    low, high = from_data(rng.normal(2e6, 1e5, 12), "mean", law="normal").cut(0.05)
    held += low <= 2e6 <= high
print(f"{held / 10:.1f} % of the cuts hold the mean; 95 % are claimed")

# %% [markdown]
# ## Several quantities
#
# Two cuts of 95 % do not hold together with 95 %. `jointly` lowers the levels so that they do.
# `propagate` does so by itself.

# %%
length = from_data(2.0 + 0.004 * rng.standard_normal(8), "mean", law="normal")
both = jointly({"stiffness": stiffness, "length": length})
print(both["stiffness"].cut(0.05))


def deflection(length: float, stiffness: float) -> float:
    """Tip of a cantilever under 1 kN, in m."""
    return 1000 * length**3 / (3 * stiffness)


print(propagate(deflection, both, alpha=(0.05, 0.5, 1.0), progress=False))

# %% [markdown]
# ## Pitfalls
#
# - Below the level that the data decide nothing is claimed. `cut` refuses such levels.
# - A mean is not a quantile. For the scatter of single pieces take `from_data(values,
#   "quantile 0.9")`.
