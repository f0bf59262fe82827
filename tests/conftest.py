"""What all tests share."""

from __future__ import annotations

import gc
import signal
import sys
import tempfile
from collections.abc import Iterator
from functools import partial
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
    other examples alone than after others (`tests/test_examples.py`). Older versions take none.
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

PAGE = Path(__file__).parent / "page"
DOCS = Path(__file__).parent / "docs"
SHARED = pytest.StashKey[tempfile.TemporaryDirectory[str]]()


def pytest_addoption(parser: pytest.Parser) -> None:
    """`--page`: with the tests in a real browser, which need Chromium and playwright (`make page`).

    `--docs-commands`: run what the pages of the documentation tell to type (`make docs-commands`).
    `--few-kernels`: compile what a test needs when it needs it, for a few tests from an empty cache.
    """
    parser.addoption("--page", action="store_true", help="with the tests of the page in Chromium")
    parser.addoption("--docs-commands", action="store_true", help="with the commands of the documentation")
    parser.addoption("--rewrite", action="store_true", help="pages show what their commands print")
    parser.addoption("--size", type=int, default=1, help="so many times as many cases of tests/robustness")
    parser.addoption("--few-kernels", action="store_true", help="compile nothing before the first test")


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


def pytest_sessionstart(session: pytest.Session) -> None:
    """Compile before the modules of tests are imported: a fresh clone is not to compile within a test."""
    config = session.config
    if config.getoption("collectonly") or config.getoption("few_kernels"):
        return
    if folder := getattr(config, "workerinput", {}).get("kernels"):
        halves = {f"assertions {i}": ((), partial(rewrite_assertions, config, i)) for i in range(2)}
        kernels.compile_together(Path(folder), halves)
    elif config.getoption("dist", "no") == "no":
        kernels.compile_all()


def rewrite_assertions(config: pytest.Config, half: int) -> None:
    """Rewrite the tests' assertions as pytest does where it imports them: else each worker would, 10 s long.

    pytest has no public name for it; where these are others, each worker does it.
    """
    try:
        rewrite = import_module("_pytest.assertion.rewrite")
        state = config.stash[rewrite.assertstate_key]
        for path in sorted(Path(__file__).parent.rglob("test_*.py"))[half::2]:
            cache = rewrite.get_cache_dir(path) / (path.stem + rewrite.PYC_TAIL)
            if sys.dont_write_bytecode or rewrite._read_pyc(path, cache) is not None:
                continue
            source, code = rewrite._rewrite_test(path, config)
            if rewrite.try_makedirs(cache.parent):
                rewrite._write_pyc(state, code, source, cache)
    except (ImportError, AttributeError, TypeError):
        return


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
