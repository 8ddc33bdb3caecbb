from .import_map import ImportMap, load_map, unlike_rotary
from .recording import doubtful_positions, import_recording

__all__ = ["ImportMap", "doubtful_positions", "import_recording", "load_map", "unlike_rotary"]
