# ---
# jupytext:
#   text_representation: {extension: .py, format_name: percent}
# kernelspec: {display_name: Python 3, language: python, name: python3}
# ---

# %% [markdown]
# # A function of your own
#
# **Goal.** The fuzzy result of any Python function, in ten lines.

# %%
from alphacut.fuzzy import Interval, Triangular, propagate


def deflection(load: float, length: float, stiffness: float) -> float:
    """Tip of a cantilever, in m."""
    return load * length**3 / (3 * stiffness)


inputs = {
    "load": Triangular(900, 1000, 1200),
    "length": Interval(1.99, 2.01),
    "stiffness": Triangular(1.8e6, 2e6, 2.1e6),
}
bounds = propagate(deflection, inputs, progress=False)
print(bounds)

# %% [markdown]
# Each α-cut is the range of the function over the box of the inputs' cuts.

# %%
import matplotlib.pyplot as plt

figure, axes = plt.subplots(figsize=(5, 3), layout="constrained")
lower, upper = (end.reshape(len(bounds.alpha), -1)[:, 0] for end in (bounds.lower, bounds.upper))
axes.plot([*lower, *upper[::-1]], [*bounds.alpha, *bounds.alpha[::-1]], color="#0072b2")
axes.set(xlabel="deflection (m)", ylabel="α", ylim=(0, 1.05))
plt.show()

# %% [markdown]
# ## What you know makes bounds proved
#
# A deflection rises with the load and falls with the stiffness. Stated so, two corners of each
# cut are enough, and the bounds are guaranteed.

# %%
from alphacut.fuzzy import Knowledge, Signed

knowledge = Knowledge(signs={"load": 1, "length": 1, "stiffness": -1})
print(propagate(deflection, inputs, Signed(), knowledge=knowledge, progress=False))

# %% [markdown]
# ## Dear functions
#
# - `workers=2` shares the samples among processes. Any `concurrent.futures` executor will do.
# - `store="samples.db"` keeps every sample. A run that was killed goes on where it stopped.
# - `budget=500` bounds the number of evaluations.
#
# ## Pitfalls
#
# - Inputs are independent, also where one number stands for two.
# - With `workers` the function must stand in a file, and the call under `if __name__ ==
#   "__main__":`.
