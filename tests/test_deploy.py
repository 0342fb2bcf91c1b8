"""The files of deploy/ and docker-compose.yml, held in step with each other and with the settings."""

from __future__ import annotations

import re
import shlex
import socket
import tomllib
from collections.abc import Iterator
from copy import deepcopy
from pathlib import Path
from typing import Any

import pytest
import yaml

from service.cli.serve import _commands
from worker.queues import JOBS_QUEUE, TAKEN_ALONG
from worker.settings import Settings

ROOT = Path(__file__).parents[1]
DEPLOY = ROOT / "deploy"
BASE = DEPLOY / "base"
COMPOSE = yaml.safe_load((ROOT / "docker-compose.yml").read_text())
KUSTOMIZATION = yaml.safe_load((BASE / "kustomization.yaml").read_text())
SETTINGS = {f"GCVEC_{name}".upper() for name in Settings.model_fields}


def documents(folder: Path) -> list[dict[str, Any]]:
    files = [file for file in sorted(folder.glob("*.yaml")) if file.name != "kustomization.yaml"]
    return [document for file in files for document in yaml.safe_load_all(file.read_text())]


def workloads() -> dict[str, dict[str, Any]]:
    kinds = ("Deployment", "StatefulSet")
    return {found["metadata"]["name"]: found for found in documents(BASE) if found["kind"] in kinds}


WORKLOADS = workloads()


def pod(name: str) -> dict[str, Any]:
    template: dict[str, Any] = WORKLOADS[name]["spec"]["template"]
    return template


def container(name: str) -> dict[str, Any]:
    (found,) = pod(name)["spec"]["containers"]
    return dict(found)


def literals(folder: str) -> dict[str, str]:
    (config,) = yaml.safe_load((DEPLOY / folder / "kustomization.yaml").read_text())["configMapGenerator"]
    return dict(literal.split("=", 1) for literal in config["literals"])


def test_every_file_is_a_resource_and_every_resource_a_file() -> None:
    assert {file.name for file in BASE.glob("*.yaml")} == {*KUSTOMIZATION["resources"], "kustomization.yaml"}
    (base,) = yaml.safe_load((DEPLOY / "s3" / "kustomization.yaml").read_text())["resources"]
    assert (DEPLOY / "s3" / base).resolve() == BASE
    version = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]
    assert KUSTOMIZATION["images"] == [{"name": "gcvec", "newName": "gcvec", "newTag": version}]


def test_the_same_runs_in_both() -> None:
    services = COMPOSE["services"]
    assert set(WORKLOADS) == set(services)
    for name in set(services) - {"redis"}:
        assert container(name)["command"] == shlex.split(services[name]["command"])
    assert container("redis")["image"] == services["redis"]["image"]
    assert set(shlex.split(services["redis"]["command"])) <= set(container("redis")["command"])


def test_the_same_runs_on_one_machine() -> None:
    """Workers there have names of their own, and none needs to hear from another."""
    containers = {
        name: shlex.split(service["command"])
        for name, service in COMPOSE["services"].items()
        if name != "redis"
    }
    with socket.socket() as listener:
        api, *workers = _commands({}, listener, 1)
    assert {worker.name for worker in workers} == set(containers) - {"api"}
    assert list(api.arguments[1:-1]) == containers["api"][1:-1]
    for worker in workers:
        _, _, *line = worker.arguments
        place = line.index("--hostname")
        assert line[place : place + 2] == ["--hostname", f"{worker.name}@%h"]
        del line[place : place + 2]
        line.remove("--without-heartbeat")
        assert sorted(line) == sorted(containers[worker.name])


@pytest.mark.parametrize("name", sorted({*COMPOSE["services"]} - {"redis"}))
def test_containers_get_every_setting(name: str) -> None:
    """Those of `.env`, which what is written here must not override; the broker is one of the containers."""
    service = COMPOSE["services"][name]
    assert service["env_file"] == [{"path": ".env", "required": False}]
    for setting, value in service["environment"].items():
        assert setting == "GCVEC_BROKER_URL" or value.startswith(f"${{{setting}:"), setting


def named(text: str) -> set[str]:
    return set(re.findall(r"\bGCVEC_[A-Z_]+", text))


@pytest.mark.parametrize(
    "file",
    [
        "docker-compose.yml",
        "Dockerfile",
        "docs/operations.md",
        "docs/security.md",
        *(str(file.relative_to(ROOT)) for file in sorted(DEPLOY.rglob("*")) if file.is_file()),
    ],
)
def test_only_settings_there_are_are_named(file: str) -> None:
    assert named((ROOT / file).read_text()) <= SETTINGS


def test_configured_values_are_valid() -> None:
    for folder in ("base", "s3"):
        ours = {name: value for name, value in literals(folder).items() if name.startswith("GCVEC_")}
        Settings.model_validate({name.removeprefix("GCVEC_").lower(): ours[name] for name in ours})
    example = dict(
        line.split("=", 1)
        for line in (BASE / "secrets.env.example").read_text().splitlines()
        if not line.startswith("#")
    )
    assert len(Settings(api_keys=example["GCVEC_API_KEYS"]).api_keys) == 1
    assert set(example) == {"GCVEC_API_KEYS", "REDIS_PASSWORD"}


