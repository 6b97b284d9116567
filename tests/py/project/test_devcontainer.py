"""The devcontainer names what exists. No container is started: the machines that run the tests have no Docker."""

from __future__ import annotations

import json
import os
import re
import subprocess
from pathlib import Path

ROOT = Path(__file__).parents[3]
FOLDER = ROOT / ".devcontainer"


def test_it_names_files_and_targets_that_exist() -> None:
    config = json.loads((FOLDER / "devcontainer.json").read_text(encoding="utf-8"))
    dockerfile = FOLDER / config["build"]["dockerfile"]
    context = (FOLDER / config["build"]["context"]).resolve()
    assert context == ROOT
    for source in re.findall(r"^COPY (\S+)", dockerfile.read_text(encoding="utf-8"), re.MULTILINE):
        assert (context / source).is_file(), source
    targets = re.findall(r"make (?:-j\S+ )?(\w+)", config["postCreateCommand"])
    assert targets == ["setup", "all"]
    assert re.findall(r"-j(\S*)", config["postCreateCommand"]) == ["$(nproc)"]  # -j alone compiles all files at once
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    assert all(re.search(rf"^{target}:", makefile, re.MULTILINE) for target in targets)
    folder = config["workspaceFolder"]
    assert config["workspaceMount"].split(",")[1] == f"target={folder}"
    assert config["customizations"]["vscode"]["settings"]["python.defaultInterpreterPath"].startswith(f"{folder}/.venv")


def test_its_packages_are_those_that_setup_finds_missing() -> None:
    text = (FOLDER / "Dockerfile").read_text(encoding="utf-8")
    (command,) = re.findall(r"\$\(/tmp/psabench/(tools/setup [\w ]+)\)", text)
    bare = os.environ | {"PKG_CONFIG_LIBDIR": "/nonexistent"}  # a machine without libraries
    done = subprocess.run(command.split(), cwd=ROOT, env=bare, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    assert {"libcjson-dev", "libfyaml-dev", "libcmocka-dev"} <= set(done.stdout.split())
