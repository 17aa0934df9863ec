#!/usr/bin/env python3
"""Checks every #include in the tree, and every link list in CMake, against the list of folders in docs/architecture.md."""

import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
HEAVY_FILES = 6  # .cpp files of a room that may include OpenVDB or VTK


def read_table():
    """Folder -> set of layers that it may include."""
    text = re.sub(r"\n  +", " ", (ROOT / "docs/architecture.md").read_text())
    rows = {}
    for match in re.finditer(r"^- `(?:src/)?(\w+)/` \(may include ([\w, ]+)\):", text, re.M):
        rows[match.group(1)] = set(re.findall(r"\w+", match.group(2))) - {"nothing"}
    return rows


def closure(rows, name):
    reached, todo = {name}, [name]
    while todo:
        for other in rows[todo.pop()]:
            if other not in reached:
                reached.add(other)
                todo.append(other)
    return reached


def source_files(folder):
    return sorted(p for ext in ("*.h", "*.cpp") for p in folder.rglob(ext))


def public_headers():
    """Name of a public header as it is included -> the room it belongs to: that with the source of its name, or base."""
    rooms = {}
    for path in sorted((ROOT / "include/tessera").iterdir()):
        sources = [p for p in (ROOT / "src").glob("*/" + path.stem + ".cpp") if not p.with_suffix(".h").is_file()]
        rooms[f"tessera/{path.name}"] = sources[0].parent.name if sources else "base"
    return rooms


def check_public_headers(problems):
    """They include one another, the standard library and GLM, and nothing else."""
    for path in source_files(ROOT / "include"):
        for include in re.findall(r"^\s*#\s*include\s*(.*)$", path.read_text(), re.M):
            if not re.match(r'"tessera/\w+\.h"$|<[a-z_0-9]+>$|<glm/[\w/]+\.hpp>$', include):
                problems.append(f"{path.relative_to(ROOT)} includes {include}")


def check_includes(rows, problems):
    public = public_headers()
    layers = {p.name for p in (ROOT / "src").iterdir() if p.is_dir()}
    for missing in sorted(layers - set(rows)):
        problems.append(f"src/{missing}/ isn't listed in docs/architecture.md")
    checked = 0
    for name in rows:
        folder = ROOT / "src" / name if name in layers else ROOT / name
        if not folder.is_dir():
            problems.append(f"docs/architecture.md names {name}, and there is no such folder")
            continue
        allowed = closure(rows, name)
        for path in source_files(folder):
            checked += 1
            for include in re.findall(r'^\s*#\s*include\s*[<"]([^>"]+)[>"]', path.read_text(), re.M):
                top = public.get(include, include.split("/")[0])
                if "/" in include and top in layers and top not in allowed:
                    problems.append(f"{path.relative_to(ROOT)} includes {include}: {name} may not include {top}")
    return checked


def check_links(rows, problems):
    for name in rows:
        cmake = ROOT / "src" / name / "CMakeLists.txt"
        if not cmake.is_file():
            continue
        text = re.sub(r"#[^\n]*", "", cmake.read_text())
        call = re.search(r"tessera_layer\(\s*" + name + r"\b(.*?)\)\s*$", text, re.S | re.M)
        if not call:
            problems.append(f"{cmake.relative_to(ROOT)} makes no layer {name}")
            continue
        linked = re.search(r"(?<![A-Z_])LINK\b([a-z_\s]*)", call.group(1))
        links = set(linked.group(1).split()) if linked else set()
        if closure({**rows, name: links}, name) != closure(rows, name):
            problems.append(f"{cmake.relative_to(ROOT)} links {sorted(links)}, docs/architecture.md says {sorted(rows[name])}")


def check_heavy(problems):
    """One room includes OpenVDB, one VTK and one TetGen, in few translation units; its headers that do are its own and the tests'."""
    def includes(path, pattern):
        return re.search(r"^\s*#\s*include\s*[<\"]" + pattern, path.read_text(), re.M)

    paths = [p for folder in ("src", "apps", "tests") for p in source_files(ROOT / folder)]
    for library, pattern, room in (("OpenVDB", r"(?:open|nano)vdb/", "vdb"), ("VTK", r"vtk\w+\.h", "mesh_files"), ("TetGen", r"tetgen\.h", "tetgen")):
        heavy = [p for p in source_files(ROOT / "src" / room) if p.suffix == ".h" and includes(p, pattern)]
        for header in heavy:  # those included by an earlier one count through it
            heavy += [p for p in source_files(ROOT / "src" / room) if p.suffix == ".h" and p not in heavy and includes(p, f"{room}/{header.name}")]
        anyway = "(?:" + "|".join([pattern] + [f"{room}/" + re.escape(p.name) for p in heavy]) + ")"
        users = [p.relative_to(ROOT) for p in paths if includes(p, anyway)]
        for path in users:
            if path.parts[:2] != ("src", room) and path.parts[0] != "tests":
                problems.append(f"{path} includes {library}; only src/{room} may")
        units = [str(p) for p in users if p.parts[0] == "src" and p.suffix == ".cpp"]
        if len(units) > HEAVY_FILES:
            problems.append(f"{library} is included in more than {HEAVY_FILES} files of src/{room}: {units}")


def check_headers(problems):
    """Every source file of a room has the header of its name, and no header includes itself through others."""
    includes = {}
    for path in source_files(ROOT / "src") + source_files(ROOT / "include"):
        name = str(path.relative_to(ROOT / path.relative_to(ROOT).parts[0]))
        if path.suffix == ".cpp" and not any(p.with_suffix(".h").is_file() for p in (path, ROOT / "include/tessera" / path.name)):
            problems.append(f"src/{name} has no header of its name")
        if path.suffix == ".h":
            includes[name] = re.findall(r'^#include "([^"]+)"', path.read_text(), re.M)
    done = set()

    def visit(name, above):
        if name in above:
            problems.append("a circle of includes: " + " -> ".join(above[above.index(name):] + [name]))
        elif name not in done:
            for other in includes.get(name, []):
                visit(other, above + [name])
            done.add(name)

    for name in includes:
        visit(name, [])


def main():
    problems = []
    rows = read_table()
    if len(rows) < 9:
        problems.append("docs/architecture.md has no readable list of folders")
    else:
        checked = check_includes(rows, problems)
        if checked < 20:
            problems.append(f"only {checked} source files found")
        check_public_headers(problems)
        check_links(rows, problems)
        check_heavy(problems)
        check_headers(problems)
    for problem in problems:
        print(problem)
    print(f"layering: {len(problems)} problems")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
