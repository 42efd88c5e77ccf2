"""The command `anyview translate`."""

import json
from pathlib import Path
from typing import Annotated

import typer


def translate(
    clip: Annotated[str, typer.Argument(help="The expert's clip: any video, or the name of a set's clip.")],
    context: Annotated[
        Path,
        typer.Option("--context", help="The other view: a picture, or a video whose first frame is taken."),
    ],
    model: Annotated[str, typer.Option("--model", help="A trained cell, or the folder of a model.")],
    output: Annotated[
        Path, typer.Option("--output", "-o", help="The AVI file to write (lossless FFV1).")
    ] = Path("translated.avi"),
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON for a script.")] = False,
) -> None:
    """Translate a clip to another viewpoint.

    Clip and context are cut to their middle square and shrunk to the model's size. Every frame is translated
    by itself, so that the result has the clip's length and rate.
    """
    from anyview.assessment.evaluation import translate_clip
    from anyview.cli.footage import read_clip, read_view
    from anyview.runtime.device import torch_device
    from anyview.runtime.errors import AnyviewError
    from anyview.sharing.checksums import find_model
    from anyview.translator.weights import load_translator
    from anyview.video.files import write_video

    if output.suffix != ".avi":
        raise AnyviewError(f"{output}: the output must end in .avi")
    translator = load_translator(find_model(model))
    frames, rate = read_clip(clip, translator.image_size)
    view = read_view(context, translator.image_size)
    translated = translate_clip(translator.to(torch_device()), frames, view)
    write_video(output, translated, rate)
    count, size = translated.shape[:2]
    if as_json:
        print(json.dumps({"output": str(output), "frames": count, "size": size, "rate": rate}))
    else:
        print(f"{output}: {count} frames of {size}x{size}")
