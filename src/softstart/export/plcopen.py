"""PLCopen XML (TC6, version 2.01): all types and units of a text, as engineering tools import them."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from collections.abc import Iterable

from softstart.export.st_text import Text
from softstart.export.st_units import BLOCKS, Declared, Unit

NAMESPACE = "http://www.plcopen.org/xml/tc6_0201"
XHTML = "http://www.w3.org/1999/xhtml"
LISTS = {"VAR_INPUT": "inputVars", "VAR_OUTPUT": "outputVars", "VAR_IN_OUT": "inOutVars"}
KINDS = {"FUNCTION": "function", "FUNCTION_BLOCK": "functionBlock", "PROGRAM": "program"}
ARRAY = re.compile(r"ARRAY\[(.+)\] OF (\w+)")
ELEMENTARY = ("LREAL", "REAL", "LINT", "BOOL")
NO_DATE = "1970-01-01T00:00:00"  # the same export is the same file


def plcopen_xml(text: Text, version: str, created: str = NO_DATE) -> str:
    """A project with all types and units of a text.

    Parameters
    ----------
    text : as `write_block` gives it, with its test program where there is one.
    version : of softstart.
    created : date and time, as 2025-01-31T12:00:00.
    """
    project = ET.Element("project", {"xmlns": NAMESPACE, "xmlns:xhtml": XHTML})
    header = {"companyName": "softstart", "productName": text.prefix, "productVersion": version}
    ET.SubElement(project, "fileHeader", header | {"creationDateTime": created})
    content = ET.SubElement(project, "contentHeader", {"name": text.prefix})
    scales = ET.SubElement(content, "coordinateInfo")
    for language in ("fbd", "ld", "sfc"):
        ET.SubElement(ET.SubElement(scales, language), "scaling", {"x": "1", "y": "1"})
    types = ET.SubElement(project, "types")
    data, units = ET.SubElement(types, "dataTypes"), ET.SubElement(types, "pous")
    for one in text.types:
        entry = ET.SubElement(data, "dataType", {"name": one.name})
        base = ET.SubElement(entry, "baseType")
        if one.array:
            _type(base, one.array)
        else:
            _variables(ET.SubElement(base, "struct"), one.fields)
        _remark(entry, one.comment)
    for unit in text.units:
        _unit(units, unit)
    ET.SubElement(ET.SubElement(project, "instances"), "configurations")
    ET.indent(project)
    return '<?xml version="1.0" encoding="utf-8"?>\n' + ET.tostring(project, encoding="unicode") + "\n"


def _unit(units: ET.Element, unit: Unit) -> None:
    pou = ET.SubElement(units, "pou", {"name": unit.name, "pouType": KINDS[unit.kind]})
    interface = ET.SubElement(pou, "interface")
    if unit.result:
        _type(ET.SubElement(interface, "returnType"), unit.result)
    for block in BLOCKS:
        if unit.blocks.get(block):
            constant = {"constant": "true"} if block == "VAR CONSTANT" else {}
            _variables(ET.SubElement(interface, LISTS.get(block, "localVars"), constant), unit.blocks[block])
    _remark(interface, unit.comment)
    body = ET.SubElement(ET.SubElement(pou, "body"), "ST")
    ET.SubElement(body, "xhtml:p").text = "\n".join(unit.body) + "\n"


def _variables(parent: ET.Element, declared: Iterable[Declared]) -> None:
    for one in declared:
        variable = ET.SubElement(parent, "variable", {"name": one.name})
        _type(ET.SubElement(variable, "type"), one.type)
        if one.initial:
            ET.SubElement(ET.SubElement(variable, "initialValue"), "simpleValue", {"value": one.initial})
        _remark(variable, one.comment)


def _type(parent: ET.Element, name: str) -> None:
    """A type: an elementary one, a structure, or an array of these."""
    found = ARRAY.fullmatch(name)
    if found is not None:
        array = ET.SubElement(parent, "array")
        for span in found[1].split(", "):
            lower, upper = span.split("..")
            ET.SubElement(array, "dimension", {"lower": lower, "upper": upper})
        _type(ET.SubElement(array, "baseType"), found[2])
    elif name in ELEMENTARY:
        ET.SubElement(parent, name)
    else:
        ET.SubElement(parent, "derived", {"name": name})


def _remark(parent: ET.Element, text: str) -> None:
    if text:
        ET.SubElement(ET.SubElement(parent, "documentation"), "xhtml:p").text = " ".join(text.split())
