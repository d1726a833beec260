"""Checks what must agree between the files of the project: version, citation, workflows."""

import re

import yaml

from building import environment, release
from tests.docs.pages import ROOT


def read_yaml(path):
    return yaml.safe_load((ROOT / path).read_text(encoding="utf-8"))


def test_the_changelog_has_the_version():
    assert release.changelog() == environment.manifest()["version"]


def test_the_citation_names_this_version():
    citation = read_yaml("CITATION.cff")
    assert citation["version"] == environment.manifest()["version"]
    changelog = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert f"## {citation['version']} – {citation['date-released']}" in changelog
    assert "Physics-Informed Neural Networks" in citation["references"][0]["title"]


def test_workflows_call_the_build_script_only():
    for path in (ROOT / ".github" / "workflows").glob("*.yml"):
        for job in read_yaml(path.relative_to(ROOT))["jobs"].values():
            runs = [step["run"] for step in job["steps"] if "run" in step]
            assert runs and all(re.match(r"python build\.py |gh release ", run) for run in runs)


def test_issue_forms_and_hooks_are_valid():
    for path in (ROOT / ".github" / "ISSUE_TEMPLATE").glob("[!c]*.yml"):
        form = read_yaml(path.relative_to(ROOT))
        assert {"name", "description", "body"} <= form.keys()
    hooks = read_yaml(".pre-commit-config.yaml")["repos"][0]["hooks"]
    assert {hook["id"] for hook in hooks} == {"ruff-check", "ruff-format", "mypy"}
