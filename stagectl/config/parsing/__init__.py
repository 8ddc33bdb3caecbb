"""Strict YAML and its values: `yaml_nodes`, `units` (quantities), `validation` (messages)."""

from stagectl.config.parsing.units import parse_quantity, parse_unit
from stagectl.config.parsing.validation import Section, validate
from stagectl.config.parsing.yaml_nodes import Document, load_document, parse_document

__all__ = [
    "Document",
    "Section",
    "load_document",
    "parse_document",
    "parse_quantity",
    "parse_unit",
    "validate",
]
