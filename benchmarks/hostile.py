"""Mutated files of every kind that the project reads: none may crash it, hang it, swell it or be run by it.

    python benchmarks/hostile.py [--files 2400] [--seed 1]

Of every kind a sound file is made and mutated at random (cut, flipped, overwritten, moved, lengthened,
replaced, numbers changed), and a few are forged on purpose: headers that claim giants, pickles, YAML tags,
endless nesting. Each is read by the reader that the stages use, in a process with little memory. An audit
hook watches what Python opens and runs. The script ends with 1 if anything was amiss:

- an exception that is not the one-line refusal of bad input, a crash, more than SECONDS for a file, more than
  MEGABYTES of memory;
- a file opened for writing outside the folder meant for it, a program started, a pickle looked into;
- an accepted file that was cut short or swapped, where a file's kind can tell.
"""

import argparse
import dataclasses
import json
import multiprocessing
import os
import pickle
import re
import resource
import signal
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path
from string import ascii_lowercase

import numpy as np

from anyview.runtime.errors import AnyviewError
from anyview.seeds import stream

SECONDS, MEGABYTES = 10.0, 300
STARTERS = ("os.system", "os.exec", "os.posix_spawn", "os.fork", "subprocess.Popen", "pickle.find_class")
WAYS = ("cut", "flip", "hole", "moved", "inserted", "longer", "emptied", "other", "number", "flip", "number")
GIANTS = (
    b"100000",
    b"-1",
    b"0",
    b"1e400",
    b"nan",
    b"18446744073709551616",
    b"9" * 5000,
    b"true",
    b"[]",
    b"x",
)
PICKLE = pickle.dumps(type("Evil", (), {"__reduce__": lambda self: (os.system, ("touch executed",))})())


@dataclasses.dataclass(frozen=True)
class Target:
    """A sound file, the reader of it, forgeries to try as well, and which mutations a reader must notice."""

    path: Path
    read: Callable[[], object]  # raises AnyviewError, or returns False, to refuse
    forged: tuple[bytes, ...] = ()
    notices: frozenset[str] = frozenset()


BROKEN = frozenset(("cut", "emptied", "other"))
ANY = frozenset(WAYS)