@pytest.mark.parametrize("name", WORKLOADS)
def test_pods_may_do_nothing_they_need_not(name: str) -> None:
    spec, found = pod(name)["spec"], container(name)
    assert spec["securityContext"]["runAsNonRoot"]
    assert spec["securityContext"]["runAsUser"] > 0
    assert spec["securityContext"]["seccompProfile"] == {"type": "RuntimeDefault"}
    assert spec["automountServiceAccountToken"] is False
    assert found["securityContext"] == {
        "allowPrivilegeEscalation": False,
        "readOnlyRootFilesystem": True,
        "capabilities": {"drop": ["ALL"]},
    }
    assert "memory" in found["resources"]["limits"]
    assert {"cpu", "memory"} <= set(found["resources"]["requests"])
    assert {"startupProbe", "livenessProbe"} <= set(found)
    volumes = {volume["name"] for volume in spec.get("volumes", [])}
    volumes |= {
        claim["metadata"]["name"] for claim in WORKLOADS[name]["spec"].get("volumeClaimTemplates", [])
    }
    assert {mount["name"] for mount in found["volumeMounts"]} == volumes
    labels = pod(name)["metadata"]["labels"]
    assert WORKLOADS[name]["spec"]["selector"]["matchLabels"].items() <= labels.items()


def test_workers_have_what_their_work_needs() -> None:
    config = literals("base")
    queues = []
    for name in ("worker", "short", "webhooks"):
        found = container(name)
        queues.append(found["command"][found["command"].index("--queues") + 1])
        environment = {variable["name"]: variable.get("value") for variable in found["env"]}
        caches = re.findall(r"NUMBA_CACHE_DIR=(\S+)", (ROOT / "Dockerfile").read_text())
        assert [environment["NUMBA_CACHE_DIR"]] == caches
        assert any(Path(caches[0]).is_relative_to(mount["mountPath"]) for mount in found["volumeMounts"])
    assert sorted(queues) == sorted(TAKEN_ALONG)
    limit = container("worker")["resources"]["limits"]["memory"]
    assert float(limit.removesuffix("Gi")) * 2**30 > int(config["GCVEC_JOB_MEMORY_BYTES"])
    assert pod("worker")["spec"]["terminationGracePeriodSeconds"] > int(config["GCVEC_JOB_SECONDS"])


def test_redis_is_full_before_the_kernel_kills_it() -> None:
    found = container("redis")
    most = found["command"][found["command"].index("--maxmemory") + 1]
    limit = found["resources"]["limits"]["memory"]
    assert float(most.removesuffix("mb")) * 2**20 < 0.75 * float(limit.removesuffix("Gi")) * 2**30


def test_the_bucket_variant_takes_away_the_volume_and_nothing_else() -> None:
    patches = yaml.safe_load((DEPLOY / "s3" / "kustomization.yaml").read_text())["patches"]
    claim, unmount = (yaml.safe_load(patch["patch"]) for patch in patches)
    assert claim["metadata"]["name"] == "files"
    assert claim["$patch"] == "delete"
    for name in set(WORKLOADS) - {"redis"}:
        manifest: Any = deepcopy(WORKLOADS[name])
        for step in unmount:
            *path, last = list(steps(step["path"]))
            place = manifest
            for key in path:
                place = place[key]
            if step["op"] == "test":
                assert place[last] == step["value"]
            else:
                place[last] = None
        left = manifest["spec"]["template"]["spec"]
        assert [volume["name"] for volume in left["volumes"] if volume] == ["scratch"]
        assert [mount["name"] for mount in left["containers"][0]["volumeMounts"] if mount] == ["scratch"]


def steps(path: str) -> Iterator[str | int]:
    for step in path.strip("/").split("/"):
        yield int(step) if step.isdigit() else step


def test_workers_are_scaled_by_the_queue_of_jobs() -> None:
    _, scaled, _ = documents(DEPLOY / "autoscaling")
    assert scaled["spec"]["scaleTargetRef"]["name"] in WORKLOADS
    (trigger,) = scaled["spec"]["triggers"]
    assert trigger["metadata"]["listName"] == JOBS_QUEUE


def test_every_setting_is_explained_for_operators() -> None:
    text = (ROOT / "docs" / "operations.md").read_text()
    rows = re.findall(r"^\| `(GCVEC_\w+)` \| (?:`(.*?)`)? *\|", text, re.MULTILINE)
    assert [name for name, _ in rows] == [f"GCVEC_{name}".upper() for name in Settings.model_fields]
    for name, shown in rows:
        field = name.removeprefix("GCVEC_").lower()
        default = Settings.model_validate({field: shown}) if shown else Settings()
        assert getattr(default, field) == Settings.model_fields[field].default, name


def test_every_metric_and_every_test_named_in_the_documents_exists() -> None:
    metrics = set(re.findall(r'"(gcvec_\w+)"', (ROOT / "service/health/metrics.py").read_text()))
    operations = (ROOT / "docs" / "operations.md").read_text()
    shown = {name.removesuffix("_total") for name in re.findall(r"`(gcvec_\w+)", operations)}
    assert shown == metrics
    for document in ("operations.md", "security.md"):
        for file, test in re.findall(
            r"`(tests/[\w/]+\.py)(?:::(\w+))?`", (ROOT / "docs" / document).read_text()
        ):
            assert f"def {test}" in (ROOT / file).read_text(), f"{document}: {file}::{test}"
