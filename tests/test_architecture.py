"""What holds for the code as a whole: who imports whom, public names, equations, hooks, light start-up."""

import ast
import re
import subprocess
import sys
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

import mocapflow
from mocapflow import hookspecs
from mocapflow.help.equations import definitions, table

ROOT = Path(mocapflow.__file__).parent
PLUGINS = ROOT.parent / "plugins"
LAYERS = (  # a module imports only from its own layer or an earlier one
    "errors",
    "interrupts",
    "memo",
    "periodic",
    "series",
    "records",
    "settings",
    "assets",
    "data",
    "geometry",
    "knocks",
    "results",
    "scene",
    "io",
    "output_checks",
    "dressing",
    "model",
    "components",
    "hookspecs",
    "guards",
    "timing",
    "functional",
    "steady",
    "pooling",
    "loop",
    "prediction",
    "observers",
    "registry",
    "caching",
    "storage",
    "config",
    "recordings",
    "track",
    "running",
    "testing",
    "help",
    "commands",
    "cli",
    "__main__",
)
LATE = {("data", "geometry")}  # inside a method, for a default everyone shares
HEAVY = {"open3d", "numba", "cv2", "zarr", "matplotlib"}
CITATION = re.compile(r"Source: Rosenhahn 2008, (.+)$", re.MULTILINE)


def sources(*folders):
    return sorted(path for folder in folders for path in folder.rglob("*.py"))


def layer(path):
    return path.relative_to(ROOT).parts[0].removesuffix(".py")


def imported(tree, types=False):
    """Yield what a module imports, in functions too; what it imports for types only if asked for."""
    for node in ast.walk(tree):
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.dump(node.test) and not types:
            node.body = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield from [] if node.module == "mocapflow" else [node.module]
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


@pytest.mark.parametrize("path", sources(ROOT), ids=lambda path: str(path.relative_to(ROOT)))
def test_a_module_imports_only_from_earlier_layers(path):
    if path == ROOT / "__init__.py":
        return
    own = layer(path)
    for name in imported(ast.parse(path.read_text())):
        first, _, rest = name.partition(".")
        target = rest.split(".")[0]
        if first == "mocapflow" and (own, target) not in LATE:
            assert target in LAYERS[: LAYERS.index(own) + 1], f"{path.name} imports {name}"
        assert not first.startswith("mocapflow_") or own == "commands", f"{path.name} imports a plugin"


def test_no_circle_of_imports():
    """Not even by what is imported for types only, or within a function."""
    modules = {
        ".".join(path.relative_to(above).with_suffix("").parts): path
        for above, folder in ((ROOT.parent, ROOT), (PLUGINS, PLUGINS))
        for path in sources(folder)
    }
    uses = {
        name: modules.keys() & set(imported(ast.parse(path.read_text()), types=True)) - {name}
        for name, path in modules.items()
        if path.name != "__init__.py"
    }
    TopologicalSorter(uses).prepare()  # raises the circle


def test_no_circle_between_the_folders_of_io():
    uses = {}
    for path in sources(ROOT / "io"):
        own = path.relative_to(ROOT / "io").parts[0].removesuffix(".py")
        names = imported(ast.parse(path.read_text()), types=True)
        found = {name.split(".")[2] for name in names if name.startswith("mocapflow.io.")}
        uses.setdefault(own, set()).update(found - {own})
    assert "reading" not in uses and uses["video"] >= {"cameras", "paths"}
    TopologicalSorter(uses).prepare()  # raises the circle


def test_public_names():
    static = {
        alias.asname: node.module
        for node in ast.walk(ast.parse((ROOT / "__init__.py").read_text()))
        if isinstance(node, ast.ImportFrom) and str(node.module).startswith("mocapflow.")
        for alias in node.names
    }
    assert static == {name: f"mocapflow.{home}" for name, home in mocapflow._HOMES.items()}
    for name in mocapflow.__all__:
        assert getattr(mocapflow, name) is not None
    with pytest.raises(AttributeError, match="module 'mocapflow' has no attribute 'Drapper'"):
        _ = mocapflow.Drapper


