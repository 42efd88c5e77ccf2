"""The sentences that follow from measurements: an order only where one may be claimed."""

import pytest

from anyview.analysis.diagnosis import Diagnosis
from anyview.analysis.results import analyse
from anyview.analysis.study import read_study
from anyview.report.illustrations import Illustrations
from anyview.report.text import environment, write_markdown


def text_of(data, params) -> str:
    study = read_study(params, data.root)
    text = write_markdown(study, analyse(study), Illustrations({}, {}, {}), lambda name: "")
    return text.replace("\u00a0", " ")


def paragraph(text: str, start: str) -> str:
    (found,) = (block for block in text.split("\n\n") if block.startswith(start))
    return found


def test_orders_are_claimed_by_the_corrected_test(data, params):
    data.policies("ours", 0.03)
    data.policies("oracle", 0.01)
    data.policies("gail", 0.5, returns=False)
    data.policies("no-alignment", 0.03)
    text = text_of(data, params)
    assert paragraph(text, "Farther from the goal than ours").startswith(
        "Farther from the goal than ours: GAIL, 2"
    )
    assert "Oracle (true view), 0." in paragraph(text, "Nearer to the goal than ours")
    assert paragraph(text, "No order") == "No order can be claimed between ours and: without L_align."


def test_every_translator_says_how_many_frames_its_batches_have(data, params):
    """`compact` cells have batches of their own."""
    data.translator("sim", iterations=520)
    data.translator("real-adam", iterations=520)
    own, common = params.translators["sim"].batch_size, params.training.batch_size
    assert own != common
    text = text_of(data, params)
    assert f"| Iterations of sim | not stated | 520 batches of {own} |" in text
    assert f"| Iterations of real-adam | 11,750 | 520 batches of {common} |" in text


def test_a_method_of_few_runs_is_open(data, params):
    data.policies("ours", 0.03)
    data.policies("gail", 0.5, returns=False)
    path = data.root / "data/policies/gail/runs.csv"
    path.write_text("\n".join(path.read_text().splitlines()[:4]) + "\n")
    text = text_of(data, params)
    assert "Farther from the goal" not in text
    assert paragraph(text, "No order") == "No order can be claimed between ours and: GAIL."


def test_effects_of_the_two_by_two_are_put_into_words(data, params):
    for cell, distance in (("narrow-trpo", 0.3), ("narrow-ddpg", 0.3), ("liu", 0.03), ("ours", 0.03)):
        data.policies(cell, distance)
    text = text_of(data, params)
    contexts = paragraph(text, "Diverse contexts instead of narrow ones: 0.")
    assert "times as far, p < 0.001, −2" in contexts
    assert contexts.endswith("; the object ends nearer to the goal.")
    learner = paragraph(text, "DDPG instead of Liu's TRPO")
    assert learner.endswith("; chance explains it, so no effect is claimed.")


@pytest.mark.parametrize(
    ("found", "words"),
    [
        (Diagnosis(0.1, 0.03, -3.0, None, None, 0.5, {}), "leads away from the task"),
        (Diagnosis(0.1, 0.03, 50.0, 0.06, 0.9, 0.9, {}), "already earns 94%"),
        (Diagnosis(0.9, 0.03, 50.0, 0.4, 0.9, 0.9, {}), "succeeds"),
        (
            Diagnosis(0.0, 0.03, None, None, None, -0.1, {"expert": 0.97, "agent": 0.5}),
            "nearer (its discriminator tells right: expert 97% and agent 50%): following this reward is not",
        ),
        (Diagnosis(0.1, 0.03, None, None, None, 0.8, {}), "not near enough"),
        (Diagnosis(0.1, 0.03, None, None, None, None, {}), "–"),
        (Diagnosis(0.1, 0.03, 50.0, 0.4, 0.2, 0.0, {}), "wins only 20%"),
        (Diagnosis(0.1, 0.03, 50.0, 0.4, 0.95, 0.0, {}), "matched without doing the task"),
        (
            Diagnosis(0.1, 0.03, 50.0, 0.4, 0.95, 0.9, {}),
            "ends 3.0\u00a0cm from the goal: the reward takes no more than 5%",
        ),
        (Diagnosis(0.1, 0.03, 50.0, 0.4, 1.1, 0.9, {}), "optimum is not the goal"),
    ],
)
def test_every_reason_has_its_words(found, words):
    why = environment(autoescape=False).get_template("reasons.md.jinja").module.why
    assert words in why(found)
