"""Figures 13 to 18 as exhibits: what the context translator does, beside the thesis's numbers."""

from collections.abc import Iterator

import numpy as np

from anyview.report import thesis
from anyview.report.content import Exhibit, Reel, Section, Table, view
from anyview.report.estimates import Estimate, Estimator
from anyview.report.figures import translation as figures
from anyview.report.figures.style import to_svg
from anyview.report.inputs import Study, Training, Translation
from anyview.report.metrics import Tree, extreme_ratio, ratio_change
from anyview.report.pictures import Strip, make_film, make_strip
from anyview.report.words import ABSENT, NOT_STATED, listed, number, plural, published, spread

ADAM, ADADELTA, AUGMENTED, SIM = "real-adam", "real-adadelta", "real-augmented", "sim"
_REEL_CLIPS = 4


def section(study: Study, metrics: Tree) -> Section:
    """The chapter on the translator."""
    exhibits = (
        *_training(study),
        *_feature_weights(study),
        *_validation_strip(study, metrics),
        *_extreme(study, metrics),
        *_simulation(study, metrics),
        *_moving(study),
        *_table(metrics),
    )
    text = (
        "Losses are on the thesis’s scale as far as it can be inferred: half the sum of squares over a "
        "batch of 100 frames for translation and reconstruction, 1,000 times the mean square for "
        "alignment, all weights 1. Intervals are over clips, the two views of one demonstration drawn "
        "together; a curve, or a number without an interval, is one training or one clip.",
    )
    return Section("translator", "The context translator", text, exhibits)


def _training(study: Study) -> Iterator[Exhibit]:
    for cell, figure, reference, optimiser in (
        (ADAM, 13, thesis.ADAM, "Adam"),
        (ADADELTA, 14, thesis.ADADELTA, "AdaDelta"),
    ):
        if cell not in study.trainings:
            continue
        training = study.trainings[cell]
        last = int(training.curve["iteration"].max())
        yield Exhibit(
            f"figure-{figure}",
            f"Figure {figure}. Training on real clips with {optimiser}",
            (
                f"Here {plural(last, 'iteration')}, in the thesis {reference.iterations:,} in "
                f"{reference.hours:g} hours on a GTX 970. Diamonds are the values that its text states; "
                "our total loss is the mean since the validation before.",
                *_optimisers(study, cell),
            ),
            to_svg(figures.training(training.curve, reference)),
            comparison=_training_table(training, reference),
            surrogate=study.surrogate,
        )


def _training_table(training: Training, reference: thesis.TrainingRun) -> Table:
    rows = []
    for name, column, stated in (
        ("Total loss", "loss", reference.total),
        ("Validation loss", "validation_loss", reference.validation),
    ):
        curve = training.losses(column)
        start = NOT_STATED if stated.start is None else published(stated.start)
        minimum = f"{published(stated.minimum)} at\u00a0{stated.minimum_iteration:,}"
        by_500 = curve[curve.index <= max(500, curve.index[0])]
        rows += [
            (f"{name}, first", start, _at(curve.iloc[0], curve.index[0])),
            (f"{name}, by iteration 500", published(stated.at_500), _at(by_500.iloc[-1], by_500.index[-1])),
            (f"{name}, minimum", minimum, _at(curve.min(), curve.idxmin())),
        ]
    return Table(("", "Thesis", "Here"), tuple(rows))


def _at(value: float, iteration: int) -> str:
    return f"{number(value)} at\u00a0{iteration:,}"


def _optimisers(study: Study, cell: str) -> Iterator[str]:
    """Adam against AdaDelta at the last validation that both have reached, as it comes out."""
    if cell != ADADELTA or ADAM not in study.trainings:
        return
    minima = [published(run.validation.minimum) for run in (thesis.ADAM, thesis.ADADELTA)]
    curves = [study.trainings[name].losses("validation_loss") for name in (ADAM, ADADELTA)]
    shared = curves[0].index.intersection(curves[1].index)
    if len(shared):
        at = int(shared.max())
        yield (
            f"At equal iterations ({at:,}), the validation loss is {number(curves[0][at])} with Adam and "
            f"{number(curves[1][at])} with AdaDelta; one training each. The thesis’s minima, "
            f"{listed(minima)}, are not at equal iterations."
        )


