"""Model description of an FMU: variables, units and capabilities in XML, for FMI 2.0 and 3.0."""

import re
from dataclasses import dataclass
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from islands.data.channel_names import parse_unit
from islands.io.export.sampled_state import SampledState
from islands.model.equations import equation
from islands.model.model import Model

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
    start : bool
        Whether the variable has a start value, which is zero.
    """

    name: str
    causality: str
    variability: str
    description: str
    unit: str = ""
    initial: str = ""
    start: bool = False


def fmu_variables(state: SampledState) -> tuple[FmuVariable, ...]:
    """Return the variables: time, output, inputs, and one start value for each past sample of the state."""
    found = [FmuVariable("time", "independent", "continuous", "Time in seconds", "s")]
    late = ", one sampling time late" if any(state.feedthrough) else ""
    for channel, (column, signal) in enumerate(zip(state.columns, state.signals, strict=True)):
        causality, variability = ("input", "continuous") if channel else ("output", "discrete")
        found.append(
            FmuVariable(
                column,
                causality,
                variability,
                f"{signal}(k)" if channel else f"y(k){late}",
                parse_unit(column),
                "" if channel else "calculated",
                bool(channel),
            )
        )
    for channel, lag in state.samples:
        column = state.columns[channel]
        text = f"{state.signals[channel]}(k-{lag}) at the first sample"
        found.append(
            FmuVariable(
                f"start.{column}[{lag}]", "parameter", "fixed", text, parse_unit(column), "exact", True
            )
        )
    return tuple(found)


def model_identifier(model: Model) -> str:
    """Return the name of the library of an FMU, a C identifier: ``narx_y_um``."""
    return f"narx_{re.sub('[^A-Za-z0-9]+', '_', model.output_name).strip('_')}"[:60].rstrip("_")


def describe_fmi3(model: Model, state: SampledState, token: str) -> str:
    """Return ``modelDescription.xml`` of FMI 3.0."""
    root = _make_root(model, "3.0", {"instantiationToken": token})
    SubElement(
        root,
        "CoSimulation",
        {
            "modelIdentifier": model_identifier(model),
            "canGetAndSetFMUState": "true",
            "canSerializeFMUState": "true",
            "fixedInternalStepSize": repr(state.dt),
            **_CAPABILITIES,
        },
    )
    _add_units(root, state)
    SubElement(root, "DefaultExperiment", startTime="0.0", stepSize=repr(state.dt))
    listed = SubElement(root, "ModelVariables")
    for reference, each in enumerate(fmu_variables(state)):
        SubElement(
            listed,
            "Float64",
            {
                "name": each.name,
                "valueReference": str(reference),
                "causality": each.causality,
                "variability": each.variability,
                "description": each.description,
                **_optional(unit=each.unit, initial=each.initial, start="0.0" if each.start else ""),
            },
        )
    structure = SubElement(root, "ModelStructure")
    SubElement(structure, "Output", valueReference="1", dependencies="")
    SubElement(structure, "InitialUnknown", valueReference="1")
    return _to_text(root)


def describe_fmi2(model: Model, state: SampledState, token: str) -> str:
    """Return ``modelDescription.xml`` of FMI 2.0."""
    root = _make_root(model, "2.0", {"guid": token})
    simulation = SubElement(
        root,
        "CoSimulation",
        {
            "modelIdentifier": model_identifier(model),
            "canGetAndSetFMUstate": "true",
            "canSerializeFMUstate": "true",
            **_CAPABILITIES,
        },
    )
    SubElement(SubElement(simulation, "SourceFiles"), "File", name="fmi2.c")
    _add_units(root, state)
    SubElement(root, "DefaultExperiment", startTime="0.0", stepSize=repr(state.dt))
    listed = SubElement(root, "ModelVariables")
    for reference, each in enumerate(fmu_variables(state)):
        variable = SubElement(
            listed,
            "ScalarVariable",
            {
                "name": each.name,
                "valueReference": str(reference),
                "causality": each.causality,
                "variability": each.variability,
                "description": each.description,
                **_optional(initial=each.initial),
            },
        )
        SubElement(variable, "Real", _optional(unit=each.unit, start="0.0" if each.start else ""))
    structure = SubElement(root, "ModelStructure")
    # FMI 2.0 counts variables from 1: the output is the second one.
    SubElement(SubElement(structure, "Outputs"), "Unknown", index="2", dependencies="")
    SubElement(SubElement(structure, "InitialUnknowns"), "Unknown", index="2")
    return _to_text(root)


def describe_build(model: Model) -> str:
    """Return ``sources/buildDescription.xml`` of FMI 3.0."""
    root = Element("fmiBuildDescription", fmiVersion="3.0")
    build = SubElement(root, "BuildConfiguration", modelIdentifier=model_identifier(model))
    files = SubElement(build, "SourceFileSet", language="C99")
    SubElement(files, "SourceFile", name="fmi3.c")
    return _to_text(root)


def _make_root(model: Model, version: str, identity: dict[str, str]) -> Element:
    means = f"; a sample is the mean of {model.average} samples of the recording" if model.average > 1 else ""
    return Element(
        "fmiModelDescription",
        {
            "fmiVersion": version,
            "modelName": f"NARX model of {model.output_name}",
            **identity,
            "description": f"{equation(model)}{means}",
            "generationTool": "islands",
            "variableNamingConvention": "flat",
        },
    )


def _add_units(root: Element, state: SampledState) -> None:
    names = {each.unit for each in fmu_variables(state)} - {""}
    listed = SubElement(root, "UnitDefinitions")
    for name in sorted(names):
        SubElement(listed, "Unit", name=name)


def _optional(**attributes: str) -> dict[str, str]:
    return {name: value for name, value in attributes.items() if value}


def _to_text(root: Element) -> str:
    ElementTree.indent(root)
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{ElementTree.tostring(root, "unicode")}\n'
