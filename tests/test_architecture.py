"""The tree keeps its promises: imports go down, vendors stay behind their walls, what is public is described."""

import ast
import importlib
import re
from functools import cache
from pathlib import Path

import pytest

from obsdesign.families import FAMILIES

ROOT = Path(__file__).parent.parent / "obsdesign"
FILES = sorted(ROOT.rglob("*.py"))
MODULES = {".".join(p.relative_to(ROOT.parent).with_suffix("").parts).removesuffix(".__init__"): p for p in FILES}

# A module may import from lower rows, from its own row only within its own package; the longest prefix places it.
LAYERS = (
    ("__main__",),
    ("cli",),
    ("data",),
    ("batches", "reports", "difference", "exports"),
    ("work",),
    ("design", "advice", "elsewhere", "expectation"),
    ("tables", "simulate", "exports.control"),
    ("stepping",),
    ("plot",),
    ("reading", "starters"),
    ("families",),
    ("coq.theorem", "coq.instants", "coq.identities", "coq.laws", "coq.runs"),
    ("coq.reconstruction",),
    ("coq.clock", "coq.inequality"),
    ("coq.course", "coq.hulls", "coq.bounds", "coq.membership"),
    ("constants",),
    ("spec",),
    ("trial",),
    ("nonlinearities", "dissipation"),
    ("families.guarantee", "families.observer"),
    ("model",),
    ("guide", "files.table"),
    ("sections",),
    ("coq",),
    ("riccati",),
    ("lmi", "expressions", "files", "tables.text", "watch"),
    ("disk",),
    ("errors",),
    ("records",),
)
LEVEL = {part: level for level, row in enumerate(LAYERS) for part in row}
APART = {
    frozenset({"nonlinearities", "dissipation"}),
    frozenset({"lmi", "expressions"}),
}

FOLDERS = {path.parent.name for path in (ROOT / "families").glob("*/__init__.py")}
SIDEWAYS = {
    ("lipschitz", "incremental"),
    ("unknown_input", "incremental"),
}  # folders of families, of which the first may import the second
NO_FAMILY = {  # a word that names a family and something else too, and where it is something else
    "lipschitz": {
        "nonlinearities/": "the type, the constant",
        "constants.py": "the constant",
        "advice.py": "the constant",
        "elsewhere.py": "the condition that fails",
        "expectation.py": "the constant",
        "spec.py": "the constant",
        "cli/": "the command",
        "work.py": "the command",
        "__init__.py": "the command",
        "tables/": "the constant",
        "plot/": "the constant",
        "reading/terms.py": "the constant",
        "reading/discretise.py": "the constant",
    },
}
OWN = ("Request", "Outcome", "Claim", "Certificate", "Guarantee")  # what only its family looks into
LONGEST_MODULE, LONGEST_FUNCTION = 350, 60  # lines

CLI = {f"cli/{path.name}" for path in (ROOT / "cli").glob("*.py")}
WALLS = {  # vendor: the only files that may import it
    "control": {"exports/control.py", "design.py"},
    "pyarrow": {"data/parquet.py"},
    "distributed": {"batches/cluster.py"},
    "clarabel": {"lmi/solvers.py"},
    "cvxpy": {"lmi/solvers.py"},
    "yaml": {"sections/document.py", "sections/slips.py"},
    "matplotlib": {"plot/canvas.py"},
    "typer": CLI,
    "rich": CLI,
    "jinja2": {"reports/page.py"},
}
LAZY = {
    "scipy",
    "matplotlib",
    "cvxpy",
    "clarabel",
    "control",
    "distributed",
    "pyarrow",
}  # imported only inside functions
SPEAKERS = {*CLI, "__main__.py"}
PRINTER = "cli/printing.py"  # whose lines no runner of CI obeys
SPEECH = {"sys.exit", "sys.stdout", "sys.stderr", "os._exit"}
FORBIDDEN = {"eval", "exec", "compile", "__import__", "sympify"}


parsed = cache(ast.parse)


@cache
def imported(tree):
    """(module, line, at the top of the file) of every import; what only a type checker sees is left out."""
    return tuple(imports(tree))


