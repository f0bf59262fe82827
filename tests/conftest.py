"""What all tests share."""

from __future__ import annotations

import gc
import os
import signal
import tempfile
from collections.abc import Iterator
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest
from hypothesis import settings
from tests import kernels

# the suite draws the same examples every time; `make fuzz` draws new ones (--hypothesis-profile=fuzz)
settings.register_profile("suite", derandomize=True, database=None, deadline=None)
settings.register_profile("fuzz", deadline=None, print_blob=True)
settings.load_profile("suite")


def without_local_constants() -> None:
    """In the suite hypothesis tries no constants of the modules that happen to be loaded as examples.

    Derandomised as it may be, it takes them out of all local modules loaded so far, and so a test would get
    other examples alone than after others. Older versions take none.
    """
    try:
        providers = import_module("hypothesis.internal.conjecture.providers")
        found = providers._get_local_constants
    except (ImportError, AttributeError):
        return
    vars(providers)["_get_local_constants"] = lambda: (
        providers.Constants() if settings().derandomize else found()
    )


without_local_constants()

SLOW = 0.5  # s of processor time from which on a test belongs to `make slow`
# folders whose tests run only with their option
OPTIONAL = {
    "page": ("--page", "with the tests of the page in Chromium, which need playwright (`make page`)"),
    "export": ("--export", "with the tests of exports by compilers and simulators (`make export-test`)"),
    "docs": ("--docs-commands", "with the commands of the documentation (`make docs-commands`)"),
}
SHARED = pytest.StashKey[tempfile.TemporaryDirectory[str]]()


def pytest_addoption(parser: pytest.Parser) -> None:
    """Options of this suite: `pytest --help` says what each does."""
    for option, meaning in OPTIONAL.values():
        parser.addoption(option, action="store_true", help=meaning)
    parser.addoption("--size", type=int, default=1, help="so many times as many cases of tests/robustness")
    parser.addoption("--few-kernels", action="store_true", help="compile what a test needs when it needs it")
    parser.addoption(
        "--tiers", action="store_true", help="say which tests should be marked slow and which should not"
    )


def pytest_configure() -> None:
    """Handle SIGINT even where it is ignored, as in a background job: commands under test inherit that."""
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """What needs an option, or benchmarks that a wheel has not, is not even imported."""
    if collection_path.name.startswith("test_benchmark"):
        return find_spec("softstart_studies.benchmarks") is None or None
    option, _ = OPTIONAL.get(collection_path.name, ("", ""))
    if collection_path.parent == Path(__file__).parent and option and not config.getoption(option):
        return True
    return None


def pytest_sessionstart(session: pytest.Session) -> None:
    """Compile before the modules of tests are imported: a fresh clone is not to compile within a test."""
    config = session.config
    if config.getoption("collectonly") or config.getoption("few_kernels"):
        return
    if folder := getattr(config, "workerinput", {}).get("kernels"):
        kernels.compile_together(Path(folder))
    elif config.getoption("dist", "no") == "no":
        kernels.compile_all()


@pytest.hookimpl(optionalhook=True)
def pytest_configure_node(node: Any) -> None:
    """The workers of pytest-xdist share the work of compiling."""
    if SHARED not in node.config.stash:
        node.config.stash[SHARED] = tempfile.TemporaryDirectory(prefix="softstart-kernels-")
    node.workerinput["kernels"] = node.config.stash[SHARED].name


def pytest_unconfigure(config: pytest.Config) -> None:
    """Leave nothing behind."""
    if SHARED in config.stash:
        config.stash[SHARED].cleanup()


@pytest.hookimpl(wrapper=True)
def pytest_collection(session: pytest.Session) -> Iterator[None]:
    """All that is collected stays to the end: the garbage collector need not look at it, again and again."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.collect()
        gc.freeze()
        gc.enable()


# ---- --tiers: which tests are slow ----------------------------------------------------------------------

BEGUN = pytest.StashKey[float]()


def spent() -> float:
    """Processor time of this process and of its children that have ended, s."""
    return sum(os.times()[:4])


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[None]:
    """The time of a test is that of its fixtures and of its children, too."""
    item.stash[BEGUN] = spent()
    return (yield)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Iterator[None]:
    """The workers of pytest-xdist send their reports, and with them what stands in `user_properties`."""
    report: Any = yield
    if report.when == "teardown":
        slow = item.get_closest_marker("slow") is not None
        report.user_properties.append(("processor", (spent() - item.stash[BEGUN], slow)))
    return report  # type: ignore[no-any-return]


def pytest_terminal_summary(terminalreporter: Any, config: pytest.Config) -> None:
    """The tests on the wrong side of the line; a fact about this machine, which fails nothing."""
    if not config.getoption("tiers"):
        return
    reports = [one for kind in terminalreporter.stats.values() for one in kind if hasattr(one, "when")]
    told = [
        (*dict(one.user_properties)["processor"], one.nodeid) for one in reports if one.when == "teardown"
    ]
    for slow, heading in ((False, "not marked slow: took"), (True, "marked slow: took less than")):
        terminalreporter.section(f"{heading} {SLOW} s of processor time")
        for took, marked, nodeid in sorted(told, reverse=True):
            if marked == slow and (took < SLOW) == slow:
                terminalreporter.line(f"{took:8.2f}  {nodeid}")
