"""The scene file: typed tables, loading, checks that report all errors at once, and the problem that it describes."""

from .errors import Fault, SceneError
from .keys import describe_keys
from .loading import SCENE_FILE, Scene, load_scene

__all__ = ["SCENE_FILE", "Fault", "Scene", "SceneError", "describe_keys", "load_scene"]
