"""Checks the manifests of deploy/kubernetes as `kubectl kustomize` prints them.

    python3 tests/kubernetes/check.py FOLDER    # FOLDER has the programs `coordinator` and `worker`

Against the schemas of Kubernetes 1.29 to 1.33, without unknown fields; those of the Prometheus operator and KEDA; and for what
schemas do not say: references, ports, selectors, pod security, and options and variables that the programs have.
"""

import re
import subprocess
import sys
from pathlib import Path

import kubernetes_validate
import yaml
from cloudcoil.models.keda import v1alpha1 as keda
from cloudcoil.models.prometheus_operator import v1 as monitoring

VERSIONS = ["1.29", "1.30", "1.31", "1.32", "1.33"]
DEPLOY = Path(__file__).parents[2] / "deploy"
FOLDERS = ["workers", "service", "bake", "plaintext/service", "plaintext/bake", "example"]
CUSTOM = {
    "PodMonitor": monitoring.PodMonitor,
    "PrometheusRule": monitoring.PrometheusRule,
    "ScaledObject": keda.ScaledObject,
}
# Created by the user: deploy/README.md.
SECRETS = {"worker-tls", "coordinator-tls", "service-tls", "clients", "ingress-tls"}
NAME = "app.kubernetes.io/name"


def render(folder):
    printed = subprocess.run(["kubectl", "kustomize", DEPLOY / "kubernetes" / folder], capture_output=True, text=True)
    assert printed.returncode == 0, printed.stderr
    return [document for document in yaml.safe_load_all(printed.stdout) if document]


def check_schema(document):
    if model := CUSTOM.get(document["kind"]):
        # The model ignores unknown fields: they are missing in what it took.
        taken = model.model_validate(document).model_dump(exclude_unset=True, by_alias=True, mode="json")
        assert taken["spec"] == document["spec"], f"unknown fields: {document['spec']} became {taken['spec']}"
        return
    for version in VERSIONS:
        kubernetes_validate.validate(document, version, strict=True)


def template(document):
    spec = document["spec"]
    return spec["jobTemplate"]["spec"]["template"] if document["kind"] == "CronJob" else spec["template"]


def matches(selector, labels):
    wanted = selector.get("matchLabels", {}).items() <= labels.items()
    return wanted and all(
        one["operator"] == "In" and labels.get(one["key"]) in one["values"] for one in selector.get("matchExpressions", [])
    )


def containers(pod):
    return pod["spec"].get("initContainers", []) + pod["spec"]["containers"]


def check_pod(pod, documents, help_of):
    spec = pod["spec"]
    security = spec["securityContext"]
    assert security["runAsNonRoot"] and security["seccompProfile"] == {"type": "RuntimeDefault"}
    volumes = {volume["name"]: volume for volume in spec.get("volumes", [])}
    named = {(document["kind"], document["metadata"]["name"]): document for document in documents}
    for volume in volumes.values():
        if claim := volume.get("persistentVolumeClaim"):
            assert ("PersistentVolumeClaim", claim["claimName"]) in named, claim
        if secret := volume.get("secret"):
            assert secret["secretName"] in SECRETS, secret
    for container in containers(pod):
        hardened = container["securityContext"]
        assert hardened["readOnlyRootFilesystem"] and hardened["allowPrivilegeEscalation"] is False, container["name"]
        assert hardened["capabilities"] == {"drop": ["ALL"]}, container["name"]
        mounts = container.get("volumeMounts", [])
        claimed = pod.get("claims", set())
        assert {mount["name"] for mount in mounts} <= volumes.keys() | claimed, mounts
        variables = {variable["name"]: variable for variable in container.get("env", [])}
        for variable in variables.values():
            if key := variable.get("valueFrom", {}).get("configMapKeyRef"):
                assert key["key"] in named["ConfigMap", key["name"]]["data"], key
            path = variable.get("value") or ""
            if path.startswith("/"):
                assert any(path.startswith(mount["mountPath"]) for mount in mounts), f"{path} is on no volume"
        words = container["command"] + container.get("args", [])
        for word in words:
            if container["command"][0] != "sh":
                assert set(re.findall(r"\$\((\w+)\)", word)) <= variables.keys(), f"unknown variable in {word}"
        check_program(words, variables, help_of)
        for probe in ("startupProbe", "readinessProbe", "livenessProbe"):
            if check := container.get(probe, {}).get("exec"):
                check_program(check["command"], {}, help_of)
            if check := container.get(probe, {}).get("grpc"):
                assert check["port"] in {port["containerPort"] for port in container["ports"]}, check


