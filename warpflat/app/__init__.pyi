"""What a person starts: scenes, the command line, batches, the studio, pages to review."""

from .scene.compare import compare_fabrics as compare_fabrics
from .scene.compare import save_comparison as save_comparison
from .scene.load import load_scene as load_scene
from .scene.load import make_scene as make_scene
from .scene.run import run_scene as run_scene