def mutants(content: bytes, count: int, rng: np.random.Generator) -> Iterator[tuple[str, bytes]]:
    """``count`` versions of a file that differ from it, each with what was done to it."""
    while count:
        way = WAYS[count % len(WAYS)]
        altered = bytearray(content)
        at, other = (int(place) for place in rng.integers(0, len(content), 2))
        length = int(rng.integers(1, max(len(content) // 4, 2)))
        if way == "cut":
            altered = altered[:at]
        elif way == "flip":
            for place in rng.integers(0, min(len(content), (200, 6000, 10**9)[count % 3]), 1 + count % 4):
                altered[place] ^= 1 << int(rng.integers(8))
        elif way == "hole":
            altered[at : at + length] = bytes(len(altered[at : at + length]))
        elif way == "moved":
            altered[at : at + length] = content[other : other + length]
        elif way == "inserted":
            altered[at:at] = rng.bytes(min(length, 50))
        elif way == "longer":
            altered += rng.bytes(length)
        elif way == "emptied":
            altered.clear()
        elif way == "other":
            altered = bytearray(rng.bytes(int(rng.integers(1, 5000))))
        elif numbers := list(re.finditer(rb"\d+(\.\d+)?", content)):
            number = numbers[int(rng.integers(len(numbers)))]
            altered[number.start() : number.end()] = GIANTS[int(rng.integers(len(GIANTS)))]
        if altered.strip() != content.strip():
            yield way, bytes(altered)
        count -= 1


def pictures() -> np.ndarray:
    """A red square and a blue disc that crosses towards it: what a demonstration looks like to ingest."""
    frames = np.full((82, 90, 160, 3), (150, 145, 140), np.uint8)
    frames[:, 35:55, 100:120] = (200, 30, 30)
    for index, frame in enumerate(frames):
        frame[35:55, 10 + index : 30 + index] = (30, 60, 200)
    return frames


def raw_clip(name: str, codec: str, sides: bytes, claimed: bytes) -> Callable[[Path], Target]:
    """A raw clip for ingest; forged is a header in which the picture's ``sides`` became ``claimed``."""

    def make(box: Path) -> Target:
        import cv2

        from anyview.config import Ingest
        from anyview.ingest.clips import Candidate, ingest_clip

        limits = Ingest(size=48, frames=80, rate=10.0, max_megabytes=50.0, even_exposure=False)
        writer = cv2.VideoWriter(
            str(box / name), cv2.CAP_FFMPEG, cv2.VideoWriter.fourcc(*codec), 10.0, (160, 90)
        )
        for frame in pictures():
            writer.write(cv2.cvtColor(frame, cv2.COLOR_RGB2BGR))
        writer.release()
        numbers = iter(range(10**6))

        def read() -> bool:
            clip = f"clip-{next(numbers)}"
            verdict = ingest_clip(box, box / "written", Candidate(clip, name, clip, "", "standard"), limits)
            assert "\n" not in verdict.reason
            return not verdict.reason

        content = (box / name).read_bytes()
        assert sides in content
        return Target(box / name, read, (content.replace(sides, claimed), PICKLE), BROKEN)

    return make


def table(name: str) -> Callable[[Path], Target]:
    """The manifest of raw clips, or a table of splits."""

    def make(box: Path) -> Target:
        from anyview.ingest.clips import read_candidates
        from anyview.video.splits import read_split

        if name == "manifest.csv":
            rows = "".join(f"clip-{i}.avi,pair-{i // 2},left,standard\n" for i in range(20))
            (box / name).write_text("file,pair,camera,kind\n" + rows)
            forged = (b"file,pair,camera,kind\n../../etc/passwd,a,b,standard\n", PICKLE)

            def read() -> object:
                return all(Path(each.clip).name == each.clip for each in read_candidates(box))
        else:
            rows = "".join(f"{i:04d},{i // 2},{'validation' if i % 5 == 0 else 'train'}\n" for i in range(20))
            (box / name).write_text("clip,pair,split\n" + rows)
            forged = (b"clip,pair,split\n" + b"x" * 5_000_000, PICKLE)

            def read() -> object:
                return len(read_split(box / name)) >= 0

        return Target(box / name, read, forged, frozenset(("emptied",)))

    return make


def stored_set(name: str) -> Callable[[Path], Target]:
    """A file of a set of clips, or one of its tables."""

    def make(box: Path) -> Target:
        import pandas as pd

        from anyview.video.sets import open_frames, write_set, write_shard

        clips = np.stack([pictures()[shift : shift + 6, :32, :48] for shift in range(4)])
        files = [write_shard(box, index, clips[2 * index : 2 * index + 2]) for index in range(2)]
        write_set(box, pd.DataFrame({"clip": ["000", "001", "002", "003"]}), files)
        digest = files[0].sha256.encode()
        forged = (b"file,clips,frames,sha256\nshard-0000.avi,1000000000,1000000000," + digest + b"\n", PICKLE)
        notices = {"shard-0000.avi": ANY, "files.csv": BROKEN}.get(name, frozenset(("emptied",)))
        return Target(box / name, lambda: open_frames(box).frames.shape, forged, notices)

    return make


def shared_dataset(file: str) -> Callable[[Path], Target]:
    """The description, or the episode table, of a LeRobotDataset."""

    def make(box: Path) -> Target:
        from anyview.lerobot.layout import VIDEOS
        from anyview.lerobot.reading import episode_views
        from anyview.lerobot.writing import write_dataset

        camera = "observation.images.top"
        write_dataset(box, pictures()[None, :4], np.zeros((20, 1), int), ["top"], 10.0, "push")
        described = json.loads((box / "meta" / "info.json").read_text())
        forged: tuple[bytes, ...] = (PICKLE, b"PAR1" + PICKLE + b"PAR1", b'{"a":' * 100_000)
        for path in ("../../etc/passwd", "{video_key.__class__}", "{chunk_index:999999999}", 7):
            forged += (json.dumps(described | {"video_path": path}).encode(),)

        def read() -> object:
            files = set(episode_views(box, [camera])["file"])
            return files == {VIDEOS.format(video_key=camera, chunk_index=0, file_index=0)}

        return Target(box / file, read, forged, BROKEN)

    return make


def params_file(box: Path) -> Target:
    from anyview.config import load_params

    path = box / "params.yaml"
    path.write_bytes((Path(__file__).parents[1] / "params.yaml").read_bytes())
    aliases = "a: &a [x, x]\n" + "".join(f"{b}: &{b} [*{a}, *{a}]\n" for a, b in pairwise(ascii_lowercase))
    forged = (
        b"base: !!python/object/apply:os.system ['touch executed']\n",
        b"base: " + b"[" * 500,
        f"{aliases}base: {{seed: *z}}\n".encode(),
        b"base: {seed: " + b"9" * 100_000 + b"}\n",
        PICKLE,
    )
    return Target(path, lambda: load_params(path), forged, frozenset(("emptied", "other")))


def safetensors_claims(shape: list[int], name: str) -> bytes:
    """A file of safetensors whose header promises more than there is."""
    size = 4 * int(np.prod(shape, dtype=object))
    header = json.dumps({name: {"dtype": "F32", "shape": shape, "data_offsets": [0, size]}}).encode()
    return len(header).to_bytes(8, "little") + header


def model(name: str, folder: str) -> Callable[[Path], Target]:
    """A file of a translator, an embedding or a policy."""

    def make(box: Path) -> Target:
        import torch

        from anyview.embedding.network import Embedding
        from anyview.embedding.weights import load_embedding, save_embedding
        from anyview.learners.common.policies import load_policy, save_policies
        from anyview.pusher.contexts import sample_contexts
        from anyview.translator.network import ContextTranslator
        from anyview.translator.weights import load_translator, save_translator

        torch.set_num_threads(1)
        if folder == "translator":
            save_translator(box, ContextTranslator("real", 16), {"best_iteration": 7})
        elif folder == "embedding":
            save_embedding(box, Embedding(16, 8), {"best_iteration": 7})
        else:
            contexts, _ = sample_contexts(stream(1, "hostile"), 1)
            sizes = {"weight0": (15, 8), "bias0": (8,), "weight1": (8, 3), "bias1": (3,)}
            arrays = {key: np.ones((1, *shape), np.float32) for key, shape in sizes.items()}
            save_policies(box, arrays, contexts, "trpo", "twist", 64)
        read = {"translator": load_translator, "embedding": load_embedding}.get(folder)
        forged: tuple[bytes, ...] = (PICKLE, b'{"a":' * 100_000, b'{"image_size": 1000000000}')
        if name.endswith(".json"):
            described = json.loads((box / name).read_text())
            for size in (16_000, 10**9, -16, 16.5, True, "16", None, [16]):
                forged += (json.dumps(described | {"image_size": size}).encode(),)
            for kind in (7, [], {}, "../real", None):
                forged += (json.dumps(described | {"architecture": kind, "learner": kind}).encode(),)
            forged += (json.dumps(described | {"contexts": [{}]}).encode(),)
        else:
            forged += (
                safetensors_claims([100_000, 100_000], "weight0"),
                (2**62).to_bytes(8, "little") + b"{",
            )
        return Target(box / name, lambda: read(box) if read else load_policy(box, 0), forged, BROKEN)

    return make


def checkpoint(box: Path) -> Target:
    from anyview.runtime.checkpoints import Checkpoints

    Checkpoints(box).save(3, {"weights": np.ones((40, 40), np.float32)}, {"losses": [0.5, 0.25]})
    (path,) = box.glob("checkpoint-?")
    forged = (PICKLE, b"anyview-checkpoint-1\n" + PICKLE, path.read_bytes()[:22] + PICKLE)
    return Target(path, lambda: Checkpoints(box).load() is not None, forged, ANY)


def unit_of_work(box: Path) -> Target:
    from anyview.runtime.once import once

    def make() -> tuple[dict[str, float], list[str]]:
        (box / "written").mkdir(exist_ok=True)
        (box / "written" / "made.txt").write_text("made")
        return {"loss": 0.5}, ["made.txt"]

    once(box / "written", "unit", make)
    path = box / "written" / "unit.json"
    forged = (b'{"files": {"../../../etc/passwd": "0"}, "result": 1}', b'{"a":' * 100_000, PICKLE)
    return Target(path, lambda: once(box / "written", "unit", make), forged)


TARGETS: dict[str, Callable[[Path], Target]] = {
    "clip, AVI": raw_clip("clip.avi", "XVID", b"\xa0\0\0\0\x5a\0\0\0", b"\xa0\x86\1\0\xa0\x86\1\0"),
    "clip, MP4": raw_clip("clip.mp4", "mp4v", b"\0\xa0\0\0\0\x5a\0\0", b"\xff\xff\0\0\xff\xff\0\0"),
    "clip, Matroska": raw_clip("clip.mkv", "XVID", b"\xb0\x81\xa0", b"\xb0\x81\x00"),
    "manifest of raw clips": table("manifest.csv"),
    "set: video": stored_set("shard-0000.avi"),
    "set: files.csv": stored_set("files.csv"),
    "set: manifest.csv": stored_set("manifest.csv"),
    "split": table("split.csv"),
    "LeRobotDataset: info.json": shared_dataset("meta/info.json"),
    "LeRobotDataset: episodes": shared_dataset("meta/episodes/chunk-000/file-000.parquet"),
    "params.yaml": params_file,
    "translator: weights": model("weights.safetensors", "translator"),
    "translator: model.json": model("model.json", "translator"),
    "embedding: weights": model("weights.safetensors", "embedding"),
    "embedding: model.json": model("model.json", "embedding"),
    "policy: weights": model("policy-0.safetensors", "policy"),
    "policy: policy.json": model("policy.json", "policy"),
    "checkpoint": checkpoint,
    "record of a unit": unit_of_work,
}


@dataclasses.dataclass
class Tally:
    """What became of the mutants of a kind."""

    refused: int = 0
    accepted: int = 0
    slowest: float = 0.0
    megabytes: float = 0.0
    breaches: list[str] = dataclasses.field(default_factory=list)


class TooLong(BaseException):
    """A file took more than SECONDS."""


def attack(kind: str, folder: str, count: int, seed: int, results: "multiprocessing.Queue[Tally]") -> None:
    """Read ``count`` mutants and every forgery of a kind, in a process of its own."""
    box = Path(folder).resolve()
    os.environ |= {"ANYVIEW_SCRATCH": str(box / "scratch"), "TMPDIR": str(box), "HOME": str(box)}
    tempfile.tempdir = str(box)
    os.chdir(box)
    target = TARGETS[kind](box)
    content = target.path.read_bytes()
    (box / "written").mkdir(exist_ok=True)
    target.read()  # imports what it needs, and must not raise
    tally = Tally()
    context = ""

    def watch(event: str, arguments: tuple) -> None:
        if event in STARTERS:
            tally.breaches.append(f"{context}: {event} {arguments[:1]}")
        elif event == "open" and isinstance(arguments[0], str | bytes):
            flags = arguments[2] if isinstance(arguments[2], int) else 0
            path = Path(os.path.abspath(os.fsdecode(arguments[0])))
            writes = flags & (os.O_WRONLY | os.O_RDWR | os.O_CREAT)
            if writes and not path.is_relative_to(box) and path != Path(os.devnull):
                tally.breaches.append(f"{context}: opened {path} for writing")

    def too_long(*_: object) -> None:
        raise TooLong

    sys.addaudithook(watch)
    signal.signal(signal.SIGALRM, too_long)
    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (used + (2 << 30), resource.RLIM_INFINITY))
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    cases = [("forged", forgery) for forgery in target.forged]
    cases += mutants(content, count, stream(seed, "hostile", *kind.encode()))
    listed = sorted(box.iterdir())
    for index, (way, mutant) in enumerate(cases):
        context = f"{way} {index}"
        target.path.write_bytes(mutant)
        began = time.perf_counter()
        signal.setitimer(signal.ITIMER_REAL, SECONDS)
        try:
            accepted = target.read() is not False
        except (Exception, TooLong) as error:
            accepted = False
            explained = isinstance(error, AnyviewError) or (isinstance(error, OSError) and error.errno)
            if not explained:  # by ``exit_code``, in a line
                tally.breaches.append(f"{context}: {type(error).__name__}: {str(error)[:80]}")
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0)
        if accepted and (way in target.notices or mutant == PICKLE) and kind != "record of a unit":
            tally.breaches.append(f"{context}: accepted")
        tally.accepted += accepted
        tally.refused += not accepted
        tally.slowest = max(tally.slowest, time.perf_counter() - began)
    tally.megabytes = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024
    if tally.megabytes > MEGABYTES:
        tally.breaches.append(f"grew by {tally.megabytes:.0f} MB")
    if new := {path.name for path in set(box.iterdir()) - set(listed)} - {"scratch", "written"}:
        tally.breaches.append(f"left {', '.join(sorted(new))} behind")
    results.put(tally)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--files", type=int, default=2400, help="mutated files in all")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", help="kinds whose names contain this")
    options = parser.parse_args()
    kinds = [kind for kind in TARGETS if (options.only or "") in kind]
    each = -(-options.files // len(kinds))
    spawn = multiprocessing.get_context("spawn")  # a process that nothing was imported into yet
    print(f"{'kind':24} {'refused':>7} {'accepted':>8} {'slowest':>9} {'memory':>8}  amiss")
    amiss = tried = 0
    for kind in kinds:
        with tempfile.TemporaryDirectory() as folder:
            results = spawn.Queue()
            process = spawn.Process(target=attack, args=(kind, folder, each, options.seed, results))
            process.start()
            try:
                tally = results.get(timeout=60 + each * 2)
            except Exception:  # it crashed, or hangs where no signal reaches it
                tally = Tally(breaches=[f"crashed or hung, exit code {process.exitcode}"])
            process.kill()
            process.join()
        tried += tally.refused + tally.accepted
        amiss += len(tally.breaches)
        print(
            f"{kind:24} {tally.refused:7} {tally.accepted:8} {tally.slowest:7.2f} s {tally.megabytes:5.0f} MB"
            f"  {'; '.join(tally.breaches[:5]) or '-'}",
            flush=True,
        )
    print(f"{tried} files tried, {amiss} things amiss")
    sys.exit(1 if amiss else 0)


if __name__ == "__main__":
    main()
