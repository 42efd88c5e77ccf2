"""The examples, run as their first lines say."""


def test_stable_baselines3_trains_on_the_translated_reward(study):
    said = study.run("python", "examples/train_with_stable_baselines3.py", "600")
    assert "after 600 steps: " in said
    assert "cm from the goal" in said