def _feature_weights(study: Study) -> Iterator[Exhibit]:
    if ADAM not in study.translations:
        return
    weights = study.translations[ADAM].feature_weights
    means = []
    for first, last, stated in thesis.FEATURE_WEIGHTS:
        here = f"{weights[first : last + 1].mean():.3f}" if len(weights) == thesis.FRAMES else ABSENT
        scaled = f"{stated * thesis.feature_weight_scale():.3f}"
        means.append((f"Frames {first} to {last}", f"{stated:.3f}" if stated else "about 0", scaled, here))
    yield Exhibit(
        "figure-15",
        "Figure 15. How much each frame of the expert’s clip matters",
        (
            "Permutation importance: how much the translation loss rises when a frame is replaced by "
            "frames of other times. Ours sum to 1; the thesis’s values cannot, so only the shapes compare: "
            "its line is scaled to sum to 1, with gaps where it states nothing. One training: no interval.",
        ),
        to_svg(figures.feature_weights(weights)),
        comparison=Table(("Mean weight", "Thesis", "Scaled", "Here"), tuple(means)),
        surrogate=study.surrogate,
    )


def _validation_strip(study: Study, metrics: Tree) -> Iterator[Exhibit]:
    if ADAM not in study.translations:
        return
    translation = study.translations[ADAM]
    clip = typical_clip(translation, "validation")
    loss = float(translation.clips.set_index("clip")["loss"][clip])
    validation = metrics[ADAM]["validation"]
    count = len(translation.split("validation"))
    rows = (
        ("Loss of the example", published(thesis.STRIP_EXAMPLE_LOSS), number(loss)),
        (
            f"Mean loss ({thesis.VALIDATION_CLIPS} clips; {count} here)",
            published(thesis.VALIDATION_LOSS),
            _metric(validation, "loss"),
        ),
        ("The same of Liu’s model, by the thesis", published(thesis.LIU_VALIDATION_LOSS), ABSENT),
        ("PSNR (dB)", NOT_STATED, _metric(validation, "psnr")),
        ("SSIM", NOT_STATED, _metric(validation, "ssim")),
    )
    yield Exhibit(
        "figure-16",
        "Figure 16. A held-out clip: true above translated, every 7th frame",
        ("Of the validation clips kept as video, the one of median loss: neither the best nor the worst.",),
        strip=view(clip_strip(translation, clip)),
        comparison=Table(("", "Thesis", "Here"), rows),
        surrogate=study.surrogate,
    )


def _extreme(study: Study, metrics: Tree) -> Iterator[Exhibit]:
    cells = [cell for cell in (ADAM, AUGMENTED) if "extreme" in metrics.get(cell, {})]
    if not cells:
        return
    estimator = Estimator(study.params.base.seed)
    ratios = {cell: extreme_ratio(estimator, cell, study.translations[cell]) for cell in cells}
    rows = [
        (
            f"Mean loss, extreme ({cell})",
            published(thesis.EXTREME_LOSS) if cell == ADAM else ABSENT,
            _metric(metrics[cell]["extreme"], "loss"),
        )
        for cell in cells
    ]
    rows += [
        (
            f"Extreme over validation, L_tr ({cell})",
            f"{thesis.EXTREME_RATIO:.1f}" if cell == ADAM else ABSENT,
            _estimate(ratios[cell]),
        )
        for cell in cells
    ]
    yield Exhibit(
        "figure-17",
        "Figure 17. Extreme distractors that training never saw: the last frame",
        (
            "Many objects and a target of another colour. The thesis fails here: its loss is 2.7 times "
            "that of validation.",
            *_augmentation(study, estimator, ratios),
        ),
        strip=view(_last_frames(study, cells)),
        comparison=Table(("", "Thesis", "Here"), tuple(rows)),
        surrogate=study.surrogate,
    )


def _augmentation(study: Study, estimator: Estimator, ratios: dict[str, Estimate]) -> Iterator[str]:
    if len(ratios) < 2:
        return
    change = ratio_change(estimator, study.translations[ADAM], study.translations[AUGMENTED])
    claim = "no order is claimed" if not change.excludes_zero else "the interval excludes zero"
    yield (
        f"Beyond the thesis: augmenting the contexts in training changes the ratio from "
        f"{_estimate(ratios[ADAM])} to {_estimate(ratios[AUGMENTED])}, on the same clips by "
        f"{_estimate(change)}; {claim}. A ratio also falls where the loss of validation rises: see both."
    )


