"""The house: who may import whom, no circle between files, nothing too large to be held in mind.

Every import statement counts as an edge, also one inside a function or under TYPE_CHECKING: both
say that the one file cannot be understood, moved or tested without the other.
"""

import ast
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
MAY_IMPORT = {
    "firmware_protocol": set(),
    "messages": set(),
    "inertial": set(),
    "emulator": {"firmware_protocol"},
    "gateway": {"firmware_protocol", "messages", "inertial"},
    "estimator": {"messages", "inertial"},
    "logs": {"messages", "inertial"},
    "sessions": {"messages", "inertial", "logs"},
    "dashboard": {"messages", "inertial", "logs", "sessions"},
    "sites": {"messages", "inertial", "sessions"},
}
MAY_IMPORT["gyrofree"] = set(MAY_IMPORT)  # the composition root wires them all
LONGEST = 330  # lines of a module
MOST = 22  # modules of a folder
# What is still to be undone. Nothing may be added here; what is done with is taken out.
CIRCLES: list[list[str]] = []
LONG = {
    "inertial/attitude/wiring.py",
    "inertial/navigation/navigation.py",
    "inertial/rate/estimators.py",
    "inertial/rate/products_kernel.py",
    "inertial/rate/products_run.py",
    "inertial/rate/still.py",
}
FULL = {"inertial/navigation", "inertial/rate"}


def modules() -> dict[str, Path]:
    """Every module of the product by its dotted name."""
    found = {}
    for room in MAY_IMPORT:
        for path in sorted((ROOT / room).rglob("*.py")):
            parts = path.relative_to(ROOT).with_suffix("").parts
            found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


def imports(path: Path) -> set[str]:
    """Every dotted name that a file asks for: of a from-import the module and each name in it."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text(), str(path))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0 and node.module, f"{path}: import by the whole name"
            found |= {node.module} | {f"{node.module}.{alias.name}" for alias in node.names}
    return found


@cache
def graph() -> dict[str, frozenset[str]]:
    """Module -> modules that it imports. `from a import b` is an edge to a.b where that is one."""
    known = modules()
    edges = {}
    for name, path in known.items():
        asked = imports(path)
        finer = {a for a in asked if any(b.startswith(f"{a}.") and b in known for b in asked)}
        edges[name] = frozenset((asked & known.keys()) - finer - {name})
    return edges


def circles(edges: dict[str, frozenset[str]]) -> list[list[str]]:
    """Groups of modules each of which reaches every other (Tarjan's components of two and more)."""
    order: dict[str, int] = {}
    low: dict[str, int] = {}
    path: list[str] = []
    found = []

    def visit(name: str) -> None:
        order[name] = low[name] = len(order)
        path.append(name)
        for other in sorted(edges[name]):
            if other not in order:
                visit(other)
                low[name] = min(low[name], low[other])
            elif other in path:
                low[name] = min(low[name], order[other])
        if low[name] == order[name]:
            group = path[path.index(name) :]
            del path[path.index(name) :]
            if len(group) > 1:
                found.append(sorted(group))

    for name in edges:
        if name not in order:
            visit(name)
    return found


def test_a_circle_is_found_where_there_is_one():
    edges = {"a": {"b"}, "b": {"c", "d"}, "c": {"a"}, "d": {"e"}, "e": set(), "f": {"f2"}}
    edges |= {"f2": {"f"}}
    frozen = {name: frozenset(others) for name, others in edges.items()}
    assert sorted(circles(frozen)) == [["a", "b", "c"], ["f", "f2"]]


def test_imports_in_functions_and_for_types_are_seen(tmp_path):
    text = "def f():\n    from a import b\nif TYPE_CHECKING:\n    import c.d\n"
    (tmp_path / "one.py").write_text(text)
    assert imports(tmp_path / "one.py") == {"a", "a.b", "c.d"}


def test_no_circle_between_files():
    assert [group for group in circles(graph()) if group not in CIRCLES] == []


@pytest.mark.parametrize("room", MAY_IMPORT)
def test_imports_follow_the_data(room):
    mine = {name: others for name, others in graph().items() if name.split(".")[0] == room}
    assert mine, f"{room}/ holds no Python"
    for name, others in mine.items():
        rooms = {other.split(".")[0] for other in others} - {room}
        assert rooms <= MAY_IMPORT[room], (name, rooms - MAY_IMPORT[room])


def test_gateway_and_estimator_are_imported_by_the_composition_root_only():
    for name, others in graph().items():
        for service in ("gateway", "estimator"):
            if name.split(".")[0] not in (service, "gyrofree"):
                assert not any(other.split(".")[0] == service for other in others), name


def test_no_service_shell_imports_another():
    for name, others in graph().items():
        room = name.split(".")[0]
        shells = {o for o in others if o.endswith(".service") and o.split(".")[0] != room}
        assert room == "gyrofree" or not shells, (name, shells)


def test_no_file_grows_beyond_what_a_reader_can_hold():
    long = {
        str(path.relative_to(ROOT)): lines
        for path in modules().values()
        if not path.stem.endswith("_pb2")
        and (lines := len(path.read_text().splitlines())) > LONGEST
    }
    assert not long.keys() - LONG, long


def test_no_folder_grows_beyond_what_a_reader_can_hold():
    folders: dict[str, int] = {}
    for path in modules().values():
        folder = str(path.parent.relative_to(ROOT))
        folders[folder] = folders.get(folder, 0) + 1
    full = {folder: count for folder, count in folders.items() if count > MOST}
    assert not full.keys() - FULL, full


def test_every_process_of_ours_leaves_the_working_folder_alone():
    """`sys.executable` is followed by -P wherever the product starts an interpreter."""
    seen = 0
    for name, path in modules().items():
        for node in ast.walk(ast.parse(path.read_text())):
            if not isinstance(node, ast.List):
                continue
            words = [ast.unparse(word) for word in node.elts]
            if "sys.executable" in words:
                seen += 1
                assert words[words.index("sys.executable") + 1] == "'-P'", (name, words)
    assert seen >= 2
