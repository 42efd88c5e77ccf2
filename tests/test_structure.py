"""The house rules of the layout: who may import whom, and that dvc.yaml tells the truth about the stages."""

import ast
import importlib.metadata
import re
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from functools import cache
from itertools import product
from pathlib import Path

import pytest
from dvc.dependency.param import ParamsDependency
from dvc.repo import Repo

from anyview.config import load_params
from anyview.paths import CLUTTER, EVALUATIONS
from anyview.pusher.task import task_names

ROOT = Path(__file__).parents[1]
SOURCE = ROOT / "src"

# Code that serves a stage without changing what it makes: an edit of it must not retrain anything.
WITHOUT_EFFECT_ON_RESULTS = ("src/anyview/config/", "src/anyview/paths.py", "src/anyview/runtime/")


def parse(path: Path) -> list[ast.AST]:
    """Every node of a module but those that only a type checker sees."""

    def walk(node: ast.AST) -> Iterator[ast.AST]:
        yield node
        for child in ast.iter_child_nodes(node):
            if not (isinstance(child, ast.If) and ast.unparse(child.test) == "TYPE_CHECKING"):
                yield from walk(child)

    return list(walk(ast.parse(path.read_text(encoding="utf-8"))))


def imported_names(path: Path) -> Iterator[str]:
    """Dotted names of all that a module imports, ``from a import b`` giving ``a.b``."""
    for node in parse(path):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


@cache
def our_imports(path: Path) -> frozenset[Path]:
    """Files of ours that a module imports itself."""
    return frozenset(found for name in imported_names(path) if (found := _file_of(name)) is not None)


def _file_of(name: str) -> Path | None:
    """The file of the module ``name``, or of the module that holds the attribute ``name``."""
    if not name.startswith("anyview"):
        return None
    for parts in (name.split("."), name.split(".")[:-1]):
        path = SOURCE.joinpath(*parts)
        if path.with_suffix(".py").is_file():
            return path.with_suffix(".py")
        if (path / "__init__.py").is_file():
            return path / "__init__.py"
    raise AssertionError(f"{name}: no such module")


def reached_from(path: Path) -> set[str]:
    """Files of ours that can run when ``path`` does, itself included, relative to the root."""
    reached, ahead = {path}, [path]
    while ahead:
        for found in our_imports(ahead.pop()) - reached:
            reached.add(found)
            ahead.append(found)
    return {str(file.relative_to(ROOT)) for file in reached}


TASKS = {f"src/anyview/tasks/{name}.py" for name in task_names()}
"""Loaded by name, by what imports `load_task`."""

TESTS_OF_A_WHOLE = {"test_browser.py", "test_kills.py", "test_resume.py"}

MODULES = sorted(SOURCE.rglob("*.py"))
STAGES = sorted((ROOT / "stages").glob("*.py"))
# DVC repositories of their own, with links to params, code and what they need of the study.
EVIDENCE, BEYOND = ROOT / "evidence", ROOT / "beyond"


