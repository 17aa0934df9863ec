"""Damages sets of files: parallel, multi-block and series files of VTK, TetGen, Exodus, CGNS, EnSight and OpenFOAM. Which file of a set is damaged, and how,
follows from seed and index."""

import gzip
import pathlib
import random
import re
import struct
import subprocess
import tempfile
import zlib

import mutate_mesh

PLAIN_FORMATS = ["parallel", "multiblock", "series", "tetgen"]  # made here
WRITTEN_FORMATS = ["exodus", "cgns", "ensight", "openfoam"]  # by write_box_files
NAMING = (".pvtu", ".pvts", ".pvtr", ".pvti", ".vtm", ".vtmb", ".pvd", ".case", ".foam", ".ex2", ".cgns", ".node")  # what a set is read by
WORDS = [0, 1, 2, 3, 7, 8, 255, 256, 65535, 65536, 10**6, 2**24, 2**27, 2**30, 2**31 - 1, 2**31, 2**32 - 2, 2**32 - 1, 2**40, 2**62, 2**63 - 1, 2**63, 2**64 - 1]
TEXT_NUMBERS = [str(n) for n in mutate_mesh.NUMBERS] + ["nan", "-nan", "inf", "-inf", "1e999", "-1e308", "1e-320", "0x10", "1.5", "-", "+", ".", "9" * 400, "1 2", ""]
NUMBER = re.compile(rb"-?\d+(?:\.\d*)?(?:[eE][-+]?\d+)?")
WORD = re.compile(rb"[^\s\"<>=;(){}]+|[\"<>=;(){}]")


def parallel_text(kind, extent, pieces):
    whole = f' WholeExtent="{extent}"' if extent else ""
    points = {"PStructuredGrid": "<PPoints><PDataArray type='Float64' NumberOfComponents='3'/></PPoints>", "PUnstructuredGrid": "<PPoints><PDataArray type='Float64' NumberOfComponents='3'/></PPoints>",
              "PRectilinearGrid": "<PCoordinates>" + "<PDataArray type='Float64'/>" * 3 + "</PCoordinates>", "PImageData": ""}[kind].replace("'", '"')  # fmt: skip
    geometry = ' Origin="0 0 0" Spacing="0.5 1 2"' if kind == "PImageData" else ""
    return f"""<?xml version="1.0"?>
<VTKFile type="{kind}" version="0.1" byte_order="LittleEndian">
<{kind}{whole}{geometry} GhostLevel="0">
<PPointData Scalars="f"><PDataArray type="Float64" Name="f"/><PDataArray type="Float32" Name="v" NumberOfComponents="3"/></PPointData>
<PCellData><PDataArray type="Int32" Name="material"/></PCellData>
{points}
{pieces}
</{kind}>
</VTKFile>
""".encode()


def parallel_sets():
    sets = {}
    for style in ("ascii", "raw-zlib"):
        pieces = {f"part_{i}.vtu": make(mutate_mesh.STYLES[style]).serialise() for i, make in enumerate((mutate_mesh.tets, mutate_mesh.mixed))}
        names = "\n".join(f'<Piece Source="{name}"/>' for name in pieces)
        sets[f"pvtu-{style}"] = {"mesh.pvtu": parallel_text("PUnstructuredGrid", "", names), **pieces}
    for kind in ("StructuredGrid", "RectilinearGrid", "ImageData"):
        pieces, names = {}, ""
        for i, extent in enumerate(("0 2 0 3 0 1", "2 4 0 3 0 1")):
            file = mutate_mesh.structured(mutate_mesh.STYLES["ascii"], kind)
            file.grid["WholeExtent"] = file.piece["Extent"] = extent
            name = f"part_{i}{file.extension}"
            pieces[name] = file.serialise()
            names += f'<Piece Extent="{extent}" Source="{name}"/>\n'
        sets[kind] = {"mesh.p" + file.extension[1:]: parallel_text("P" + kind, "0 4 0 3 0 1", names), **pieces}
    return sets


def multiblock_sets():
    ascii_style, raw = mutate_mesh.STYLES["ascii"], mutate_mesh.STYLES["raw"]
    blocks = {"tets.vtu": mutate_mesh.tets(raw).serialise(), "grid.vts": mutate_mesh.structured(ascii_style, "StructuredGrid").serialise(),
              "image.vti": mutate_mesh.structured(raw, "ImageData").serialise()}  # fmt: skip
    head = '<?xml version="1.0"?>\n<VTKFile type="vtkMultiBlockDataSet" version="1.0" byte_order="LittleEndian">\n<vtkMultiBlockDataSet>\n'
    tail = "</vtkMultiBlockDataSet>\n</VTKFile>\n"
    entries = [f'<DataSet index="{i}" name="{name}" file="{name}"/>\n' for i, name in enumerate(blocks)]
    nested = f'<Block index="0">\n{entries[0]}</Block>\n<Block index="1">\n<Block index="0">\n{entries[1]}</Block>\n{entries[2]}</Block>\n'
    return {"flat": {"mesh.vtm": (head + "".join(entries) + tail).encode(), **blocks}, "nested": {"mesh.vtmb": (head + nested + tail).encode(), **blocks}}