def check_program(words, variables, help_of):
    """Options and variables are those of the program."""
    if words[0] not in ("/coordinator", "/worker"):
        return
    command = words[1:2] if words[0] == "/coordinator" else []
    told = help_of(words[0].strip("/"), command)
    for option in (word.split("=")[0] for word in words if word.startswith("--")):
        assert re.search(rf"{option}\b", told), f"{words[0]} has no {option}"
    for variable in variables:
        if variable.startswith(("COORDINATOR_", "WORKER_")):
            assert f"[env: {variable}" in told, f"{words[0]} does not read {variable}"


def check_relations(documents, pods):
    scaled = []
    for document in documents:
        kind, spec = document["kind"], document.get("spec", {})
        selected = [pod for pod in pods if matches(spec.get("podSelector") or spec.get("selector") or {}, labels(pod))]
        if kind == "Service":
            selected = [pod for pod in pods if spec["selector"].items() <= labels(pod).items()]
            for port in spec["ports"]:
                assert all(port["targetPort"] in ports(pod) for pod in selected), port
        if kind == "PodMonitor":
            wanted = {endpoint["port"] for endpoint in spec["podMetricsEndpoints"]}
            assert all(wanted <= ports(pod).keys() for pod in selected), wanted
        if kind == "NetworkPolicy" and spec.get("ingress"):
            numbers = {port["port"] for rule in spec["ingress"] for port in rule["ports"]}
            known = [ports(pod).keys() | ports(pod).values() for pod in selected]
            assert all(numbers <= each for each in known), f"{numbers} of {known}"
        if kind in ("Service", "PodMonitor", "PodDisruptionBudget") or (kind == "NetworkPolicy" and "from" in str(spec)):
            assert selected, f"{kind} {document['metadata']['name']} selects no pod"
        if kind in ("HorizontalPodAutoscaler", "ScaledObject"):
            scaled.append(spec["scaleTargetRef"]["name"])
        if kind == "Ingress":
            backend = spec["rules"][0]["http"]["paths"][0]["backend"]["service"]
            service = next(each for each in documents if each["kind"] == "Service" and each["metadata"]["name"] == backend["name"])
            assert backend["port"]["name"] in {port["name"] for port in service["spec"]["ports"]}, backend
        if kind == "PrometheusRule":
            alerts = yaml.safe_load((DEPLOY / "alerts.yml").read_text())
            assert spec == alerts, "alerts.yaml differs from alerts.yml"
    assert scaled == ["worker"], f"one autoscaler, of the workers: {scaled}"


def labels(pod):
    return pod["metadata"]["labels"]


def ports(pod):
    all_ports = [port for container in containers(pod) for port in container.get("ports", [])]
    return {port["name"]: port["containerPort"] for port in all_ports}


def check(folder, help_of, checked):
    documents = render(folder)
    pods = []
    for document in documents:
        try:
            # Folders share most of their documents.
            if document not in checked:
                check_schema(document)
                checked.append(document)
            assert document["kind"] == "Namespace" or document["metadata"]["namespace"] == "halflight", "no namespace"
            if document["kind"] in ("Deployment", "StatefulSet", "CronJob"):
                pod = template(document)
                claims = document["spec"].get("volumeClaimTemplates", [])
                pods.append(pod | {"claims": {claim["metadata"]["name"] for claim in claims}})
                check_pod(pods[-1], documents, help_of)
        except Exception as error:
            raise AssertionError(f"{folder}: {document['kind']} {document['metadata']['name']}: {error}") from error
    assert all(labels(pod)[NAME] == "halflight" for pod in pods)
    check_relations(documents, pods)
    initial = [[each["name"] for each in pod["spec"].get("initContainers", [])] for pod in pods]
    assert "bake" not in folder or ["scene", "solve"] in initial, f"init containers out of order: {initial}"
    return len(documents)


def main():
    programs, told, checked = Path(sys.argv[1]), {}, []

    def help_of(program, command):
        words = (program, *command)
        if words not in told:
            said = subprocess.run([programs / program, *command, "--help"], capture_output=True, text=True, check=True)
            told[words] = said.stdout
        return told[words]

    for folder in FOLDERS:
        print(f"{folder}: {check(folder, help_of, checked)} objects are good for Kubernetes {VERSIONS[0]} to {VERSIONS[-1]}")


if __name__ == "__main__":
    main()
