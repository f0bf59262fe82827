"""Does what is shipped hold all it must, and does it work where the repository is not?

    python .ci/package.py dist            contents and metadata of both; the wheel in a new environment
    python .ci/package.py dist --whole    the main job there, and all tests from both, each in an empty folder

`dist` is the folder with one sdist and one wheel, as `make package` leaves it. Only the standard library,
twine and, for the short check, the libraries of the workbench are needed here.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import sysconfig
import tarfile
import tempfile
import time
import venv
import zipfile
from pathlib import Path

HERE = Path(__file__).resolve().parent.parent
PACKAGES = {
    "softstart": HERE / "src" / "softstart",
    "softstart_controllers": HERE / "controllers" / "softstart_controllers",
    "softstart_studies": HERE / "studies" / "softstart_studies",
}
BESIDES_TESTS = ("docs", "README.md", "CHANGELOG.md", "CITATION.cff", "pyproject.toml")  # what tests may read
CHECKOUT_ONLY = ("softstart_studies/benchmarks/",)  # not in the wheel
CACHES = ("__pycache__", ".pyc", ".nbi", ".nbc", ".mypy_cache", ".hypothesis", ".venv/")


def main() -> int:
    """Look at both files; the first thing that is wrong ends it with a sentence."""
    asked = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    asked.add_argument("dist", type=Path, help="folder with one sdist and one wheel")
    asked.add_argument("--whole", action="store_true", help="run the whole suite from both")
    given = asked.parse_args()
    wheel, sdist = one(given.dist, "*.whl"), one(given.dist, "*.tar.gz")
    one_version(wheel)
    run([sys.executable, "-m", "twine", "check", "--strict", wheel, sdist])
    look_into_wheel(wheel)
    look_into_sdist(sdist)
    with tempfile.TemporaryDirectory(prefix="softstart-package-") as name:
        folder = Path(name)
        python = installed(wheel, folder / "venv", given.whole)
        works_alone(python, folder)
        if given.whole:
            unpacked = unpack(sdist, folder)
            main_job(python, folder)
            suite_of_wheel(python, unpacked, folder)
            print("== the suite of the unpacked sdist, in an environment of its own", flush=True)
            run(["make", "test", "slow"], where=unpacked)
    print("the packages are good")
    return 0


def one_version(wheel: Path) -> None:
    """Package, citation and changelog speak of the same version."""
    version = wheel.name.split("-")[1]
    for name, line in (("CITATION.cff", f"version: {version}"), ("CHANGELOG.md", f"## {version}")):
        lines = (HERE / name).read_text("utf-8").splitlines()
        check(
            any(one.startswith(line) for one in lines), f'{name} has no line "{line}" as {wheel.name} has it.'
        )


def look_into_wheel(wheel: Path) -> None:
    """The wheel holds every file of the three packages but the benchmarks, and nothing else."""
    with zipfile.ZipFile(wheel) as opened:
        inside = {name for name in opened.namelist() if ".dist-info/" not in name}
        information = {name.rpartition("/")[2] for name in opened.namelist() if ".dist-info/" in name}
    sources = {
        f"{package}/{path.relative_to(folder).as_posix()}"
        for package, folder in PACKAGES.items()
        for path in folder.rglob("*")
        if path.is_file() and not cache(path.as_posix())
    }
    same(inside, {name for name in sources if not name.startswith(CHECKOUT_ONLY)}, wheel.name)
    kinds = {name.rpartition(".")[2] for name in inside}
    needed = {f"{package}/py.typed" for package in PACKAGES} | {"softstart/drive/library/crane-4amtkf.toml"}
    check(needed <= inside, f"{wheel.name} lacks {sorted(needed - inside)}.")
    check("LICENSE" in information and "entry_points.txt" in information, f"{wheel.name}: {information}.")
    print(f"{wheel.name}: {len(inside)} files, of the kinds {', '.join(sorted(kinds))}")


def look_into_sdist(sdist: Path) -> None:
    """Everything that git knows is in the sdist (where there is git), and no cache."""
    with tarfile.open(sdist) as opened:
        inside = {name.name.partition("/")[2] for name in opened.getmembers() if name.isfile()}
    check(not any(map(cache, inside)), f"{sdist.name} holds caches: {sorted(filter(cache, inside))[:5]}.")
    if (HERE / ".git").exists():
        listed = subprocess.run(
            ["git", "ls-files", "--cached", "--others", "--exclude-standard"],
            cwd=HERE, capture_output=True, text=True, check=True,
        ).stdout.splitlines()  # fmt: skip
        same(inside - {"PKG-INFO"}, {name for name in listed if (HERE / name).is_file()}, sdist.name)
    for folder in ("src", "controllers", "studies", "tests", "docs", ".ci"):
        check(any(name.startswith(folder + "/") for name in inside), f"{sdist.name} lacks {folder}/.")
    print(f"{sdist.name}: {len(inside)} files")


def installed(wheel: Path, folder: Path, whole: bool) -> Path:
    """The Python of a new environment with the wheel and what the tests need.

    Libraries are fetched anew for the whole check only. Otherwise those of the environment that runs this are
    lent by a path file; editable installs there are not followed, and `pip check` says if one is missing.
    """
    print("== the wheel in a new environment", flush=True)
    venv.create(folder, with_pip=True)
    python = folder / "bin" / "python"
    pip = [python, "-m", "pip", "--disable-pip-version-check", "--quiet"]
    if whole:
        run([*pip, "install", f"softstart[test] @ {wheel.resolve().as_uri()}"])
    else:
        run([*pip, "install", "--no-deps", wheel.resolve()])
        site = Path(
            run([python, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))"], kept=True).strip()
        )
        (site / "lent.pth").write_text(sysconfig.get_path("purelib") + "\n")
    run([*pip, "check"])
    return python


def works_alone(python: Path, folder: Path) -> None:
    """In an empty folder the installed command knows drives, controllers and studies; all is the wheel's."""
    empty = folder / "empty"
    empty.mkdir()
    where = run([python, "-c", "import softstart; print(softstart.__file__)"], where=empty, kept=True).strip()
    check("site-packages" in where, f"softstart is taken from {where}, not from the wheel.")
    for word, known in (("drives", "crane-4amtkf"), ("controllers", "take-up")):
        told = run([python.parent / "softstart", word], where=empty, kept=True)
        check(known in told, f"softstart {word} does not list {known}.")
    names = "from softstart.plugins import STUDIES, registered; print(*registered(STUDIES))"
    studies = run([python, "-c", names], where=empty, kept=True)
    check("paper-g" in studies, "softstart study does not find its studies.")
    check("benchmark" not in studies, f"softstart study lists what is not installed: {studies}")
    check(not list(empty.iterdir()), "the commands leave files behind.")


