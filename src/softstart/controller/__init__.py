"""The controller interface, and how controllers are found."""

from softstart.controller.base import NEVER as NEVER
from softstart.controller.base import Command as Command
from softstart.controller.base import CompiledController as CompiledController
from softstart.controller.base import Controller as Controller
from softstart.controller.base import Effort as Effort
from softstart.controller.base import Numbers as Numbers
from softstart.controller.base import PlainController as PlainController
from softstart.controller.base import Sensor as Sensor
from softstart.controller.compiled import compiled_step as compiled_step
from softstart.controller.finding import controller_class as controller_class
from softstart.controller.finding import make_controller as make_controller
from softstart.controller.finding import ready_controller_names as ready_controller_names
from softstart.controller.parameters import ParameterValues as ParameterValues
from softstart.controller.parameters import declared_parameters as declared_parameters
from softstart.controller.parameters import parameter as parameter
from softstart.kernel.records import Measured as Measured
from softstart.plugins import controller_names as controller_names
