"""What all tests share."""

from __future__ import annotations

import pytest

from softstart import Drive, simulate
from softstart.controller import CompiledController, controller_names, make_controller


@pytest.fixture(scope="session", autouse=True)
def compiled_kernels() -> None:
    """Compile everything before the first test: a fresh clone is not to compile within one of them.

    The command line says on standard error that it compiles, which tests of its output would trip over.
    """
    crane = Drive.load("crane-4amtkf")
    for name in controller_names():
        controller = make_controller(name)
        assert simulate(crane, controller).energy.residual < 1e-6
        simulate(crane.replace(gap=[0.5, 2.0]), controller)
    direct = make_controller("direct")
    assert isinstance(direct, CompiledController)
    plain = direct.as_plain(crane)
    assert simulate(crane, plain).k_dyn == simulate(crane, "direct").k_dyn
    simulate(crane.replace(gap=[0.5, 2.0]), plain)