def test_imports_point_one_way():
    """By the contracts in pyproject.toml, which `make lint` checks too."""
    command = [Path(sys.executable).parent / "lint-imports", "--no-logo", "--no-cache"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout


def test_every_import_is_declared():
    """Packages that src or stages import are dependencies in pyproject.toml, and these are imported."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]

    def names(requirements: list[str]) -> set[str]:
        return {re.split(r"[^\w.-]", text)[0].lower().replace("_", "-") for text in requirements}

    required = names(project["dependencies"])
    distributions = importlib.metadata.packages_distributions()
    used = {name.split(".")[0] for path in [*MODULES, *STAGES] for name in imported_names(path)}
    used -= {"anyview", *sys.stdlib_module_names}
    owners = {
        name: {dist.lower().replace("_", "-") for dist in distributions.get(name, [name])} for name in used
    }
    extras = project["optional-dependencies"]
    optional = names([*extras["cluster"], *extras["lerobot"], *extras["share"]])
    assert {name for name, found in owners.items() if not found & (required | optional)} == set()
    assert required - set().union(*owners.values()) == set()


@cache
def declared(folder: Path = ROOT) -> dict[str, tuple[set[str], set[str]]]:
    """A dvc.yaml as DVC reads it: address of a stage -> (dependencies, outputs), relative to its folder."""
    with Repo(str(folder)) as repo:
        return {
            stage.name: (
                {
                    str(Path(dep.fs_path).relative_to(folder))
                    for dep in stage.deps
                    if not isinstance(dep, ParamsDependency)
                },
                {str(Path(out.fs_path).relative_to(folder)) for out in stage.outs},
            )
            for stage in repo.index.stages
        }


def code_of(stage: str, folder: Path) -> dict[str, set[str]]:
    """Code that the cells of ``stage`` declare, files and folders."""
    cells = {name: deps for name, (deps, _) in declared(folder).items() if name.split("@")[0] == stage}
    assert cells, f"{stage}: not in dvc.yaml"
    other = ("data/", "params.yaml", "stages/pipeline.yaml", "pipeline.yaml")
    return {name: {dep for dep in deps if not dep.startswith(other)} for name, deps in cells.items()}


def test_the_report_depends_on_the_pipeline_that_it_draws():
    """By a link: DVC does not take a dvc.yaml itself for a dependency."""
    for folder, link in ((ROOT, "stages/pipeline.yaml"), (BEYOND, "pipeline.yaml")):
        assert link in declared(folder)["report"][0]
        assert (folder / link).resolve() == folder / "dvc.yaml"


def covers(dependency: str, file: str) -> bool:
    """Whether an edit of ``file`` is an edit of ``dependency``, a file or a folder."""
    return file == dependency or file.startswith(f"{dependency}/")


SCRIPTS = [
    *((path, ROOT) for path in STAGES if path.stem != "rank"),
    *((BEYOND / f"{name}.py", BEYOND) for name in ("train", "embed")),
    *((path, EVIDENCE) for path in sorted(EVIDENCE.glob("*/*.py"))),
    *(
        (BEYOND / "stages" / f"{name}.py", BEYOND)
        for name in ("simulate", "split", "translate", "imitate", "rank", "report")
    ),
]


@pytest.mark.parametrize(("script", "folder"), SCRIPTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_a_stage_depends_on_the_code_that_it_runs(script, folder):
    """No edit goes unnoticed, and no folder is declared that the stage does not use.

    Cells may differ where each runs code of its own (a learner, a reward); together they name all of it.
    """
    reached = reached_from(script)
    if "src/anyview/pusher/task.py" in reached:
        reached |= TASKS if folder == BEYOND else {"src/anyview/tasks/push.py"}
    reached = {
        file
        for file in reached
        if not file.startswith(WITHOUT_EFFECT_ON_RESULTS) and not file.endswith("__init__.py")
    }
    own = str(script.relative_to(folder))
    reached = {own if file == str(script.relative_to(ROOT)) else file for file in reached}
    # In evidence/ each part has a folder of scripts.
    stage = f"{script.parent.name}-{script.stem}" if folder == EVIDENCE else script.stem
    cells = code_of(stage, folder)
    together = set().union(*cells.values())
    if folder == BEYOND and script.stem == "imitate":
        reached -= {"src/anyview/learners/trpo.py"}  # no cell has it
    if script.stem == "discriminate":
        reached -= {"src/anyview/learners/ddpg.py"}  # nor this
    assert {file for file in reached if not any(covers(dependency, file) for dependency in together)} == set()
    assert {dep for dep in together if not any(covers(dep, file) for file in reached)} == set()
    for name, code in cells.items():
        assert own in code, name


def rerun_by(file: str) -> set[str]:
    """Stages that an edit of ``file`` reruns, by dvc.yaml, with those behind them."""
    stages = {address: deps for address, (deps, _) in declared().items()}
    found = {address for address, deps in stages.items() if any(covers(dep, file) for dep in deps)}
    assert (ROOT / file).is_file()
    while True:
        outputs = {out for address in found for out in declared()[address][1]}
        behind = {address for address, deps in stages.items() if deps & outputs} - found
        if not behind:
            return found
        found |= behind


def test_an_edit_reruns_no_more_than_it_must():
    """Where a rerun takes minutes, dependencies are finer than folders."""
    params = load_params(ROOT / "params.yaml")
    learners = {name: cell.learner for name, cell in params.methods.items()}
    for learner, other in (("ddpg", "trpo"), ("trpo", "ddpg")):
        again = {name.partition("@")[2] for name in rerun_by(f"src/anyview/learners/{learner}.py")} - {""}
        assert {learners[name] for name in again} == {learner}
        assert other not in {learners[name] for name in again}
    for reward in ("gail", "tpil"):
        assert rerun_by(f"src/anyview/adversarial/{reward}.py") == {f"discriminate@{reward}", "report"}
    embedded = {name.split("@")[0] for name in rerun_by("src/anyview/training/embedding.py")}
    assert embedded == {"embed", "imitate", "report"}
    assert "embed" not in {name.split("@")[0] for name in rerun_by("src/anyview/training/translator.py")}
    assessed = rerun_by("src/anyview/assessment/similarity.py")
    assert {name.split("@")[0] for name in assessed} == {"translate", "report"}
    for folder in ("report", "analysis"):
        assert rerun_by(f"src/anyview/{folder}/__init__.py") == {"report"}


def test_every_stage_has_a_script_and_every_script_a_stage():
    stages = {name.split("@")[0] for folder in (ROOT, BEYOND) for name in declared(folder)}
    assert stages == {path.stem for path in STAGES}


def test_the_study_knows_nothing_of_the_evidence_and_this_plans_every_seed():
    assert not any("-seed-" in out for _, outs in declared().values() for out in outs)
    evidence = load_params(ROOT / "params.yaml").evidence
    losses, diversity, headline = evidence.losses, evidence.diversity, evidence.headline
    policies = {
        f"{name}-seed-{seed}-{reward}"
        for name, seed, reward in product(losses.translators, losses.seeds, losses.rewards)
    }
    policies |= {
        f"{name}-seed-{seed}-{reward}"
        for name, seed, reward in product(losses.translators, losses.others.seeds, losses.others.rewards)
    }
    sets = {f"views-{views}-{clutter}" for views, clutter in product(diversity.views, CLUTTER)}
    policies |= {
        f"{name}-{count}-seed-{seed}-{evaluation}"
        for name, count, seed, evaluation in product(
            sets, diversity.demonstrations, diversity.seeds, EVALUATIONS
        )
    }
    models = {found[0] for policy in policies if (found := re.match(r".*-seed-\d+", policy))}
    for cells, trained in (
        (policies, headline.cells),
        (models, [headline.translator, headline.embedding]),
    ):
        cells |= {f"headline-{name}-seed-{seed}" for name, seed in product(trained, headline.seeds)}
    outputs = {f"data/models/{model}" for model in models} | {f"data/policies/{name}" for name in policies}
    outputs |= {f"data/clips/{name}" for name in sets} | {f"data/splits/{name}.csv" for name in sets}
    assert set().union(*(outs for _, outs in declared(EVIDENCE).values())) == outputs


@pytest.mark.parametrize("folder", [ROOT, BEYOND, EVIDENCE], ids=["study", "beyond", "evidence"])
def test_git_ignores_what_stages_make(folder):
    """By the file at the root, whatever DVC has added to those beside the outputs."""
    made = {out for _, outs in declared(folder).values() for out in outs if out.startswith("data/")}
    paths = {f"{(folder / out).relative_to(ROOT)}{'' if Path(out).suffix else '/'}" for out in made}
    rules = subprocess.run(
        ["git", "check-ignore", "--verbose", *paths], cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout.splitlines()
    ignored = {rule.split("\t")[1] for rule in rules if rule.startswith(".gitignore:")}
    assert ignored == paths


def test_cells_are_those_of_params():
    params = load_params(ROOT / "params.yaml")
    cells: dict[str, set[str]] = {}
    for folder in (ROOT, BEYOND):
        for address in declared(folder):
            stage, _, cell = address.partition("@")
            cells.setdefault(f"beyond {stage}" if folder == BEYOND else stage, set()).add(cell)
    beyond = params.beyond
    for stage, named in (
        ("simulate", beyond.sets),
        ("split", beyond.split),
        ("train", beyond.translators),
        ("translate", beyond.translators),
        ("embed", beyond.embeddings),
        ("imitate", beyond.cells),
    ):
        assert cells[f"beyond {stage}"] == set(named)
    assert cells["simulate"] == set(params.simulate.sets)
    assert cells["split"] == set(params.split)
    assert cells["train"] == cells["translate"] == set(params.translators)
    assert cells["embed"] == set(params.embeddings)
    assert cells["imitate"] == set(params.imitation.cells)
    assert cells["discriminate"] == set(params.adversarial.cells)


def test_every_ranked_reward_is_ranked_again_when_its_cell_or_model_changes():
    params = load_params(ROOT / "params.yaml")
    methods = {**params.methods, **params.beyond.cells}
    with Repo(str(BEYOND)) as repo:
        (stage,) = (stage for stage in repo.index.stages if stage.name == "rank")
        read = set().union(*(dep.params for dep in stage.deps if isinstance(dep, ParamsDependency)))
    blocks = {name: f"imitation.cells.{name}" for name in params.imitation.cells}
    blocks |= dict.fromkeys(params.adversarial.cells, "adversarial")
    blocks |= {name: f"beyond.cells.{name}" for name in params.beyond.cells}
    assert {f"imitation.{cell.learner}" for cell in params.adversarial.cells.values()} <= read
    assert {blocks[name] for name in params.beyond.ranking.methods} <= read
    models = {
        methods[name].model for name in params.beyond.ranking.methods if name not in params.adversarial.cells
    }
    assert {f"data/models/{model}" for model in models} <= declared(BEYOND)["rank"][0]


@pytest.mark.parametrize(
    ("folder", "unread", "from_the_study"),
    [
        (ROOT, {"data/clips/rendered", "data/splits/rendered.csv"}, set()),
        (BEYOND, {"data/models/xirl"}, {"data/policies/ours", "data/clips/real"}),
    ],
    ids=["study", "beyond"],
)
def test_the_report_reads_every_cell(folder, unread, from_the_study):
    """Its inputs are written out one by one: none may be forgotten, and none may be left over."""
    outputs = {out for address, (_, outs) in declared(folder).items() if address != "report" for out in outs}
    data = {dep for dep in declared(folder)["report"][0] if dep.startswith("data/")}
    assert outputs - data == unread
    assert data - outputs == from_the_study


def test_outputs_are_one_folder_or_table_a_cell():
    """A consumer that names a file in an output, or a folder above it, would be told "up to date" wrongly."""
    outputs = [Path(out) for _, outs in declared().values() for out in outs]
    assert len(outputs) == len(set(outputs))
    for address, (deps, _) in declared().items():
        for dep in deps:
            if dep.startswith("data/") and dep != "data/raw/recorded":
                assert Path(dep) in outputs, f"{address}: {dep}"


@pytest.mark.parametrize(
    "path", sorted((ROOT / "tests").rglob("test_*.py")), ids=lambda path: str(path.relative_to(ROOT))
)
def test_tests_mirror_the_source(path):
    """tests/sim/test_batch.py tests src/anyview/pusher/batch.py, a module or a package: easy to find."""
    relative = path.relative_to(ROOT / "tests")
    if len(relative.parts) == 1 or relative.name in TESTS_OF_A_WHOLE:
        return
    folder = SOURCE / "anyview" / relative.parent
    there = {module.stem for module in folder.rglob("*.py")} | {each.name for each in folder.rglob("*")}
    assert set(relative.stem.removeprefix("test_").split("_and_")) <= there


def test_there_are_no_catch_all_modules():
    assert [path for path in MODULES if path.stem in ("utils", "helpers", "misc", "common")] == []
