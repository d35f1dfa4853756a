"""What a campaign would run, and why."""

import os

import pytest

from alphacut import fuzzy
from alphacut.fuzzy import (
    CampaignError,
    Chebyshev,
    Extended,
    General,
    Interval,
    Known,
    Optimisation,
    Reduced,
    Signed,
    Store,
    Triangular,
    explain,
    levels,
)
from tests.fuzzy.general import propagate

INPUTS = {"a": Triangular(0.0, 0.3, 1.0), "b": Triangular(-1.0, 0.0, 2.0)}
IDENTITY = {"cell": {"mesh": 0.15, "layers": 12}, "version": "1"}


def model(a, b):
    return a + b


def run(store, inputs=INPUTS, function=model, **options):
    return propagate(function, inputs, store=store, identity=IDENTITY, **options)


ALPHA = levels(4)


def ask(store, inputs=INPUTS, *, alpha=ALPHA, identity=IDENTITY, **options):
    return explain(inputs, General(), alpha=alpha, store=store, identity=identity, **options)


def test_without_a_store_everything_is_new_and_none_is_made(tmp_path):
    found = ask(tmp_path / "s.db", shared=("a",))
    assert (found.samples, found.stored, found.calls, found.seconds) == (55, 0, 15, None)
    assert found.reasons == ("there is no store yet: every sample is new",)
    assert list(tmp_path.iterdir()) == []


def test_an_explanation_takes_what_a_propagation_takes():
    assert explain({"a": INPUTS["a"], "b": 3.0}, General(), alpha=levels(2)).samples > 0
    with pytest.raises(ValueError, match="the plan is 'general'; it must be a plan such as"):
        explain(INPUTS, "general", alpha=levels(2))


def test_a_whole_campaign_needs_nothing(tmp_path):
    run(tmp_path / "s.db")
    found = ask(tmp_path / "s.db")
    assert (found.stored, found.calls, found.missing) == (55, 0, ())
    assert "nothing would run" in str(found)


def test_a_wider_support_is_told_by_its_new_values(tmp_path):
    run(tmp_path / "s.db")
    inputs = INPUTS | {"b": Triangular(-2.0, 0.0, 2.0)}
    found = ask(tmp_path / "s.db", inputs)
    again = run(tmp_path / "s.db", inputs)
    assert len(found.missing) == again.runs - again.reused
    assert found.reasons[0].startswith("b takes ")
    assert found.reasons[0].endswith("the first -2")
    assert found.seconds >= 0


def test_another_model_is_told_by_what_differs(tmp_path):
    run(tmp_path / "s.db")
    found = ask(tmp_path / "s.db", identity={"cell": {"mesh": 0.08, "layers": 12}, "version": "1"})
    assert len(Store(tmp_path / "s.db").models()) == 1  # asking leaves nothing
    assert found.reasons == (
        (
            "no sample of this model is stored; the nearest model, with 55 samples, differs:"
            " cell.mesh: 0.15 → 0.08"
        ),
    )
    text = str(found)
    assert text.startswith("55 samples: 0 stored, 55 to run in 55 calls; ")
    assert "would run a = 0, b = -1" in text
    assert "… and 50 more" in text


def test_failures_are_told_with_their_error(tmp_path):
    def fragile(a, b):
        if a == 1:
            raise RuntimeError("no convergence")
        return a

    with pytest.raises(CampaignError):
        run(tmp_path / "s.db", function=fragile)
    found = ask(tmp_path / "s.db")
    assert (
        found.reasons[0]
        == "5 failed before and would be tried again, the first with: RuntimeError: no convergence"
    )


def test_a_plan_that_goes_on_from_values_tells_its_first_batch(tmp_path):
    found = explain(
        {"x": Interval(0, 1)},
        Chebyshev(),
        alpha=levels(2),
        store=tmp_path / "s.db",
        identity=IDENTITY,
    )
    assert found.samples >= 1
    assert found.stored == 0


def dies(a, b):
    if a == 1 and b == 2:
        os._exit(9)
    return a + b


def test_a_process_that_dies_is_recorded_as_a_failed_sample(tmp_path):
    with pytest.raises(
        CampaignError, match=r"1 of 30 samples failed.*a = 1, b = 2: the process that ran it died"
    ) as caught:
        run(tmp_path / "s.db", function=dies, workers=2, alpha=(0.0, 0.4, 0.7, 1.0))
    assert len(caught.value.failures) == 1
    assert ask(tmp_path / "s.db", alpha=(0.0, 0.4, 0.7, 1.0)).stored == 29


def test_an_explanation_takes_the_arguments_of_a_propagation(tmp_path):
    assert (
        explain(model, INPUTS, General()).samples
        == explain(INPUTS, General()).samples
        == explain(inputs=INPUTS, plan=General()).samples
        == 55
    )
    options = {
        "alpha": levels(2),
        "workers": 2,
        "progress": print,
        "store": tmp_path / "s.db",
        "identity": IDENTITY,
        "spot_check": True,
    }
    assert (
        explain(model, INPUTS, General(), **options).samples
        == explain(INPUTS, General(), alpha=levels(2)).samples
    )
    assert explain(model, INPUTS, vectorised=True).calls == 1
    with pytest.raises(ValueError, match="what is known of the model names c"):
        explain(model, INPUTS, known=Known({"c": 1}))


@pytest.mark.parametrize(
    ("plan", "most"),
    [
        (Chebyshev(), r"budget 1,000"),
        (Signed(), r"limit 10,000"),
        (Optimisation(), r"budget 2,000"),
    ],
)
def test_a_number_of_samples_that_depends_on_the_model_is_not_named(plan, most):
    found = str(explain(model, INPUTS, plan))
    assert found.startswith(
        f"how many samples {type(plan).__name__} takes depends on the model ({most}); the first 1:"
        " 0 stored, 1 to run"
    )


@pytest.mark.parametrize("plan", [Reduced(), Extended(monotone=tuple(f"x{i}" for i in range(40)))])
def test_too_many_samples_are_counted_without_being_made(plan):
    found = explain({f"x{i}": Triangular(0, 1, 2) for i in range(40)}, plan)
    assert found.samples == 4 * 2**40 + 1
    assert "too many to list" in str(found)


def test_samples_of_earlier_steps_count_and_a_torn_end_is_told(tmp_path):
    path, identity = tmp_path / "s.db", {"a": 1}
    inputs, ran = {"x": Triangular(0, 1, 2), "y": Triangular(1, 2, 3)}, []

    def stopped(x, y):
        ran.append(x)
        if len(ran) == 3:
            raise KeyboardInterrupt
        return x * y

    with pytest.raises(KeyboardInterrupt, match="the 2 samples of this call are in"):
        fuzzy.propagate(stopped, inputs, store=path, identity=identity)
    assert explain(inputs, store=path, identity=identity).stored == 2
    path.write_bytes(path.read_bytes()[:-3])
    found = fuzzy.propagate(lambda x, y: x * y, inputs, store=path, identity=identity)
    assert any("the store ended within a sample" in note for note in found.notes)
    again = fuzzy.propagate(lambda x, y: x * y, inputs, store=path, identity=identity)
    assert not any("the store ended" in note for note in again.notes)
