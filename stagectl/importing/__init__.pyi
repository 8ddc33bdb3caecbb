from .import_map import ImportMap, load_map, unlike_rotary
from .recording import import_recording

__all__ = ["ImportMap", "import_recording", "load_map", "unlike_rotary"]
