"""Write the bill of materials of the image in CycloneDX: packages, hashes, licences, dependencies.

    python deploy/packages/write_sbom.py --output dist/islands-sbom.json

The packages are those of `requirements.lock` that the extra of the image requires. The same lock gives the
same file, byte for byte: it contains no date and no random number. Nothing leaves the machine.
"""

import argparse
import json
import sys
import tomllib
from pathlib import Path
from typing import Any

from cyclonedx.schema import SchemaVersion
from cyclonedx.spdx import is_expression, is_supported_id
from cyclonedx.validation.json import JsonStrictValidator
from locked_packages import LOCK, ROOT, read_image, read_licences, read_lock


def make_document(lock: Path) -> dict[str, Any]:
    """Return the bill of materials of a lock file."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    packages = read_image(read_lock(lock))
    licences = read_licences(packages)
    references = {project["name"]: "root-component"}
    references |= {name: f"pkg:pypi/{name}@{package.version}" for name, package in packages.items()}
    return {
        "$schema": "http://cyclonedx.org/schema/bom-1.6.schema.json",
        "bomFormat": "CycloneDX",
        "specVersion": "1.6",
        "version": 1,
        "metadata": {
            "component": {
                "bom-ref": references[project["name"]],
                "type": "application",
                "name": project["name"],
                "version": project["version"],
                "licenses": [describe_licence(project["license"])],
            }
        },
        "components": [
            {
                "bom-ref": references[name],
                "type": "library",
                "name": name,
                "version": package.version,
                "purl": references[name],
                "licenses": [describe_licence(licences[name])],
                "externalReferences": [
                    {
                        "type": "distribution",
                        "url": references[name],
                        "comment": "one of these files",
                        "hashes": [{"alg": "SHA-256", "content": each} for each in package.hashes],
                    }
                ],
            }
            for name, package in packages.items()
        ],
        "dependencies": [
            {
                "ref": reference,
                "dependsOn": [references[each.name] for each in packages.values() if name in each.needed_by],
            }
            for name, reference in sorted(references.items())
        ],
    }


def describe_licence(licence: str) -> dict[str, Any]:
    """Return the entry of CycloneDX for a licence that a package states."""
    if is_supported_id(licence):
        return {"license": {"id": licence}}
    return {"expression": licence} if is_expression(licence) else {"license": {"name": licence}}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--output", type=Path, required=True)
    parser.add_argument("--lock", type=Path, default=LOCK)
    arguments = parser.parse_args()
    document = make_document(arguments.lock)
    text = json.dumps(document, indent=1, sort_keys=True) + "\n"
    if fault := JsonStrictValidator(SchemaVersion.V1_6).validate_str(text):
        sys.exit(f"the bill of materials does not agree with the schema of CycloneDX 1.6: {fault}")
    arguments.output.parent.mkdir(parents=True, exist_ok=True)
    arguments.output.write_text(text, encoding="utf-8")
    print(f"{arguments.output}: {len(document['components'])} packages, CycloneDX 1.6")


if __name__ == "__main__":
    main()