def _simulation(study: Study, metrics: Tree) -> Iterator[Exhibit]:
    if SIM not in study.translations:
        return
    translation = study.translations[SIM]
    validation = metrics[SIM]["validation"]
    rows = (
        ("Mean loss", published(thesis.SIMULATION_LOSS), _metric(validation, "loss")),
        (
            "Translation loss of the last frame",
            NOT_STATED,
            number(translation.split("validation")["last_frame"].mean()),
        ),
        ("PSNR (dB)", NOT_STATED, _metric(validation, "psnr")),
        ("SSIM", NOT_STATED, _metric(validation, "ssim")),
    )
    yield Exhibit(
        "figure-18",
        "Figure 18. Simulation: a held-out demonstration, true above translated",
        (
            "Of the held-out clips kept as video, the one of median loss; the numbers are over "
            f"{len(translation.split('validation'))} held-out clips. The thesis shows only the last frame, "
            "and its scene is another one.",
        ),
        strip=view(clip_strip(translation, typical_clip(translation, "validation"))),
        comparison=Table(("", "Thesis", "Here"), rows),
    )


def _moving(study: Study) -> Iterator[Exhibit]:
    reels = []
    for cell in (SIM, ADAM, AUGMENTED):
        if cell not in study.translations:
            continue
        translation = study.translations[cell]
        for split in ("validation", "extreme"):
            films = tuple(
                make_film(translation.frames(clip), f"{clip}: true left, translated right")
                for clip in translation.filmed(split)[:_REEL_CLIPS]
            )
            if films:
                reels.append(Reel(f"{cell}, {split}", films))
    if reels:
        yield Exhibit(
            "moving",
            "Translated clips, playing",
            ("The first held-out clips of each set, not picked by how well they came out.",),
            reels=tuple(reels),
        )


def _table(metrics: Tree) -> Iterator[Exhibit]:
    rows = []
    for cell, values in metrics.items():
        for split in ("validation", "extreme"):
            if split in values:
                cells = (_metric(values[split], name) for name in ("loss", "translation", "psnr", "ssim"))
                rows.append((f"{cell}, {split}" + (" (surrogate)" if values["surrogate"] else ""), *cells))
    if rows:
        yield Exhibit(
            "translators",
            "Every translator",
            ("Each is one training: its seed’s luck is part of its row, and of all runs that use it.",),
            table=Table(("Cell", "Loss", "L_tr", "PSNR (dB)", "SSIM"), tuple(rows)),
        )


def typical_clip(translation: Translation, split: str) -> str:
    """The clip of median loss among those of ``split`` that were written out as video."""
    clips = translation.split(split)
    filmed = clips[clips["clip"].isin(translation.filmed(split))].sort_values("loss", kind="stable")
    return str(filmed["clip"].iloc[(len(filmed) - 1) // 2])


def clip_strip(translation: Translation, clip: str) -> Strip:
    """True over translated frames of ``clip``."""
    true, translated = np.split(translation.frames(clip), 2, axis=2)
    return make_strip([("true", true), ("translated", translated)])


def _last_frames(study: Study, cells: list[str]) -> Strip:
    """The last frame of each extreme clip: the true one, then each cell's translation."""
    clips = study.translations[cells[0]].filmed("extreme")
    rows: list[tuple[str, np.ndarray]] = []
    for cell in cells:
        lasts = [np.split(study.translations[cell].frames(clip)[-1], 2, axis=1) for clip in clips]
        if not rows:
            rows.append(("true", np.stack([last[0] for last in lasts])))
        rows.append((f"translated ({cell})", np.stack([last[1] for last in lasts])))
    return Strip(tuple(rows), tuple(range(1, len(clips) + 1)))


def _metric(values: Tree, name: str) -> str:
    return spread(values[name], values[f"{name}_low"], values[f"{name}_high"])


def _estimate(estimate: Estimate) -> str:
    return spread(estimate.value, estimate.low, estimate.high)
