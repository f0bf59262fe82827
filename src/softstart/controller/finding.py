"""Finding controllers: by entry point, in a file of the user's own, or in a file of tuned gains."""

from __future__ import annotations

import importlib.util
import inspect
import sys
from collections.abc import Collection, Mapping
from dataclasses import MISSING, fields, replace
from hashlib import sha256
from pathlib import Path

from softstart.controller.base import Controller, label_of
from softstart.controller.parameters import declared_parameters
from softstart.controller.tuned import (
    GainFile,
    RobustFile,
    RobustGains,
    ScheduleFile,
    Settings,
    is_gain_file,
    read_gain_file,
    refused_file,
    scheduled,
)  # fmt: skip
from softstart.errors import InputError
from softstart.hints import did_you_mean
from softstart.input.files import refusal_of
from softstart.plugins import CONTROLLERS, controller_names, load
from softstart.quantities import show

Named = str | Controller | type[Controller]  # a controller, its class, or the name of one


def ready_controller_names(given: Collection[str] = ()) -> tuple[str, ...]:
    """Names of the installed controllers that run as they are, and of those in `given`.

    >>> "direct" in ready_controller_names(), "profile" in ready_controller_names()
    (True, False)
    """
    return tuple(name for name in controller_names() if name in given or not _needs_something(name))


def _needs_something(name: str) -> bool:
    try:
        return bool(controller_class(name).needs)
    except InputError:
        return False  # that it is broken is told where it is used


def controller_class(name: str | type[Controller]) -> type[Controller]:
    """The class behind a name or behind `path/to/file.py:ClassName`; a class itself is checked.

    Raises InputError in one sentence for an unknown name, a missing file or class.

    >>> controller_class("direct").__name__
    'Direct'
    """
    if isinstance(name, type):
        return _checked(name, name.__name__)
    if ".py:" in name or name.endswith(".py"):
        return _from_file(name)
    cls = load(CONTROLLERS, "controller", name, "softstart controllers")
    return _checked(cls, name)


def make_controller(
    name: Named, parameters: Mapping[str, object] | None = None, *, allow_code: bool = False
) -> Controller:
    """A controller from its name and parameters.

    Parameters
    ----------
    name : str, Controller or subclass of Controller
        A name, `path/to/file.py:ClassName`, a file of tuned gains (.toml), a torque profile (.csv), a class,
        or a finished controller.
    parameters : mapping, optional
        Its parameters: SI numbers or strings with a unit.
    allow_code : bool
        Whether a file of gains may run a Python file that it names. Installed controllers always run.

    Returns
    -------
    Controller
        Not yet set up for a drive: what is not given follows from that.

    Raises
    ------
    InputError
        For an unknown name, and for bad parameters.

    Examples
    --------
    >>> make_controller("ramp", {"time": "120 ms"}).time
    0.12
    """
    if isinstance(name, Controller):
        if parameters:
            raise InputError(
                f"parameters {sorted(parameters)} were given beside a finished controller "
                f"{type(name).__name__}; give them to the controller itself."
            )
        return name
    if not isinstance(name, str | type):
        raise InputError(
            f"controller = {show(name)}: give a name, path/to/file.py:ClassName, a class, a Controller, "
            "or a torque over time: a TorqueProfile, (times, torques) or a function of time."
        )
    if isinstance(name, str) and is_gain_file(name):
        return controller_of(read_gain_file(Path(name)), Path(name), Path(name).stem, parameters, allow_code)
    if isinstance(name, str) and name.lower().endswith(".csv"):
        return named(make_controller("profile", {"file": name, **(parameters or {})}), Path(name).stem)
    cls = controller_class(name)
    name = name if isinstance(name, str) else label_of(cls)
    values, wrong = _values(cls, name, parameters or {})
    missing = [
        f.name
        for f in fields(cls)
        if f.name not in values and f.default is MISSING and f.default_factory is MISSING
    ]
    wrong += [
        f"{key}: the controller {name} needs this parameter; give it with --param {key}=VALUE."
        for key in missing
    ]
    if wrong:
        raise InputError(wrong)
    if inspect.isabstract(cls):
        lacking = ", ".join(sorted(getattr(cls, "__abstractmethods__", ())))
        raise InputError(f'controller = "{name}": the class {cls.__name__} still lacks {lacking}.')
    return cls(**values)


