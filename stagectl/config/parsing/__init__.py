"""Strict YAML and its values: `yaml_nodes`, `units` (quantities), `validation` (messages)."""
