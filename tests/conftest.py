"""What all tests share."""

from __future__ import annotations

import signal
from importlib.util import find_spec
from pathlib import Path

import pytest
from hypothesis import settings

from softstart import Chain, Drive, TorqueProfile, optimize_robust, simulate, simulate_chain
from softstart.controller import CompiledController, make_controller, ready_controller_names

# the suite draws the same examples every time; `make fuzz` draws new ones (--hypothesis-profile=fuzz)
settings.register_profile("suite", derandomize=True, database=None, deadline=None)
settings.register_profile("fuzz", deadline=None, print_blob=True)
settings.load_profile("suite")

PAGE = Path(__file__).parent / "page"
DOCS = Path(__file__).parent / "docs"


def pytest_addoption(parser: pytest.Parser) -> None:
    """`--page`: with the tests in a real browser, which need Chromium and playwright (`make page`).

    `--docs-commands`: run what the pages of the documentation tell to type (`make docs-commands`).
    """
    parser.addoption("--page", action="store_true", help="with the tests of the page in Chromium")
    parser.addoption("--docs-commands", action="store_true", help="with the commands of the documentation")


def pytest_configure() -> None:
    """Handle SIGINT even where it is ignored, as in a background job: commands under test inherit that."""
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Without `--page` the tests in a browser are not even imported; the pages' commands likewise.

    Neither are the tests of the benchmarks where the benchmarks are not installed: they are not in the wheel.
    """
    if (
        collection_path.name.startswith("test_benchmark")
        and find_spec("softstart_studies.benchmarks") is None
    ):
        return True
    if collection_path == DOCS and not config.getoption("--docs-commands"):
        return True
    return True if collection_path == PAGE and not config.getoption("--page") else None


@pytest.fixture(scope="session", autouse=True)
def compiled_kernels() -> None:
    """Compile everything before the first test: a fresh clone is not to compile within one of them.

    The command line says on standard error that it compiles, which tests of its output would trip over.
    """
    crane = Drive.load("crane-4amtkf")
    profile = make_controller("profile", {"profile": TorqueProfile([0.0, 0.1, 0.1], [20.0, 62.0, 40.0])})
    for controller in (profile, *map(make_controller, ready_controller_names())):
        assert simulate(crane, controller).energy.residual < 1e-6
        simulate(crane.replace(gap=[0.5, 2.0]), controller)
    assert simulate_chain(Chain.load("crane-4-mass"), "ramp").k_dyn > 1.0
    assert optimize_robust([crane.replace(target_speed=60.0)], 0.3).k_dyn < 1.0
    direct = make_controller("direct")
    assert isinstance(direct, CompiledController)
    plain = direct.as_plain(crane)
    assert simulate(crane, plain).k_dyn == simulate(crane, "direct").k_dyn
    simulate(crane.replace(gap=[0.5, 2.0]), plain)