def cited(docstring):
    """Return the equations a docstring cites: `Eq. (12.1), (12.10); Fig. 12.14` → 12.1, 12.10, Fig. 12.14."""
    found = set()
    for text in CITATION.findall(docstring or ""):
        found |= set(re.findall(r"\((12\.\d+)\)", text))
        found |= {f"Fig. {number}" for number in re.findall(r"Fig\. (12\.\d+)", text)}
    return found


def citations():
    for path in sources(ROOT, PLUGINS):
        root = ROOT.parent if path.is_relative_to(ROOT) else PLUGINS
        module = ".".join(path.relative_to(root).with_suffix("").parts).removesuffix(".__init__")
        for name, node in definitions(ast.parse(path.read_text())):
            for number in cited(ast.get_docstring(node)):
                yield number, f"{module}.{name}"


def test_every_citation_has_its_row_and_every_row_its_citation():
    rows = {(number.strip(), row.function) for row in table() for number in row.number.split(",")}
    assert rows == set(citations())


@pytest.mark.parametrize("row", table(), ids=lambda row: row.function)
def test_a_row_of_the_equations_names_a_function_and_a_test(row):
    assert re.search(r"\.py:\d+ ", row.place()), f"{row.function} is not there"
    assert (ROOT.parent / row.test).is_file(), f"{row.test} is not there"


def test_every_hook_of_observers_is_tested():
    tests = "".join(path.read_text() for path in sources(ROOT.parent / "tests") if path != Path(__file__))
    hooks = [name for name in vars(hookspecs) if name.startswith("mocapflow_") and name.endswith("_done")]
    assert hooks
    for hook in hooks:
        assert f"def {hook}(" in tests, f"{hook} is used nowhere"


def loaded_by(code):
    """Return the modules that a fresh interpreter holds once it has run this code, and what the code printed."""
    show = f"import sys; sys.argv = ['it', '--help']\ntry: {code}\nfinally: print('modules:', *sys.modules)"
    done = subprocess.run([sys.executable, "-c", show], capture_output=True, text=True, check=True)
    printed, _, modules = done.stdout.partition("modules:")
    return set(modules.split()), printed


def test_help_is_light():
    """Hence quick; `benchmarks/help_time.py` measures what a test on a slow machine would fail by."""
    smallest, _ = loaded_by("import typer; typer.run(lambda: None)")
    ours, printed = loaded_by("from mocapflow import cli; cli.main()")
    assert "run " in printed
    assert not {name.partition(".")[0] for name in ours} & HEAVY
    assert len(ours - smallest) < 40  # 26 today, all but six of them ours


def test_importing_mocapflow_is_light():
    loaded, _ = loaded_by("import mocapflow")
    assert not {"numpy", "pydantic", "typer", *HEAVY} & loaded


@pytest.mark.parametrize("path", sources(ROOT, PLUGINS), ids=lambda path: path.name)
def test_every_module_says_what_it_is(path):
    assert ast.get_docstring(ast.parse(path.read_text()))


def test_what_tracks_are_made_of_has_no_code_that_shows_them():
    """An edit of the report, of a comparison or of a file format must not make anybody track anew."""
    shows = {"mocapflow_report", "mocapflow_evaluation", "mocapflow_export"}
    makes = ("levelset", "matching", "twist", "draping", "priors", "recovery", "garments", "bodies", "fitting")
    for name in makes:
        used, unseen = set(), {f"mocapflow_{name}"}
        while unseen:
            used.add(package := unseen.pop())
            for path in sources(PLUGINS / package):
                found = {target.partition(".")[0] for target in imported(ast.parse(path.read_text()))}
                unseen |= {target for target in found if target.startswith("mocapflow_")} - used
        assert not used & shows, f"mocapflow_{name} imports {used & shows}"
