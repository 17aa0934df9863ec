#!/usr/bin/env python3
"""Installs a build into a fresh folder and builds and runs the programs of README.md and docs/library.md against it, as another project does.

usage: install_test.py BUILD SOURCE
"""

import pathlib
import re
import shutil
import subprocess
import sys
import tempfile


def run(*command, folder=None, status=0):
    done = subprocess.run([str(word) for word in command], cwd=folder, capture_output=True, text=True, timeout=900)
    if done.returncode != status:
        sys.exit(f"{' '.join(map(str, command))}: exit code {done.returncode}\n{done.stdout}{done.stderr}")
    return done.stdout


def blocks(path, language):
    return re.findall(rf"^```{language}\n(.*?)^```$", path.read_text(), re.M | re.S)


def expect(text, *patterns):
    for pattern in patterns:
        if not re.search(pattern, text, re.M):
            sys.exit(f"'{pattern}' isn't in:\n{text}")


def check_headers(prefix, source):
    """The public headers are all that is installed."""
    installed = sorted(p for p in (prefix / "include").rglob("*") if p.is_file())
    public = sorted((source / "include/tessera").glob("*.h"))
    names = [p.relative_to(prefix / "include") for p in installed]
    if names != [p.relative_to(source / "include") for p in public]:
        sys.exit(f"installed headers: {[str(name) for name in names]}")


def build_programs(folder, prefix, source):
    """One project: the README's lines of CMake and its program as they stand, then a program more for each of docs/library.md, and a
    source for each public header, which must compile alone."""
    cmake = blocks(source / "README.md", "cmake")
    sample = blocks(source / "README.md", "cpp")
    programs = blocks(source / "docs/library.md", "cpp")
    if (len(cmake), len(sample), len(programs)) != (1, 1, 5):
        sys.exit(f"README.md has {len(cmake)} blocks of CMake and {len(sample)} of C++, docs/library.md {len(programs)} of C++")
    project = folder / "project"
    project.mkdir()
    (project / "flow.cpp").write_text(sample[0])
    lines = cmake[0]
    names = ["progress", "own_mesh", "series", "point", "algorithm"]
    for name, text in zip(names, programs):
        (project / f"{name}.cpp").write_text(text)
        lines += f"add_executable({name} {name}.cpp)\ntarget_link_libraries({name} PRIVATE Tessera::tessera)\n"
    headers = sorted((prefix / "include/tessera").glob("*.h"))
    for header in headers:
        (project / f"alone_{header.stem}.cpp").write_text(f'#include "tessera/{header.name}"\n')
    lines += f"add_library(alone OBJECT {' '.join(f'alone_{header.stem}.cpp' for header in headers)})\n"
    lines += "target_link_libraries(alone PRIVATE Tessera::tessera)\n"
    (project / "CMakeLists.txt").write_text(lines)
    launcher = ["-DCMAKE_CXX_COMPILER_LAUNCHER=ccache"] if shutil.which("ccache") else []
    run("cmake", "-S", project, "-B", folder / "build", "-G", "Ninja", f"-DCMAKE_PREFIX_PATH={prefix}",
        "-DCMAKE_CXX_FLAGS=-Wall -Wextra -Werror", *launcher)
    run("cmake", "--build", folder / "build")
    return folder / "build"


def main():
    build, source = (pathlib.Path(word).resolve() for word in sys.argv[1:3])
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        prefix = folder / "prefix"
        run("cmake", "--install", build, "--prefix", prefix)
        tessera = prefix / "bin/tessera"
        check_headers(prefix, source)
        programs = build_programs(folder, prefix, source)
        work = folder / "work"
        work.mkdir()
        mesh = source / "data/freefem-stokes-sphere/stokes_p1.vtu"
        for copy in ("flow.vtu", "run_1.vtu", "run_2.vtu"):
            shutil.copy(mesh, work / copy)

        def verify(mesh_name, vdb):
            expect(run(tessera, "verify", mesh_name, vdb, folder=work), "the file's claims hold")

        text = run(programs / "flow", folder=work)
        expect(text, r"^pressure: off by at most [\d.e+-]+$", r"^velocity: off by at most [\d.e+-]+$")
        verify("flow.vtu", "flow.vdb")
        run(tessera, "resample", "flow.vtu", "-o", "same.vdb", "--refine", "error", "--max-error", "5%", "--field", "pressure,velocity", "-q",
            folder=work)
        if (work / "flow.vdb").read_bytes() != (work / "same.vdb").read_bytes():
            sys.exit("the program and the command line write different files")
        expect(run(tessera, "info", "flow.vdb", folder=work), "flow.vtu", "software", "error", "pressure", "velocity")

        expect(run(programs / "progress", folder=work), r"^[1-9]\d* bricks, [1-9]\d* calls$",
               r"^[1-9]\d+ bytes, off by at most [\d.e+-]+$")
        verify("flow.vtu", "flat.vdb")
        # Without its mesh: a clear sentence, and exit code 2.
        empty = folder / "empty"
        empty.mkdir()
        run(programs / "progress", folder=empty, status=2)

        text = run(programs / "own_mesh", folder=work)
        expect(text, r"^height 0\.300$", r"^far away: none$")
        covered = sum(int(n) for n in re.findall(r": (\d+) samples in the mesh$", text, re.M))
        if covered != 33 * 34 * 35 // 6:  # i + j + k <= 32
            sys.exit(f"{covered} samples of the tetrahedron are covered")

        text = run(programs / "series", folder=work)
        spacings = re.findall(r"^run_\d\.vtu: out_\d\.vdb, spacing (\S+)$", text, re.M)
        if len(spacings) != 2 or len(set(spacings)) != 1:
            sys.exit(f"two steps have spacings {spacings}")
        verify("run_2.vtu", "out_1.vdb")

        text = run(programs / "point", folder=work)
        expect(text, r"^spacing 0\.02: \d+ of 4096 points in the mesh, pressure \S+$", r"^spacing 0\.0025: \d+ of 4096 ")

        text = run(programs / "algorithm", folder=work)
        expect(text, "^software$", "^plain$", r"^by plain: off by at most [\d.]+(e-\d+)?$")
        if float(text.split()[-1]) > 1e-6:
            sys.exit(f"a linear field is off: {text}")
    print("installed, built and run: 6 programs")


if __name__ == "__main__":
    main()