def main_job(python: Path, folder: Path) -> None:
    """The installed command compares strategies."""
    found = json.loads(run([python.parent / "softstart", "compare", "--json"], where=folder, kept=True))
    check(len(found["strategies"]) > 5, "softstart compare does not find its controllers.")


def suite_of_wheel(python: Path, unpacked: Path, folder: Path) -> None:
    """The tests of the sdist on the installed wheel, where no source is near."""
    place = folder / "tests of the wheel"
    place.mkdir()
    shutil.copytree(unpacked / "tests", place / "tests")
    for name in BESIDES_TESTS:
        if (unpacked / name).is_dir():
            shutil.copytree(unpacked / name, place / name)
        elif (unpacked / name).exists():
            shutil.copy(unpacked / name, place / name)
    workers = ["-n", "auto", "--dist", "worksteal"]
    run([python, "-m", "pytest", "-q", *workers, "tests", "--pyargs", *PACKAGES], where=place)


def unpack(sdist: Path, folder: Path) -> Path:
    """The folder that the sdist unpacks to."""
    with tarfile.open(sdist) as opened:
        opened.extractall(folder / "sdist", **({"filter": "data"} if hasattr(tarfile, "data_filter") else {}))
    (only,) = (folder / "sdist").iterdir()
    return only


def run(command: list[str | Path], where: Path | None = None, kept: bool = False) -> str:
    """Run a command in a folder without this environment's settings; its output if `kept`."""
    begun = time.monotonic()
    clean = {
        key: value
        for key, value in os.environ.items()
        if not key.startswith(("PYTHON", "VIRTUAL_ENV", "MAKE"))
    }
    ended = subprocess.run(
        list(map(str, command)), cwd=where, check=False, text=True, stdout=subprocess.PIPE if kept else None,
        env=clean | {"OPENBLAS_NUM_THREADS": "1"},
    )  # fmt: skip
    shown = " ".join(Path(part).name if Path(str(part)).is_absolute() else str(part) for part in command)
    check(ended.returncode == 0, f"{shown} ended with {ended.returncode}.")
    print(f"  {time.monotonic() - begun:5.1f} s  {shown}", flush=True)
    return ended.stdout or ""


def one(folder: Path, pattern: str) -> Path:
    """The one file of this pattern."""
    found = list(folder.glob(pattern))
    check(len(found) == 1, f"{folder} holds {len(found)} of {pattern}; make package leaves one.")
    return found[0]


def cache(name: str) -> bool:
    """Whether this is something that a run leaves behind."""
    return any(part in name for part in CACHES)


def same(inside: set[str], wanted: set[str], name: str) -> None:
    """Stop with what is missing or too much."""
    check(inside >= wanted, f"{name} lacks {sorted(wanted - inside)}.")
    check(inside <= wanted, f"{name} holds what it should not: {sorted(inside - wanted)}.")


def check(good: bool, sentence: str) -> None:
    """Stop with a sentence unless it is good."""
    if not good:
        sys.exit(f"package: {sentence}")


if __name__ == "__main__":
    sys.exit(main())