def controller_of(
    saved: GainFile,
    path: Path,
    label: str,
    parameters: Mapping[str, object] | None = None,
    allow_code: bool = False,
) -> Controller:
    """The controller with the gains or settings of the file `path`, named after this label."""
    if is_gain_file(saved.controller):
        raise refused_file(
            path, f"controller = {show(saved.controller)}: gains are those of a controller, not of a file"
        )
    if ".py" in saved.controller and not allow_code:
        raise refused_file(
            path,
            f"it names the Python file {saved.controller[:300]}, which would run; if you trust it, add "
            "--allow-code (in Python: make_controller(file, allow_code=True))",
        )
    if parameters:
        raise InputError(
            f'parameters {sorted(parameters)} were given beside the tuned gains of "{path}"; '
            "change them in the file, or give them to the controller itself."
        )
    try:
        if isinstance(saved, RobustFile):
            made = make_controller(saved.controller, saved.parameters)
            return RobustGains(label, made, saved.drive, saved.gaps, saved.load_inertias)
        if isinstance(saved, ScheduleFile):
            return scheduled(saved, label, make_controller(saved.controller, saved.fixed))
        made = make_controller(saved.controller, saved.parameters)
        return made if label == saved.controller else Settings(label, made)
    except InputError as error:
        raise InputError([f'controller = "{path}": {sentence}' for sentence in error.sentences]) from None


def named(controller: Controller, label: str) -> Controller:
    """The controller under this name in tables; the controller itself is changed."""
    object.__setattr__(controller, "name", label)
    return controller


def changed_controller(controller: Controller, changes: Mapping[str, object]) -> Controller:
    """The controller with other parameters; None gives a parameter back its default.

    >>> ramp = make_controller("ramp", {"time": "120 ms", "initial": 20})
    >>> other = changed_controller(ramp, {"time": "0.2 s", "initial": None})
    >>> other.time, other.initial
    (0.2, None)
    """
    given = {key: value for key, value in changes.items() if value is not None}
    values, wrong = _values(type(controller), controller.name, given)
    if wrong:
        raise InputError(wrong)
    default = {f.name: None for f in fields(controller) if f.name in changes and f.name not in given}
    return replace(controller, **default, **values)


def _values(
    cls: type[Controller], name: str, parameters: Mapping[str, object]
) -> tuple[dict[str, object], list[str]]:
    """Parameters of a controller as its class takes them, and a sentence for each that is wrong."""
    known, values, wrong = declared_parameters(cls), dict[str, object](), list[str]()
    for key, value in parameters.items():
        if key not in known:
            hint = did_you_mean(
                key, known, otherwise=f"it has {', '.join(known) or 'no parameters'}.", quote='"'
            )
            if key in getattr(cls, "__annotations__", {}):
                hint = "its class names it, but is not a @dataclass(frozen=True)."
            wrong.append(f"{key} = {value}: the controller {name} has no such parameter; {hint}")
            continue
        try:
            values[key] = known[key].read(value)
        except InputError as error:
            wrong.extend(error.sentences)
    return values, wrong


def _from_file(text: str) -> type[Controller]:
    path_text, _, class_name = text.partition(".py:")
    path = Path(path_text if path_text.endswith(".py") else path_text + ".py")
    if (reason := refusal_of(path)) is not None:
        raise InputError(f'controller = "{text}": {path}: {reason}; give path/to/file.py:ClassName.')
    # named by its content: compiled steps on disk find their module again in the next process, and elsewhere
    module_name = f"softstart_loose_{path.stem}_{sha256(path.read_bytes()).hexdigest()[:16]}"
    spec = importlib.util.spec_from_file_location(module_name, path)
    if spec is None or spec.loader is None:
        raise InputError(f'controller = "{text}": {path} cannot be read as a Python file.')
    module = importlib.util.module_from_spec(spec)
    sys.modules[module_name] = module
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:  # the user's own code may fail in any way
        del sys.modules[module_name]
        raise InputError(
            f'controller = "{text}": {path} does not run: {type(error).__name__}: {error}.'
        ) from error
    classes = {
        key: value
        for key, value in vars(module).items()
        if isinstance(value, type) and value.__module__ == module_name
    }
    if not class_name:
        controllers = [value for value in classes.values() if issubclass(value, Controller)]
        if len(controllers) != 1:
            raise InputError(
                f'controller = "{text}": say which class, as {path}:ClassName; it has '
                f"{', '.join(classes) or 'none'}."
            )
        return controllers[0]
    if class_name not in classes:
        hint = did_you_mean(
            class_name, classes, otherwise=f"it has {', '.join(classes) or 'none'}.", quote='"'
        )
        raise InputError(f'controller = "{text}": {path} has no class {class_name}; {hint}')
    return _checked(classes[class_name], text)


def _checked(cls: object, name: str) -> type[Controller]:
    if isinstance(cls, type) and issubclass(cls, Controller):
        return cls
    raise InputError(
        f'controller = "{name}": {cls!r} is no controller; derive the class from '
        "softstart.controller.PlainController or CompiledController."
    )
