"""Write the bill of materials of the image in CycloneDX: packages, hashes, licences, dependencies.

    python deploy/packages/write_sbom.py --output dist/islands-sbom.json

The packages are those of `deploy/requirements.lock`. The same lock gives the same file, byte for byte: it
contains no date and no random number. Nothing leaves the machine.
"""

import argparse
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

from cyclonedx.schema import SchemaVersion
from cyclonedx.spdx import is_expression, is_supported_id
from cyclonedx.validation.json import JsonStrictValidator
from locked_packages import IMAGE, ROOT, find_program, normalise, read_licences, read_lock


def list_components(lock: Path) -> dict[str, Any]:
    """Return the document of `cyclonedx-py`: the packages of a lock file with their hashes."""
    command = [find_program("cyclonedx-py"), "requirements", "--output-reproducible", "--no-validate"]
    options = ["--pyproject", ROOT / "pyproject.toml", lock]
    done = subprocess.run([*command, *options], capture_output=True, text=True, encoding="utf-8", check=True)
    document: dict[str, Any] = json.loads(done.stdout)
    return document


def complete(document: dict[str, Any], lock: Path) -> None:
    """Add licences and dependencies to a document, which `cyclonedx-py` does not read from a lock file."""
    packages = read_lock(lock)
    licences = read_licences(packages)
    root = document["metadata"]["component"]
    references = {root["name"]: root["bom-ref"]}
    for component in document["components"]:
        name = normalise(component["name"])
        references[name] = component["bom-ref"] = component["purl"]
        del component["description"]  # a copy of the hashes
        component["licenses"] = [describe_licence(licences[name])]
    document["dependencies"] = [
        {
            "ref": reference,
            "dependsOn": [references[each.name] for each in packages.values() if name in each.needed_by],
        }
        for name, reference in sorted(references.items())
    ]


def describe_licence(licence: str) -> dict[str, Any]:
    """Return the entry of CycloneDX for a licence that a package states."""
    if is_supported_id(licence):
        return {"license": {"id": licence}}
    return {"expression": licence} if is_expression(licence) else {"license": {"name": licence}}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--output", type=Path, required=True)
    parser.add_argument("--lock", type=Path, default=IMAGE)
    arguments = parser.parse_args()
    document = list_components(arguments.lock)
    complete(document, arguments.lock)
    text = json.dumps(document, indent=1, sort_keys=True) + "\n"
    if fault := JsonStrictValidator(SchemaVersion.V1_6).validate_str(text):
        sys.exit(f"the bill of materials does not agree with the schema of CycloneDX 1.6: {fault}")
    arguments.output.parent.mkdir(parents=True, exist_ok=True)
    arguments.output.write_text(text, encoding="utf-8")
    print(f"{arguments.output}: {len(document['components'])} packages, CycloneDX 1.6")


if __name__ == "__main__":
    main()