def imports(tree):
    """The same, one by one."""
    found = [
        node for node in ast.walk(tree) if isinstance(node, ast.If | ast.FunctionDef | ast.Import | ast.ImportFrom)
    ]
    checked = {
        id(n)
        for node in found
        if isinstance(node, ast.If) and names(node.test) & {"TYPE_CHECKING"}
        for n in ast.walk(node)
    }
    inner = {id(n) for f in found if isinstance(f, ast.FunctionDef) for n in ast.walk(f)}
    for node in found:
        if id(node) in checked:
            continue
        if isinstance(node, ast.Import):
            yield from ((alias.name, node.lineno, id(node) not in inner) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield "." * node.level + (node.module or ""), node.lineno, id(node) not in inner


def place(module):
    """Longest prefix of a module within the package that has a layer."""
    parts = module.split(".")
    found = (".".join(parts[:k]) for k in range(len(parts), 0, -1))
    return next((prefix for prefix in found if prefix in LEVEL), module)


def names(tree):
    """Every name that occurs in a tree."""
    return {n.id for n in ast.walk(tree) if isinstance(n, ast.Name)}


def problems(source, path):
    """What is wrong with the source of the module at a path within the package."""
    tree = parsed(source)
    part = place(path.removesuffix(".py").removesuffix("/__init__").replace("/", "."))
    for module, line, top in imported(tree):
        head, _, rest = module.partition(".")
        if head == "obsdesign" and rest and part != "__init__":
            other = place(rest)
            sideways = other != part and LEVEL[other] == LEVEL[part] and frozenset({part, other}) in APART
            if LEVEL[other] < LEVEL[part] or sideways:
                yield f"{path}:{line}: {part} imports {other}"
        if head == "":
            yield f"{path}:{line}: relative import"
        if path not in WALLS.get(head, {path}):
            yield f"{path}:{line}: only {', '.join(sorted(WALLS[head]))} may import {head}"
        if top and head in LAZY:
            yield f"{path}:{line}: {head} is imported for everyone"
        if head in {"pickle", "marshal", "shelve", "sympy"}:
            yield f"{path}:{line}: {head} is not allowed"
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
            if node.func.id in FORBIDDEN:
                yield f"{path}:{node.lineno}: {node.func.id}()"
            if path not in SPEAKERS and node.func.id in {"print", "exit", "quit", "input"}:
                yield f"{path}:{node.lineno}: only the command line calls {node.func.id}()"
        if isinstance(node, ast.Attribute) and node.attr in {"echo", "secho"} and path != PRINTER:
            yield f"{path}:{node.lineno}: only {PRINTER} prints"
        if isinstance(node, ast.Attribute) and path not in SPEAKERS and ast.unparse(node) in SPEECH:
            yield f"{path}:{node.lineno}: only the command line uses {ast.unparse(node)}"
        if isinstance(node, ast.Name) and node.id == "SystemExit" and path not in CLI:
            yield f"{path}:{node.lineno}: only the command line exits"
        if isinstance(node, ast.ExceptHandler):
            caught = names(node.type) if node.type else {"everything"}
            reraised = any(isinstance(n, ast.Raise) and n.exc is None for n in ast.walk(node))
            if caught & {"everything", "Exception", "BaseException"} and not reraised:
                yield f"{path}:{node.lineno}: catches {' '.join(caught)}"


def family_problems(source, path):
    """Where a module at a path within the package knows a family that is not its own."""
    parts = Path(path).parts
    home = parts[1] if parts[0] == "families" and len(parts) > 2 else None
    tree = parsed(source)
    for module, line, _ in imported(tree):
        other = re.match(r"obsdesign\.families\.(\w+)", module)
        stray = other and other[1] in FOLDERS and other[1] != home and (home, other[1]) not in SIDEWAYS
        if stray and path != "families/__init__.py":
            yield f"{path}:{line}: imports {module}"
    if parts[0] == "families":
        return
    for word in (name for name in FAMILIES if not re.fullmatch(r"\w\d", name)):
        known = any(path.startswith(place) for place in NO_FAMILY.get(word, ()))
        if not known and (found := re.search(rf"(?<![a-z]){word}(?![a-z])", source)):
            yield f"{path}:{source.count(chr(10), 0, found.start()) + 1}: names the family {word}"
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "isinstance":
            asked = {name for name in names(node.args[1]) if name.endswith(OWN)}
            if asked:
                yield f"{path}:{node.lineno}: asks whether something is a {', '.join(asked)}"


@pytest.mark.parametrize("path", FILES, ids=lambda p: str(p.relative_to(ROOT)))
def test_a_module_knows_no_family_but_its_own(path):
    assert list(family_problems(path.read_text(), path.relative_to(ROOT).as_posix())) == []


@pytest.mark.parametrize(
    ("path", "source"),
    [
        ("simulate/run.py", "from obsdesign.families.incremental.theorems import Linf"),
        ("families/sporadic/design.py", "from obsdesign.families.lipschitz.claim import Claim"),
        ("families/incremental/design.py", "from obsdesign.families.lipschitz.claim import Claim"),
        ("families/outcome.py", "from obsdesign.families.lipschitz.claim import Claim"),
        ("simulate/run.py", "x = 'linf'"),
        ("plot/run.py", "# for a sporadic observer"),
        ("simulate/run.py", "lipschitz = 1"),
        ("design.py", "isinstance(x, SporadicRequest)"),
        ("plot/run.py", "isinstance(x, (int, Outcome))"),
    ],
)
def test_a_module_that_knows_another_family_is_found(path, source):
    assert list(family_problems(source, path))


def test_no_import_leads_back_to_where_it_began():
    own = {name: list(imports_of(name)) for name in MODULES}
    done = set()

    def visit(name, trail):
        assert name not in trail, " imports ".join((*trail[trail.index(name) :], name))
        if name not in done:
            for other in own[name]:
                visit(other, (*trail, name))
            done.add(name)

    for name in MODULES:
        visit(name, ())


def imports_of(name):
    """Modules of the package that a module imports when it is imported itself."""
    for node in parsed(MODULES[name].read_text()).body:
        if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith("obsdesign."):
            inner = [f"{node.module}.{alias.name}" for alias in node.names]
            modules = [module for module in inner if module in MODULES]
            yield from modules
            if len(modules) < len(inner):
                yield node.module


@pytest.mark.parametrize("path", FILES, ids=lambda p: str(p.relative_to(ROOT)))
def test_a_module_and_its_functions_can_be_read_in_one_go(path):
    source = path.read_text()
    functions = [n for n in ast.walk(parsed(source)) if isinstance(n, ast.FunctionDef)]
    long = [n.name for n in functions if n.end_lineno - n.lineno + 1 > LONGEST_FUNCTION]
    assert (source.count("\n") <= LONGEST_MODULE, long) == (True, [])


@pytest.mark.parametrize("path", FILES, ids=lambda p: str(p.relative_to(ROOT)))
def test_a_module_imports_only_what_is_below_it(path):
    assert list(problems(path.read_text(), path.relative_to(ROOT).as_posix())) == []


@pytest.mark.parametrize(
    ("path", "source"),
    [
        ("errors.py", "from obsdesign.lmi.formula import rational"),
        ("lmi/formula.py", "import obsdesign.model.plant"),
        ("lmi/proof.py", "from obsdesign.expressions import Expression"),
        ("dissipation/inequality.py", "from obsdesign.nonlinearities.slope import slope"),
        ("nonlinearities/slope.py", "def f():\n    from obsdesign.families.incremental import l2"),
        ("spec/model.py", "from obsdesign.work import solve"),
        ("dissipation/gain.py", "from obsdesign.cli import app"),
        ("plot/run.py", "from obsdesign.simulate import Run"),
        ("model/plant.py", "from ..spec import Spec"),
        ("dissipation/engine.py", "import clarabel"),
        ("lmi/solvers.py", "import clarabel"),
        ("dissipation/gain.py", "def f():\n    from cvxpy import Variable"),
        ("reading/values.py", "from yaml import load"),
        ("cli/solve.py", "def f():\n    from matplotlib import pyplot"),
        ("simulate/integrate.py", "from scipy.integrate import LSODA"),
        ("simulate/integrate.py", "import scipy.linalg as sl"),
        ("files/write.py", "print('x')"),
        ("files/write.py", "import sys\nsys.exit(1)"),
        ("files/write.py", "raise SystemExit(1)"),
        ("expressions/parse.py", "eval('1')"),
        ("expressions/parse.py", "def f():\n    return exec('1')"),
        ("expressions/parse.py", "import pickle"),
        ("expressions/parse.py", "from sympy import sympify"),
        ("cli/solve.py", "try:\n    pass\nexcept Exception:\n    pass"),
        ("cli/solve.py", "try:\n    pass\nexcept:\n    pass"),
        ("cli/solve.py", "import typer\ntyper.echo('::error::')"),
    ],
)
def test_a_module_that_breaks_a_rule_is_found(path, source):
    assert list(problems(source, path))


def test_a_module_that_keeps_the_rules_is_not_found():
    source = (
        "from typing import TYPE_CHECKING\nimport numpy\nfrom obsdesign.errors import UsageError\n"
        "if TYPE_CHECKING:\n    from scipy.integrate import LSODA\n"
        "def f():\n    from scipy.integrate import LSODA\n"
        "    try:\n        f()\n    except BaseException:\n        raise\n"
    )
    assert list(problems(source, "simulate/integrate.py")) == []


def test_every_part_of_the_package_has_its_layer():
    assert {place(name.removeprefix("obsdesign.")) for name in MODULES} - {"obsdesign"} <= set(LEVEL)


@pytest.mark.parametrize("path", FILES, ids=lambda p: str(p.relative_to(ROOT)))
def test_no_source_contains_what_could_run_a_text(path):
    assert re.findall(r"(?<![\w.])(?:eval|exec)\(|pickle|sympify", path.read_text()) == []


@pytest.mark.parametrize("name", sorted(set(MODULES) - {"obsdesign.__main__"}))
def test_everything_public_is_described_and_exists(name):
    module = importlib.import_module(name)
    assert module.__doc__ or MODULES[name].read_text() == ""
    for public in getattr(module, "__all__", ()):
        assert hasattr(module, public), f"{name}.__all__ holds {public}"
    missing = [
        f"{name}.{node.name}"
        for node in ast.walk(parsed(MODULES[name].read_text()))
        if isinstance(node, ast.ClassDef | ast.FunctionDef) and not node.name.startswith("_")
        if not ast.get_docstring(node) and node.name not in local(MODULES[name])
    ]
    assert missing == []


def local(path):
    """Names of the functions inside functions: these are nobody else's."""
    tree = parsed(path.read_text())
    outer = [n for n in ast.walk(tree) if isinstance(n, ast.FunctionDef)]
    return {n.name for f in outer for n in ast.walk(f) if isinstance(n, ast.FunctionDef) and n is not f}
