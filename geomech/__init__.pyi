from . import conventions as conventions
from . import coupling as coupling
from . import dda as dda
from . import ddm as ddm
from . import model as model
from .pipeline import cycles as cycles
from .pipeline import factor_of_safety as factor_of_safety
from .pipeline import run as run
from .pipeline import safety_report as safety_report
from .report.results import open_run as open_run
from .resumption import resume as resume
from .scene import SceneError as SceneError
from .scene import load_scene as load_scene

__version__: str
