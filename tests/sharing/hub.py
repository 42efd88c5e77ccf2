"""A model hub on this machine: the endpoints that huggingface_hub uses, with files in memory."""

import base64
import hashlib
import json
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from flask import Flask, Response, request
from werkzeug.serving import make_server

TOKEN = "hf_secret"
SMALL = 1000  # bytes: larger files go by Git LFS


class Hub:
    """Repositories by name, each a list of commits; a commit is its files by path."""

    def __init__(self) -> None:
        self.address = ""
        self.repos: dict[str, list[dict[str, bytes]]] = {}
        self._large: dict[str, bytes] = {}

    def files(self, repo: str) -> dict[str, bytes]:
        """The files of the newest commit."""
        return self.repos[repo][-1]

    def app(self) -> Flask:
        app = Flask("hub")

        @app.before_request
        def _known() -> Response | None:
            known = request.headers.get("Authorization") == f"Bearer {TOKEN}"
            if request.method == "POST" and not known:
                return Response("{}", 401, {"X-Error-Message": "Invalid username or password."})
            repo = (request.view_args or {}).get("repo")
            if repo and repo not in self.repos:
                return Response("{}", 404, {"X-Error-Code": "RepoNotFound"})
            return None

        @app.post("/api/repos/create")
        def _create() -> Any:
            repo = f"{request.json['organization']}/{request.json['name']}"
            if repo in self.repos:
                return {"url": f"{self.address}/{repo}"}, 409
            self.repos[repo] = [{}]
            return {"url": f"{self.address}/{repo}"}

        @app.post("/api/validate-yaml")
        def _validate() -> Any:
            good = "\nlicense: " in request.json["content"].split("---\n")[1]
            return {
                "errors": [] if good else [{"message": "no licence"}],
                "warnings": [],
            }, 200 if good else 400

        @app.get("/api/models/<path:repo>/revision/<revision>")
        @app.get("/api/models/<path:repo>", defaults={"revision": "main"})
        def _info(repo: str, revision: str) -> Any:
            commit = self._commit(repo, revision)
            files = [{"rfilename": path} for path in self.repos[repo][commit]]
            return {"id": repo, "sha": f"{commit:040x}", "siblings": files, "tags": [], "downloads": 0}

        @app.get("/api/models/<path:repo>/tree/<revision>")
        def _tree(repo: str, revision: str) -> Any:
            files = self.repos[repo][self._commit(repo, revision)]
            return [
                {"type": "file", "path": path, "size": len(content), "oid": _blob(content)}
                for path, content in files.items()
            ]

        @app.post("/api/models/<path:repo>/preupload/<revision>")
        def _modes(repo: str, revision: str) -> Any:
            modes = [
                {
                    "path": file["path"],
                    "uploadMode": "lfs" if file["size"] > SMALL else "regular",
                    "shouldIgnore": False,
                }
                for file in request.json["files"]
            ]
            return {"files": modes}

        @app.post("/<path:repo>.git/info/lfs/objects/batch")
        def _batch(repo: str) -> Any:
            objects = [
                each | {"actions": {"upload": {"href": f"{self.address}/large/{each['oid']}"}}}
                for each in request.get_json(force=True)["objects"]
            ]
            return {"transfer": "basic", "objects": objects}

        @app.put("/large/<oid>")
        def _large(oid: str) -> str:
            self._large[oid] = request.get_data()
            assert hashlib.sha256(self._large[oid]).hexdigest() == oid
            return ""

        @app.post("/api/models/<path:repo>/commit/<revision>")
        def _commit(repo: str, revision: str) -> Any:
            files = dict(self.files(repo))
            for line in request.get_data().splitlines():
                operation = json.loads(line)
                value = operation["value"]
                if operation["key"] == "file":
                    files[value["path"]] = base64.b64decode(value["content"])
                elif operation["key"] == "lfsFile":
                    files[value["path"]] = self._large[value["oid"]]
                elif operation["key"] == "deletedFile":
                    del files[value["path"]]
            self.repos[repo].append(files)
            oid = f"{len(self.repos[repo]) - 1:040x}"
            return {"commitUrl": f"{self.address}/{repo}/commit/{oid}", "commitOid": oid}

        @app.get("/<path:repo>/resolve/<revision>/<path:path>")
        def _file(repo: str, revision: str, path: str) -> Any:
            commit = self._commit(repo, revision)
            content = self.repos[repo][commit][path]
            return Response(
                content, headers={"ETag": f'"{_blob(content)}"', "X-Repo-Commit": f"{commit:040x}"}
            )

        return app

    def _commit(self, repo: str, revision: str) -> int:
        return len(self.repos[repo]) - 1 if revision == "main" else int(revision, 16)


def _blob(content: bytes) -> str:
    return hashlib.sha1(b"blob %d\0" % len(content) + content).hexdigest()


@contextmanager
def running_hub() -> Iterator[Hub]:
    """A hub that answers at ``address``."""
    hub = Hub()
    server = make_server("127.0.0.1", 0, hub.app(), threaded=True)
    hub.address = f"http://127.0.0.1:{server.server_port}"
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    yield hub
    server.shutdown()
    thread.join()
