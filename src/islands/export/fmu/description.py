"""Model description of an FMU: variables, units and capabilities in XML, for FMI 2.0 and 3.0."""

import re
from dataclasses import dataclass
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from islands.models.block import Block
from islands.records.channel_names import parse_unit

#: Attributes of an FMU of either version.
_CAPABILITIES = {
    "canHandleVariableCommunicationStepSize": "false",
    "canBeInstantiatedOnlyOncePerProcess": "false",
}


@dataclass(frozen=True, slots=True)
class FmuVariable:
    """A variable of the model description, in the order of the value references.

    Attributes
    ----------
    name, causality, variability, description, unit : str
    initial : str
        Empty for inputs and for the time.
    start : float or None
        Start value; None for a variable without one.
    """

    name: str
    causality: str
    variability: str
    description: str
    unit: str = ""
    initial: str = ""
    start: float | None = None

    @property
    def start_text(self) -> str:
        """Start value as text; empty without one."""
        return "" if self.start is None else repr(self.start)


def fmu_variables(block: Block) -> tuple[FmuVariable, ...]:
    """Return the variables: time, outputs, inputs, and one start value for each past sample of the state."""
    found = [FmuVariable("time", "independent", "continuous", "Time in seconds", "s")]
    late = ", one sampling time late" if any(block.feedthrough) else ""
    for channel, (column, signal) in enumerate(zip(block.columns, block.signals, strict=True)):
        is_input = channel >= block.computed
        causality, variability = ("input", "continuous") if is_input else ("output", "discrete")
        found.append(
            FmuVariable(
                column,
                causality,
                variability,
                f"{signal}(k)" if is_input else f"{signal}(k){late}",
                parse_unit(column),
                "" if is_input else "calculated",
                0.0 if is_input else None,
            )
        )
    for (channel, lag), start in zip(block.samples, block.start_values(), strict=True):
        column = block.columns[channel]
        text = f"{block.signals[channel]}(k-{lag}) at the first sample"
        found.append(
            FmuVariable(
                f"start.{column}[{lag}]", "parameter", "fixed", text, parse_unit(column), "exact", start
            )
        )
    return tuple(found)


def model_identifier(block: Block) -> str:
    """Return the name of the library of an FMU, a C identifier: ``narx_y_um``."""
    return f"narx_{re.sub('[^A-Za-z0-9]+', '_', block.title).strip('_')}"[:60].rstrip("_")


def describe_fmi3(block: Block, token: str) -> str:
    """Return ``modelDescription.xml`` of FMI 3.0."""
    root = _make_root(block, "3.0", {"instantiationToken": token})
    SubElement(
        root,
        "CoSimulation",
        {
            "modelIdentifier": model_identifier(block),
            "canGetAndSetFMUState": "true",
            "canSerializeFMUState": "true",
            "fixedInternalStepSize": repr(block.dt),
            **_CAPABILITIES,
        },
    )
    _add_units(root, block)
    SubElement(root, "DefaultExperiment", startTime="0.0", stepSize=repr(block.dt))
    listed = SubElement(root, "ModelVariables")
    for reference, each in enumerate(fmu_variables(block)):
        SubElement(
            listed,
            "Float64",
            _describe(each, reference)
            | _optional(unit=each.unit, initial=each.initial, start=each.start_text),
        )
    structure = SubElement(root, "ModelStructure")
    # Value references of the outputs: those behind the time. No output depends on present inputs.
    references = [str(place) for place in range(1, 1 + block.computed)]
    for output in references:
        SubElement(structure, "Output", valueReference=output, dependencies="")
    for output in references:
        SubElement(structure, "InitialUnknown", valueReference=output)
    return _to_text(root)


def describe_fmi2(block: Block, token: str) -> str:
    """Return ``modelDescription.xml`` of FMI 2.0."""
    root = _make_root(block, "2.0", {"guid": token})
    simulation = SubElement(
        root,
        "CoSimulation",
        {
            "modelIdentifier": model_identifier(block),
            "canGetAndSetFMUstate": "true",
            "canSerializeFMUstate": "true",
            **_CAPABILITIES,
        },
    )
    SubElement(SubElement(simulation, "SourceFiles"), "File", name="fmi2.c")
    _add_units(root, block)
    SubElement(root, "DefaultExperiment", startTime="0.0", stepSize=repr(block.dt))
    listed = SubElement(root, "ModelVariables")
    for reference, each in enumerate(fmu_variables(block)):
        variable = SubElement(
            listed,
            "ScalarVariable",
            _describe(each, reference) | _optional(initial=each.initial),
        )
        SubElement(variable, "Real", _optional(unit=each.unit, start=each.start_text))
    structure = SubElement(root, "ModelStructure")
    outputs, unknowns = SubElement(structure, "Outputs"), SubElement(structure, "InitialUnknowns")
    # FMI 2.0 counts variables from 1: the time is the first one.
    for index in range(2, 2 + block.computed):
        SubElement(outputs, "Unknown", index=str(index), dependencies="")
        SubElement(unknowns, "Unknown", index=str(index))
    return _to_text(root)


def describe_build(block: Block) -> str:
    """Return ``sources/buildDescription.xml`` of FMI 3.0."""
    root = Element("fmiBuildDescription", fmiVersion="3.0")
    build = SubElement(root, "BuildConfiguration", modelIdentifier=model_identifier(block))
    files = SubElement(build, "SourceFileSet", language="C99")
    SubElement(files, "SourceFile", name="fmi3.c")
    return _to_text(root)


def _make_root(block: Block, version: str, identity: dict[str, str]) -> Element:
    return Element(
        "fmiModelDescription",
        {
            "fmiVersion": version,
            "modelName": f"NARX model of {block.title}",
            **identity,
            "description": "; ".join(filter(None, [*block.texts, block.values])),
            "generationTool": "islands",
            "variableNamingConvention": "flat",
        },
    )


def _add_units(root: Element, block: Block) -> None:
    names = {each.unit for each in fmu_variables(block)} - {""}
    listed = SubElement(root, "UnitDefinitions")
    for name in sorted(names):
        SubElement(listed, "Unit", name=name)


def _describe(variable: FmuVariable, reference: int) -> dict[str, str]:
    """Return the attributes of a variable that both standards have."""
    return {
        "name": variable.name,
        "valueReference": str(reference),
        "causality": variable.causality,
        "variability": variable.variability,
        "description": variable.description,
    }


def _optional(**attributes: str) -> dict[str, str]:
    return {name: value for name, value in attributes.items() if value}


def _to_text(root: Element) -> str:
    ElementTree.indent(root)
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{ElementTree.tostring(root, "unicode")}\n'
