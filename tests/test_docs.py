"""What the documents say can be followed: links, paths, commands, keys of params, names in the code."""

import csv
import json
import re
import shlex
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
import typer
from dvc.cli import parse_args

from anyview.cli.main import app
from anyview.config import load_params
from anyview.review.results import flat

ROOT = Path(__file__).parents[1]
DOCUMENTS = sorted(
    ROOT / name
    for name in subprocess.run(
        ["git", "ls-files", "*.md"], cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout.split()
)
OTHERS = set(
    [
        ".",
        "apt-get",
        "cd",
        "docker",
        "echo",
        "export",
        "git",
        "ls",
        "pip",
        "pre-commit",
        "python",
        "ray",
        "source",
        "ssh",
        "sudo",
        "xdg-open",
    ]
)
"""Programs that are not ours: the documents may call them, nothing else."""

each_document = pytest.mark.parametrize("path", DOCUMENTS, ids=lambda path: str(path.relative_to(ROOT)))


def prose(path: Path) -> str:
    return re.sub(r"^```.*?^```", "", path.read_text(encoding="utf-8"), flags=re.M | re.S)


def anchors(path: Path) -> set[str]:
    """What GitHub makes of a document's headings."""
    titles = re.findall(r"^#+ (.+)$", prose(path), re.M)
    return {re.sub(r"[^\w -]", "", title.lower()).strip().replace(" ", "-") for title in titles}


@each_document
def test_links_lead_somewhere(path):
    for link in re.findall(r"\]\(([^)\s]+)\)", prose(path)):
        if link.startswith(("https://", "http://", "mailto:")):
            continue
        name, _, anchor = link.partition("#")
        target = (path.parent / name).resolve() if name else path
        assert target.exists(), link
        assert not anchor or anchor in anchors(target), link


@each_document
def test_paths_in_the_text_exist(path):
    """Files of the repository that are named in `code`; `<stage>`, `*` and what DVC makes aside."""
    for name in re.findall(
        r"`((?:src|stages|tests|docs|profiles|benchmarks|examples|\.dvc)/[^`\s]*)`", prose(path)
    ):
        if not re.search(r"[<*{]", name):
            assert (ROOT / name).exists(), name


@each_document
def test_names_in_the_code_exist(path):
    """`anyview.seeds.stream` and `Class.field`."""
    for name in re.findall(r"`(anyview(?:\.\w+)+)(?:\([^`]*\))?`", prose(path)):
        parts = name.split(".")
        module = next(
            ROOT.joinpath("src", *parts[:length]).with_suffix(".py")
            for length in range(len(parts), 0, -1)
            if ROOT.joinpath("src", *parts[:length]).with_suffix(".py").is_file()
            or ROOT.joinpath("src", *parts[:length]).is_dir()
        )
        if module.is_file() and parts[-1] != module.stem:
            assert re.search(rf"^(?:def|class) {parts[-1]}\b|^{parts[-1]}\b.*=", module.read_text(), re.M), (
                name
            )


@each_document
def test_keys_of_params_exist(path):
    params = load_params(ROOT / "params.yaml").model_dump()
    keys = {key for key, _ in flat(params)}
    blocks = {key.rsplit(".", count)[0] for key in keys for count in range(1, key.count(".") + 1)}
    text = path.read_text(encoding="utf-8")
    named = re.findall(rf"`((?:{'|'.join(params)})\.[\w.-]+[\w])(?:: [^`]*)?`", prose(path))
    named += re.findall(r"-S '?([\w.-]+)=", text)
    unknown = {"imitation.phy"} | ({name for name in named if name.endswith(".py")})
    assert {name for name in named if "<" not in name} - keys - blocks - unknown == set()


def test_every_benchmark_says_how_its_numbers_are_taken():
    table = (ROOT / "benchmarks" / "README.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `(benchmarks/\w+\.py)` \|.*\|.{20,}\|$", table, re.M)
    assert sorted(rows) == sorted(f"benchmarks/{path.name}" for path in (ROOT / "benchmarks").glob("*.py"))


def test_the_map_of_the_code_names_every_package():
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    for folder in (ROOT / "src" / "anyview").iterdir():
        if (folder / "__init__.py").is_file():
            assert f"| `src/anyview/{folder.name}/` |" in text, folder.name


def commands() -> Iterator[tuple[str, str]]:
    """Every line of the documents' shell blocks, and every `command` of ours in their text."""
    for path in DOCUMENTS:
        text = path.read_text(encoding="utf-8")
        for block in re.findall(r"^```sh\n(.*?)^```", text, re.M | re.S):
            for line in block.replace("\\\n", " ").splitlines():
                if line.strip():
                    yield path.name, line.strip()
        yield from (
            (path.name, " ".join(line.split()))
            for line in re.findall(r"`((?:make|dvc|anyview) [^`]+)`", prose(path))
        )


@pytest.mark.parametrize(("name", "line"), sorted(set(commands())))
def test_commands_are_understood(name, line):
    """By the parsers of the programs themselves: no such command, option or target would pass."""
    for part in re.split(r"&&|;| \| ", re.sub(r"(^|\s)#.*", "", line)):
        words = [word for word in shlex.split(part.split(" > ")[0]) if word != "..."]
        while words and re.match(r"[A-Z_]+=", words[0]):
            words.pop(0)
        if not words:
            continue
        program, arguments = words[0].removeprefix(".venv/bin/"), words[1:]
        if program == "anyview":
            understood_by_anyview(arguments)
        elif program == "dvc":
            understood_by_dvc(arguments)
        elif program == "make":
            targets = [word for word in arguments if "=" not in word and not word.startswith("<")]
            subprocess.run(["make", "-n", *targets], cwd=ROOT, check=True, capture_output=True)
        else:
            assert program in OTHERS, line


def understood_by_dvc(arguments: list[str]) -> None:
    if len(arguments) > 1:
        parse_args(arguments)
        return
    with pytest.raises(SystemExit) as ended:
        parse_args([*arguments, "--help"])
    assert ended.value.code == 0


def understood_by_anyview(arguments: list[str]) -> None:
    group = typer.main.get_command(app)
    if not arguments or arguments[0].startswith("-"):
        return
    command = group.get_command(None, arguments[0])
    assert command is not None, arguments
    if arguments[1:]:
        command.make_context(arguments[0], arguments[1:])


def test_the_front_page_has_the_numbers_of_the_landed_metrics():
    """Of every method: successes and median distance with their intervals, and how it compares with ours."""
    methods = json.loads((ROOT / "metrics/imitation.json").read_text(encoding="utf-8"))
    with (ROOT / "metrics/plots/differences.csv").open(encoding="utf-8") as file:
        contrasts = list(csv.DictReader(file))
    expected = []
    for (cell, numbers), contrast in zip(methods.items(), [None, *contrasts], strict=True):
        rate = [100 * numbers[f"success_rate{bound}"] for bound in ("", "_low", "_high")]
        metres = [100 * numbers[f"final_distance_median{bound}"] for bound in ("", "_low", "_high")]
        count, compared = round(numbers["success_rate"] * numbers["runs"]), "–"
        if contrast:
            ratio, p = float(contrast["ratio"]), float(contrast["p"])
            told = "p < 0.001" if p < 0.001 else f"p {p:.3g}" if p < 0.05 else f"open, p {p:.3g}"
            compared = f"{ratio:.2g} ({told})"
        success = "{}/{}, {:.0f}% [{:.0f}, {:.0f}]".format(count, numbers["runs"], *rate)
        expected.append((cell, success, "{:.1f} [{:.1f}, {:.1f}]".format(*metres), compared))
    page = (ROOT / "README.md").read_text(encoding="utf-8")
    assert re.findall(r"^\| \**`([\w-]+)`.* \| (\d+/.*?) \| (.*?) \| (.*?) \|$", page, re.M) == expected


def test_the_front_page_has_the_numbers_of_what_goes_beyond_the_thesis():
    """Of every question that it answers, and of the real clips among its limits."""
    beyond = json.loads((ROOT / "beyond/metrics/beyond.json").read_text(encoding="utf-8"))
    real = json.loads((ROOT / "metrics/translation.json").read_text(encoding="utf-8"))
    page = " ".join((ROOT / "README.md").read_text(encoding="utf-8").split())

    def count(numbers: dict[str, float], rate: str = "success_rate") -> str:
        return f"{round(numbers[rate] * numbers['runs'])}/{numbers['runs']:.0f}"

    def centimetres(numbers: dict[str, float]) -> str:
        return f"{100 * numbers['final_distance_median']:.1f} cm"

    choice, methods, tasks = beyond["choice"], beyond["imitation"], beyond["tasks"]
    shown, oracle, clock = (
        count(choice[cell], "shown_rate") for cell in ("choice", "choice-oracle", "choice-clock")
    )
    other = count(choice["choice"], "other_rate").split("/")[0]
    human, xirl = methods["human"], methods["human-xirl"]
    ours, true = (
        ", ".join(count(tasks[f"{task}{end}"]) for task in ("reach", "strike", "sweep"))
        for end in ("", "-oracle")
    )
    placed = {
        (cell, clips): f"{100 * real[cell][clips]['placed']:.0f}%"
        for cell in ("real-adam", "real-pretrained")
        for clips in ("validation", "extreme")
    }
    told = [
        f"{shown} end at the shown goal, {other} at the other; "
        f"{oracle} by the true view, {clock} by the clock",
        f"{count(human)}, median {centimetres(human)}; {count(xirl)}, {centimetres(xirl)}",
        f"{ours} ({true})",
        f"in {placed['real-adam', 'validation']} of held-out frames",
        f"has {placed['real-pretrained', 'validation']}, and {placed['real-pretrained', 'extreme']} where",
    ]
    study = json.loads((ROOT / "docs/study/beyond/beyond.json").read_text(encoding="utf-8"))
    chosen = [
        count(study["choice"][cell], "shown_rate") for cell in ("choice", "choice-oracle", "choice-clock")
    ]
    wrong = round(30 * study["choice"]["choice"]["other_rate"])
    ours, true = (
        ", ".join(count(study["tasks"][f"{task}{end}"]) for task in ("reach", "strike", "sweep"))
        for end in ("", "-oracle")
    )
    human = study["imitation"]["human"]
    clips = [
        ", ".join(count(numbers["clips"][cell]) for cell in ("clips-1", "clips-20", "clips-two-thirds"))
        for numbers in (beyond, study)
    ]
    angles = [
        ", ".join(count(numbers["viewpoints"]["angles"][angle]) for angle in ("0", "180"))
        for numbers in (beyond, study)
    ]
    told += [
        f"| {chosen[0]}, {wrong}; {chosen[1]}, {chosen[2]} |",
        f"| {count(human)}, median {centimetres(human)}; not run |",
        f"| {ours} ({true}) |",
        f"| {clips[0]} | {clips[1]} |",
        f"| {angles[0]} | {angles[1]} |",
    ]
    assert [line for line in told if line not in page] == []