def series_sets():
    style = mutate_mesh.STYLES["base64"]
    steps = {f"run_{i}.vtu": make(style).serialise() for i, make in enumerate((mutate_mesh.tets, mutate_mesh.tets, mutate_mesh.polyhedra))}
    head, tail = '<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1">\n<Collection>\n', "</Collection>\n</VTKFile>\n"

    def collection(entries):
        return (head + "".join(f"<DataSet {entry}/>\n" for entry in entries) + tail).encode()

    parts = [f'timestep="{i // 2}" part="{i % 2}" file="run_{i % 3}.vtu"' for i in range(4)]
    pieces = multiblock_sets()["flat"]
    return {
        "steps": {"run.pvd": collection(f'timestep="{0.5 * i}" group="" part="0" file="{name}"' for i, name in enumerate(steps)), **steps},
        "parts": {"run.pvd": collection(parts), **steps},
        "blocks": {"run.pvd": collection(['timestep="0" file="mesh.vtm"']), **pieces},
    }


def tetgen_sets():
    points = mutate_mesh.CORNERS + [(2.0, 0.5, 0.5)]
    tets = mutate_mesh.TETS + [(1, 8, 3, 7)]
    sets = {}
    for first in (0, 1):
        nodes = f"# nodes\n{len(points)} 3 2 1\n" + "".join(f"{i + first} {x} {y} {z} {x - z} {y} 0\n" for i, (x, y, z) in enumerate(points))
        elements = f"{len(tets)} 4 1\n" + "".join(f"{i + first} {' '.join(str(n + first) for n in tet)} {i % 2}\n" for i, tet in enumerate(tets))
        sets[f"from-{first}"] = {"mesh.node": nodes.encode(), "mesh.ele": (elements + "# end\n").encode()}
    return sets


def written_sets(writer):
    """FORMAT -> case -> files, as write_box_files writes them; OpenFOAM's also packed by gzip."""
    with tempfile.TemporaryDirectory(prefix="tessera-boxes-") as folder:
        subprocess.run([writer, folder], check=True)
        found = {}
        for path in sorted(pathlib.Path(folder).rglob("*")):
            if path.is_file():
                kind, case, *name = path.relative_to(folder).parts
                found.setdefault(kind, {}).setdefault(case, {})["/".join(name)] = path.read_bytes()
    packed = {}
    for name, data in found["openfoam"]["text"].items():
        is_plain = name.endswith((".foam", "controlDict"))
        packed[name if is_plain else name + ".gz"] = data if is_plain else gzip.compress(data, mtime=0)
    found["openfoam"]["packed"] = packed
    return found


def sound_sets(formats, writer):
    """FORMAT -> case -> {file name: bytes}, undamaged."""
    made = {"parallel": parallel_sets, "multiblock": multiblock_sets, "series": series_sets, "tetgen": tetgen_sets}
    written = written_sets(writer) if set(formats) & set(WRITTEN_FORMATS) else {}
    return {name: made[name]() if name in made else written[name] for name in formats}


def named_file(files):
    return next(name for name in files if name.endswith(NAMING))


def is_text(data):
    return b"\0" not in data and sum(byte > 126 for byte in data[:1000]) < 10


def damage_text(data, rng):
    lines = data.split(b"\n")
    kind = rng.randrange(8)
    if kind <= 2:
        found = NUMBER.search(data, rng.randrange(len(data)))
        if found:
            old = found.group()
            near = str(mutate_mesh.near(rng, int(old))) if old.lstrip(b"-").isdigit() and len(old) < 20 else ""
            new = (near if near and rng.random() < 0.5 else rng.choice(TEXT_NUMBERS)).encode()
            return data[: found.start()] + new + data[found.end() :], "number"
    if kind == 3:
        at = rng.randrange(len(lines))
        return b"\n".join(lines[:at] + [lines[at]] * rng.choice([0, 2, 2, 50]) + lines[at + 1 :]), "line"
    if kind == 4:
        first, second = rng.randrange(len(lines)), rng.randrange(len(lines))
        lines[first], lines[second] = lines[second], lines[first]
        return b"\n".join(lines), "lines swapped"
    if kind <= 6:  # a word put in the place of another, or before it
        words = [found.span() for found in WORD.finditer(data)]
        if words:
            (begin, end), (first, last) = rng.choice(words), rng.choice(words)
            return data[: begin if rng.random() < 0.5 else end] + b" " * rng.randrange(2) + data[first:last] + data[end:], "word"
    return damage_binary(data, rng)


