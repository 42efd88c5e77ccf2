"""Stage `ingest`: raw clips, surrogate or recorded, into small even ones, and the refused with the reason."""

import shutil

from anyview import paths
from anyview.config import load_params
from anyview.ingest import clips as ingest
from anyview.runtime.errors import AnyviewError, refuse_arguments, run_stage
from anyview.runtime.outputs import whole_folder
from anyview.runtime.progress import track
from anyview.runtime.scratch import checkpoint_folder
from anyview.runtime.workers import run_tasks

OUTPUT = paths.clip_set(paths.REAL)


def main(arguments: list[str]) -> None:
    """Ingest every clip; a killed stage continues after the last finished one."""
    refuse_arguments(arguments, "python stages/ingest.py")
    params = load_params().real
    source, limits = paths.raw(params.source), params.ingest
    candidates = ingest.read_candidates(source)
    scratch = checkpoint_folder(["ingest", limits.model_dump()])

    verdicts = []
    tasks = [(source, scratch, candidate, limits) for candidate in candidates]
    with track("ingest", len(tasks)) as progress:
        for verdict in run_tasks(ingest.ingest_clip, tasks):
            verdicts.append(verdict)
            progress.advance()
    verdicts = ingest.resolve_pairs(candidates, verdicts)
    if all(verdict.reason for verdict in verdicts):
        for candidate, verdict in zip(candidates, verdicts, strict=True):
            print(f"{candidate.file}: {verdict.reason}")
        first = source / candidates[0].file
        raise AnyviewError(f"{first}: {verdicts[0].reason}; none of {len(verdicts)} clips can be used")
    with whole_folder(OUTPUT) as output:
        accepted, refused = ingest.publish(output, scratch, candidates, verdicts)
    shutil.rmtree(scratch)
    print(
        f"{accepted} clips accepted, {refused} refused" + (f" (see {OUTPUT}/refused.csv)" if refused else "")
    )


if __name__ == "__main__":
    run_stage(main)