def size_at(data, rng):
    """Where a small number stands, and how it is written: sizes and counts are such numbers."""
    for _ in range(200):
        width, order = rng.choice([4, 4, 8]), rng.choice(["little", "big"])
        at = rng.randrange(max(1, len(data) - width))
        if rng.random() < 0.8:
            at -= at % 4
        if 0 < int.from_bytes(data[at : at + width], order) < 5000 or rng.random() < 0.01:
            return at, width, order
    return 0, 4, "little"


def damage_binary(data, rng):
    data = bytearray(data)
    at, length = rng.randrange(len(data)), rng.choice([1, 4, 8, 16, 64, 512])
    kind = rng.randrange(14)
    if kind <= 1:
        data[at] ^= 1 << rng.randrange(8)
        how = "bit"
    elif kind == 2:
        data[at] = rng.choice([0, 0xFF, 0x7F, 0x80, rng.randrange(256)])
        how = "byte"
    elif kind == 3:
        run = data[at : at + length]
        data[at : at + len(run)] = rng.choice([bytes(len(run)), b"\xff" * len(run), rng.randbytes(len(run))])
        how = "run"
    elif kind == 4:
        del data[at:]
        how = "cut"
    elif kind == 5:
        data[at:at] = rng.choice([rng.randbytes(length), bytes(data[at : at + length]), bytes(length)])
        how = "insertion"
    elif kind == 6:
        del data[at : at + length]
        how = "removal"
    elif kind == 7:
        other = rng.randrange(len(data))
        first, second = bytes(data[at : at + length]), bytes(data[other : other + length])
        data[at : at + len(second)] = second
        data[other : other + len(first)] = first
        how = "pieces swapped"
    else:
        for _ in range(rng.choice([1, 1, 1, 2, 4])):
            at, width, order = size_at(data, rng)
            old = int.from_bytes(data[at : at + width], order)
            new = rng.choice([old + 1, old - 1, old * 2, old * 256, len(data)]) if rng.random() < 0.4 else rng.choice(WORDS)
            data[at : at + width] = (new & (1 << 8 * width) - 1).to_bytes(width, order)
        how = "size"
    return bytes(data), how


def damage(data, rng):
    if not data:
        return rng.choice([b"\0", b"\n", b"FoamFile\n{\n", rng.randbytes(50)]), "filled"
    if is_text(data):
        return damage_text(data, rng) if rng.random() < 0.85 else damage_binary(data, rng)
    return damage_binary(data, rng) if rng.random() < 0.8 else damage_text(data, rng)


def damage_packed(name, data, rng):
    """What is packed by gzip is damaged within as often as without."""
    if name.endswith(".gz") and rng.random() < 0.5:
        try:
            data, how = damage(gzip.decompress(data), rng)
            return gzip.compress(data, mtime=0), how + " within"
        except (OSError, EOFError, zlib.error):
            pass  # it was damaged before
    return damage(data, rng)


def damage_set(files, read_by, rng):
    """Files that are missing, empty, or in each other's place."""
    others = [name for name in files if name != read_by]
    name = rng.choice(others or [read_by])
    kind = rng.randrange(3)
    if kind == 0 and others:
        del files[name]
        return f"no {name}"
    if kind == 1:
        files[name] = b""
        return f"{name} empty"
    other = rng.choice(list(files))
    files[name], files[other] = files[other], files[name]
    return f"{name} and {other} swapped"


def make_mutant(sets, name, seed, index):
    """({file name: bytes}, the file that names the set, words that say how it came about). @param sets of that format, by case"""
    rng = random.Random(f"{seed}:{index}:{name}")
    case = rng.choice(list(sets))
    files = dict(sets[case])
    read_by = named_file(files)
    steps = []
    for _ in range(rng.choice([1, 1, 1, 2, 3])):
        if len(files) > 1 and rng.random() < 0.04:
            steps.append(damage_set(files, read_by, rng))
            continue
        chosen = read_by if rng.random() < 0.25 else rng.choice(list(files))
        files[chosen], how = damage_packed(chosen, files[chosen], rng)
        steps.append(f"{chosen}: {how}")
    return files, read_by, f"{case}: {', '.join(steps)}"
