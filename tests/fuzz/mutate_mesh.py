#!/usr/bin/env python3
"""Small meshes in every encoding of VTK's XML and legacy files, and damaged versions of them.

usage: mutate_mesh.py --seed S --index I --output FOLDER   writes one mutant, as run_mutated.py does
       mutate_mesh.py --sound --output FOLDER              writes the undamaged files

A mutant depends on its seed and index only. Damage is done in three places: to the mesh and the markup (counts, names, cell types, node
indices, face streams, extents), to the encoding (block headers, offsets, compressed bytes), and to the bytes of the finished file.
"""

import argparse
import base64
import copy
import lzma
import math
import pathlib
import random
import re
import struct
import sys
import zlib

PACK = {"Int8": "b", "UInt8": "B", "Int16": "h", "UInt16": "H", "Int32": "i", "UInt32": "I", "Int64": "q", "UInt64": "Q", "Float32": "f", "Float64": "d"}
LEGACY_PACK = {"char": "b", "unsigned_char": "B", "int": "i", "vtktypeint64": "q", "float": "f", "double": "d"}
NUMBERS = [0, 1, 2, 3, 4, 7, 8, 10, 42, 127, 128, 255, 256, 1000, 32767, 32768, 65535, 65536, 10**6, 2**24, 2**27, 10**9, 2**31 - 1, 2**31, 2**32 - 1,
           2**32, 2**40, 2**53 + 1, 2**60, 2**62, 2**63 - 1, 2**64 - 1, 10**30, -1, -2, -3, -128, -(2**31), -(2**31) - 1, -(2**63)]  # fmt: skip
REALS = [0.0, -0.0, 1.0, -1.0, 0.5, 1e-300, 5e-324, 1e-30, 1e-9, 1e9, 1e18, 1e30, 3.5e38, 1e150, 1e200, 1e300, 1.7e308, -1.7e308, math.nan, math.inf, -math.inf]
CELL_TYPES = [0, 1, 5, 9, 10, 11, 12, 13, 14, 15, 16, 24, 25, 26, 27, 29, 32, 33, 37, 42, 63, 64, 68, 71, 72, 73, 74, 78, 79, 80, 81, 100, 200, 255]
COMPRESSORS = ["vtkZLibDataCompressor", "vtkLZ4DataCompressor", "vtkLZMADataCompressor", "vtkNoSuchDataCompressor", ""]


def near(rng, value):
    """A number that a reader may trip over, often close to the right one."""
    if rng.random() < 0.4:
        return rng.choice([value - 1, value + 1, value * 2, value // 2, -value, value + rng.randrange(1, 100), value * 1000, 0])
    return rng.choice(NUMBERS)


def packed(code, values, order):
    """Bytes of numbers; what doesn't fit wraps round or overflows as a cast does."""
    result = bytearray()
    for value in values:
        if code in "fd":
            try:
                result += struct.pack(order + code, value)
            except OverflowError:
                result += struct.pack(order + code, math.inf)
        else:
            size = struct.calcsize(code)
            whole = int(value) if math.isfinite(value) else 0
            whole &= (1 << 8 * size) - 1
            result += whole.to_bytes(size, "little" if order == "<" else "big")
    return bytes(result)


def text_of(values):
    return " ".join(repr(v) if isinstance(v, float) else str(v) for v in values)


def lz4_block(data):
    """An LZ4 block that holds its bytes as they are."""
    count = len(data)
    head = bytearray([min(count, 15) << 4])
    if count >= 15:
        rest = count - 15
        while rest >= 255:
            head.append(255)
            rest -= 255
        head.append(rest)
    return bytes(head) + data


def compress(name, data):
    if "LZ4" in name:
        return lz4_block(data)
    if "LZMA" in name:
        return lzma.compress(data, format=lzma.FORMAT_XZ, check=lzma.CHECK_CRC32)
    return zlib.compress(data)


class Array:
    """A DataArray: its attributes, its numbers, and how its encoding is damaged."""

    def __init__(self, name, type_name, components, values):
        self.attributes = {"type": type_name, "Name": name, "NumberOfComponents": components}
        self.values = list(values)
        self.stored_type = type_name  # what the bytes are, whatever the attribute comes to say
        self.damage_header = None  # a function of the list of header numbers
        self.damage_payload = None  # a function of the bytes after the header
        self.offset = None  # in place of the right one

    def encoded(self, style):
        """The bytes between the tags, or in the appended section."""
        order = "<" if style["byte_order"] == "LittleEndian" else ">"
        data = packed(PACK[self.stored_type], self.values, order)
        if style["compressor"]:
            size = style["block_size"]
            blocks = [data[i : i + size] for i in range(0, len(data), size)]
            parts = [compress(style["compressor"], block) for block in blocks]
            last = len(data) % size if data else 0
            header = [len(blocks), size, last] + [len(part) for part in parts]
            data = b"".join(parts)
        else:
            header = [len(data)]
        if self.damage_header:
            self.damage_header(header)
        if self.damage_payload:
            data = self.damage_payload(data)
        head = packed("I" if style["header_type"] == "UInt32" else "Q", header, order)
        if style["raw"]:
            return head + data
        if style["compressor"]:
            return base64.b64encode(head) + base64.b64encode(data)
        return base64.b64encode(head + data)


class Section:
    def __init__(self, tag, arrays, attributes=None):
        self.tag, self.arrays, self.attributes = tag, arrays, attributes or {}


class XmlFile:
    """A VTK XML file of one of the four kinds of grid, or a parallel file that names others."""

    def __init__(self, kind, extension, style, sections, grid=None, piece=None):
        self.kind, self.extension, self.style, self.sections = kind, extension, dict(style), sections
        self.grid, self.piece = grid or {}, piece or {}
        self.pieces = 1
        self.root = {}  # attributes of <VTKFile> that differ from what the style says

    def arrays(self):
        return [array for section in self.sections for array in section.arrays]

    def array(self, name):
        return next((a for a in self.arrays() if a.attributes.get("Name") == name), None)

    def serialise(self):
        style, appended, body = self.style, bytearray(), bytearray()
        for section in self.sections:
            body += tag_text(section.tag, section.attributes)
            for array in section.arrays:
                body += self.array_text(array, appended)
            body += f"</{section.tag}>\n".encode()
        root = {"type": self.kind, "version": "1.0" if style["header_type"] == "UInt64" else "0.1", "byte_order": style["byte_order"]}
        root["header_type"] = style["header_type"]
        if style["compressor"]:
            root["compressor"] = style["compressor"]
        root.update(self.root)
        result = b'<?xml version="1.0"?>\n' + tag_text("VTKFile", root) + tag_text(self.kind, self.grid)
        for _ in range(self.pieces):
            result += tag_text("Piece", self.piece) + bytes(body) + b"</Piece>\n"
        result += f"</{self.kind}>\n".encode()
        if style["format"] == "appended":
            encoding = "raw" if style["raw"] else "base64"
            result += f'<AppendedData encoding="{encoding}">\n_'.encode() + bytes(appended) + b"\n</AppendedData>\n"
        return result + b"</VTKFile>\n"

    def array_text(self, array, appended):
        attributes = {**array.attributes, "format": array.attributes.get("format", self.style["format"])}
        if self.style["format"] == "appended":
            attributes["offset"] = len(appended) if array.offset is None else array.offset
            appended += array.encoded(self.style)
            return tag_text("DataArray", attributes) + b"</DataArray>\n"
        content = text_of(array.values).encode() if self.style["format"] == "ascii" else array.encoded(self.style)
        return tag_text("DataArray", attributes) + content + b"\n</DataArray>\n"


def tag_text(tag, attributes):
    quoted = "".join(f' {key}="{value}"' for key, value in attributes.items())
    return f"<{tag}{quoted}>\n".encode()


class LegacyFile:
    """A legacy file: lines of text, and lists of numbers of a type between them."""

    extension = ".vtk"

    def __init__(self, binary, version, parts):
        self.binary, self.version, self.parts = binary, version, parts

    def serialise(self):
        result = bytearray(f"# vtk DataFile Version {self.version}\nmesh\n{'BINARY' if self.binary else 'ASCII'}\n".encode())
        for part in self.parts:
            if isinstance(part, list):
                result += " ".join(map(str, part)).encode() + b"\n"
            elif self.binary:
                result += packed(LEGACY_PACK[part[0]], part[1], ">") + b"\n"
            else:
                result += text_of(part[1]).encode() + b"\n"
        return bytes(result)


# The undamaged files.

STYLES = {
    "ascii": {"format": "ascii", "raw": False, "compressor": "", "header_type": "UInt32"},
    "base64": {"format": "binary", "raw": False, "compressor": "", "header_type": "UInt32"},
    "base64-zlib": {"format": "binary", "raw": False, "compressor": "vtkZLibDataCompressor", "header_type": "UInt64"},
    "raw": {"format": "appended", "raw": True, "compressor": "", "header_type": "UInt64"},
    "raw-zlib": {"format": "appended", "raw": True, "compressor": "vtkZLibDataCompressor", "header_type": "UInt32"},
    "raw-lzma": {"format": "appended", "raw": True, "compressor": "vtkLZMADataCompressor", "header_type": "UInt64"},
    "appended-lz4": {"format": "appended", "raw": False, "compressor": "vtkLZ4DataCompressor", "header_type": "UInt32"},
    "raw-big-endian": {"format": "appended", "raw": True, "compressor": "", "header_type": "UInt32", "byte_order": "BigEndian"},
}
for style in STYLES.values():
    style.setdefault("byte_order", "LittleEndian")
    style["block_size"] = 100  # several blocks in arrays as small as these

CORNERS = [(x, y, z) for z in (0.0, 1.0) for y in (0.0, 1.0) for x in (0.0, 1.0)]
TETS = [(0, 1, 3, 7), (0, 3, 2, 7), (0, 2, 6, 7), (0, 6, 4, 7), (0, 4, 5, 7), (0, 5, 1, 7)]
HEX = (0, 1, 3, 2, 4, 5, 7, 6)
HEX_FACES = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
TET_FACES = [(0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2)]


def point_arrays(points):
    return [Array("f", "Float64", 1, [p[0] - 0.25 * p[2] for p in points]), Array("v", "Float32", 3, [c for p in points for c in (p[1], p[2], 1.0)])]


def unstructured(style, points, cells, ghosts=False):
    """cells: (VTK type, nodes, faces or None) each."""
    offsets, faces, places = [], [], []
    for _, nodes, cell_faces in cells:
        offsets.append((offsets[-1] if offsets else 0) + len(nodes))
        if cell_faces:
            faces += [len(cell_faces)] + [n for face in cell_faces for n in (len(face), *face)]
            places.append(len(faces))
        else:
            places.append(-1)
    topology = [
        Array("connectivity", "Int64", 1, [n for _, nodes, _ in cells for n in nodes]),
        Array("offsets", "Int64", 1, offsets),
        Array("types", "UInt8", 1, [t for t, _, _ in cells]),
    ]
    if faces:
        topology += [Array("faces", "Int64", 1, faces), Array("faceoffsets", "Int64", 1, places)]
    cell_data = [Array("material", "Int32", 1, range(len(cells)))]
    point_data = point_arrays(points)
    if ghosts:
        cell_data.append(Array("vtkGhostType", "UInt8", 1, [1 if i == 0 else 0 for i in range(len(cells))]))
        point_data.append(Array("vtkGhostType", "UInt8", 1, [0] * len(points)))
    sections = [Section("PointData", point_data, {"Scalars": "f"}), Section("CellData", cell_data),
                Section("Points", [Array("Points", "Float64", 3, [c for p in points for c in p])]), Section("Cells", topology)]  # fmt: skip
    return XmlFile("UnstructuredGrid", ".vtu", style, sections, piece={"NumberOfPoints": len(points), "NumberOfCells": len(cells)})


def tets(style, ghosts=False):
    return unstructured(style, CORNERS, [(10, nodes, None) for nodes in TETS], ghosts)


def mixed(style):
    """One cell of each linear kind, beside each other."""
    kinds = [(12, HEX), (11, range(8)), (13, (0, 2, 1, 4, 6, 5)), (14, (0, 1, 3, 2, 4)), (10, (0, 1, 2, 4)),
             (15, (0, 1, 3, 2, 6, 4, 5, 7, 6, 2)), (5, (0, 1, 2)), (1, (0,))]  # fmt: skip
    points, cells = [], []
    for i, (kind, nodes) in enumerate(kinds):
        cells.append((kind, [n + len(points) for n in nodes], None))
        points += [(x + 2 * i, y, z) for x, y, z in CORNERS]
    return unstructured(style, points, cells)


def polyhedra(style):
    points = CORNERS + [(2.0, 0.5, 0.5)]
    pyramid = [(1, 3, 7, 5), (1, 8, 3), (3, 8, 7), (7, 8, 5), (5, 8, 1)]
    return unstructured(style, points, [(42, range(8), HEX_FACES), (42, (1, 3, 7, 5, 8), pyramid), (10, (0, 1, 2, 4), None)])


def quadratic(style):
    corners = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)]
    middles = [tuple((a + b) / 2 for a, b in zip(corners[i], corners[j])) for i, j in ((0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3))]
    points = corners + middles
    return unstructured(style, points, [(24, range(10), None), (71, range(10), None)])


def structured(style, kind):
    """A StructuredGrid, ImageData or RectilinearGrid of 3 x 4 x 2 points."""
    axes = [[0.0, 0.5, 2.0], [0.0, 1.0, 1.5, 3.0], [0.0, 1.0]]
    points = [(x, y, z) for z in axes[2] for y in axes[1] for x in axes[0]]
    extent = "0 2 0 3 0 1"
    sections = [Section("PointData", point_arrays(points)), Section("CellData", [Array("material", "Int32", 1, range(6))])]
    grid = {"WholeExtent": extent}
    if kind == "StructuredGrid":
        sections.append(Section("Points", [Array("Points", "Float64", 3, [c for p in points for c in p])]))
    elif kind == "ImageData":
        grid.update({"Origin": "0 0 0", "Spacing": "0.5 1 2"})
    else:
        sections.append(Section("Coordinates", [Array(f"{axis}_coordinates", "Float64", 1, values) for axis, values in zip("xyz", axes)]))
    extension = {"StructuredGrid": ".vts", "ImageData": ".vti", "RectilinearGrid": ".vtr"}[kind]
    return XmlFile(kind, extension, style, sections, grid=grid, piece={"Extent": extent})


def legacy(binary, version, dataset):
    points = [c for p in CORNERS for c in p]
    cells = [(10, nodes) for nodes in TETS] + [(12, HEX)]
    data_cells, data_points = len(cells), 8
    if dataset == "UNSTRUCTURED_GRID":
        parts = [["DATASET", dataset], ["POINTS", 8, "double"], ("double", points)]
        if version == "5.1":
            offsets = [0]
            for _, nodes in cells:
                offsets.append(offsets[-1] + len(nodes))
            parts += [["CELLS", len(offsets), offsets[-1]], ["OFFSETS", "vtktypeint64"], ("vtktypeint64", offsets), ["CONNECTIVITY", "vtktypeint64"],
                      ("vtktypeint64", [n for _, nodes in cells for n in nodes])]  # fmt: skip
        else:
            listed = [n for _, nodes in cells for n in (len(nodes), *nodes)]
            parts += [["CELLS", len(cells), len(listed)], ("int", listed)]
        parts += [["CELL_TYPES", len(cells)], ("int", [t for t, _ in cells])]
    else:
        data_cells = 1
        parts = [["DATASET", dataset], ["DIMENSIONS", 2, 2, 2]]
        if dataset == "STRUCTURED_GRID":
            parts += [["POINTS", 8, "float"], ("float", points)]
        elif dataset == "STRUCTURED_POINTS":
            parts += [["ORIGIN", 0, 0, 0], ["SPACING", 1, 1, 1]]
        else:
            for axis in "XYZ":
                parts += [[f"{axis}_COORDINATES", 2, "double"], ("double", [0.0, 1.0])]
    parts += [["POINT_DATA", data_points], ["SCALARS", "f", "double", 1], ["LOOKUP_TABLE", "default"], ("double", [float(i) for i in range(8)]),
              ["VECTORS", "v", "float"], ("float", [0.5] * 24), ["CELL_DATA", data_cells], ["FIELD", "FieldData", 1],
              ["material", 1, data_cells, "int"], ("int", range(data_cells))]  # fmt: skip
    return LegacyFile(binary, version, [list(p) if isinstance(p, list) else (p[0], list(p[1])) for p in parts])


def sound_files():
    """Name -> a function that makes the undamaged file."""
    files = {}
    for style_name, style in STYLES.items():
        files[f"tets-{style_name}"] = lambda style=style: tets(style, ghosts=style is STYLES["raw"])
    for style_name in ("ascii", "base64-zlib", "raw"):
        style = STYLES[style_name]
        files[f"mixed-{style_name}"] = lambda style=style: mixed(style)
        files[f"polyhedra-{style_name}"] = lambda style=style: polyhedra(style)
        files[f"structured-{style_name}"] = lambda style=style: structured(style, "StructuredGrid")
    files["quadratic-ascii"] = lambda: quadratic(STYLES["ascii"])
    files["image-base64"] = lambda: structured(STYLES["base64"], "ImageData")
    files["rectilinear-raw-zlib"] = lambda: structured(STYLES["raw-zlib"], "RectilinearGrid")
    for dataset in ("UNSTRUCTURED_GRID", "STRUCTURED_GRID", "RECTILINEAR_GRID", "STRUCTURED_POINTS"):
        for binary in (False, True):
            name = f"legacy-{dataset.lower().replace('_', '-')}-{'binary' if binary else 'ascii'}"
            files[name] = lambda binary=binary, dataset=dataset: legacy(binary, "3.0", dataset)
    files["legacy-5.1-ascii"] = lambda: legacy(False, "5.1", "UNSTRUCTURED_GRID")
    files["legacy-5.1-binary"] = lambda: legacy(True, "5.1", "UNSTRUCTURED_GRID")
    return files


# Damage to the mesh, the markup and the encoding of an XML file.


def some_array(file, rng):
    arrays = file.arrays()
    return rng.choice(arrays) if arrays else Array("none", "Float64", 1, [])


def damage_counts(file, rng):
    if not file.piece:
        return
    key = rng.choice(list(file.piece))
    if key == "Extent":
        damage_extent(file, rng)
    else:
        before = str(file.piece[key])
        number = int(before) if before.lstrip("-").isdecimal() else 0  # it may have been damaged already
        file.piece[key] = near(rng, number) if rng.random() < 0.9 else rng.choice(["", "six", "1e3", "0x10", " 8 ", "8.5", "nan"])


def damage_extent(file, rng):
    attributes = rng.choice([file.grid, file.piece])
    for key in ("WholeExtent", "Extent"):
        if key in attributes:
            numbers = str(attributes[key]).split()
            for _ in range(rng.randrange(1, 4)):
                if numbers:
                    numbers[rng.randrange(len(numbers))] = str(rng.choice(NUMBERS))
            if rng.random() < 0.2:
                numbers = numbers[: rng.randrange(len(numbers) + 1)]
            attributes[key] = " ".join(numbers)
            if rng.random() < 0.4:  # the piece and the whole agree on what is wrong
                for other, name in ((file.grid, "WholeExtent"), (file.piece, "Extent")):
                    if name in other:
                        other[name] = attributes[key]


def damage_geometry(file, rng):
    for key in ("Origin", "Spacing"):
        if key in file.grid:
            file.grid[key] = " ".join(str(rng.choice(REALS)) for _ in range(rng.choice([3, 3, 3, 2, 4])))


def damage_attribute(file, rng):
    array = some_array(file, rng)
    attributes = array.attributes
    kind = rng.randrange(6)
    if kind == 0:
        attributes["type"] = rng.choice([*PACK, "String", "Bit", "Float16", ""])
    elif kind == 1:
        attributes["NumberOfComponents"] = near(rng, int(attributes.get("NumberOfComponents", 1)))
    elif kind == 2:
        attributes["Name"] = rng.choice(["", "f", "v", "Points", "connectivity", "offsets", "types", "faces", "vtkGhostType", "vtkGhostLevels", "a" * 5000,
                                         "line&#10;break", "tab&#9;", "&lt;&gt;&amp;", "&#127;[31m", "coverage", "\u00e9", "f=g", "a,b", "f_cell"])  # fmt: skip
    elif kind == 3:
        attributes["format"] = rng.choice(["ascii", "binary", "appended", "other", ""])
    elif kind == 4:
        attributes["NumberOfTuples"] = rng.choice(NUMBERS)
    elif attributes:
        del attributes[rng.choice(list(attributes))]


def damage_type(file, rng):
    """Another type, attribute and bytes alike: sound markup that a reader may not expect."""
    array = some_array(file, rng)
    array.attributes["type"] = array.stored_type = rng.choice(list(PACK))


def damage_offset(file, rng):
    array = some_array(file, rng)
    array.offset = rng.choice(NUMBERS + [rng.randrange(3000) for _ in range(10)])


def damage_root(file, rng):
    key = rng.choice(["header_type", "compressor", "byte_order", "version", "type"])
    file.root[key] = rng.choice({
        "header_type": ["UInt32", "UInt64", "UInt16", "Float64", ""], "compressor": COMPRESSORS, "byte_order": ["BigEndian", "LittleEndian", ""],
        "version": ["0.1", "1.0", "2.0", "2.1", "99.0", "-1", ""],
        "type": ["UnstructuredGrid", "StructuredGrid", "ImageData", "RectilinearGrid", "PolyData", "PUnstructuredGrid", "vtkMultiBlockDataSet", "Table", ""],
    }[key])  # fmt: skip


def damage_header(file, rng):
    array = some_array(file, rng)
    position, number, extra = rng.random(), rng.choice(NUMBERS), rng.random()

    def change(header):
        at = int(position * len(header))
        header[at] = number if extra < 0.5 else header[at] + int(extra * 40) - 30
        if extra > 0.9:
            header.append(number)

    array.damage_header = change


def damage_block_size(file, rng):
    file.style["block_size"] = rng.choice([1, 7, 8, 99, 1 << 15, 1 << 20])


def damage_payload(file, rng):
    array = some_array(file, rng)
    seed = rng.getrandbits(32)

    def change(data):
        return damage_bytes(data, random.Random(seed))

    array.damage_payload = change


def change_values(array, rng, numbers):
    for _ in range(rng.choice([1, 1, 1, 2, 5])):
        if array.values:
            array.values[rng.randrange(len(array.values))] = rng.choice(numbers)


def change_length(array, rng):
    kind = rng.randrange(4)
    if kind == 0:
        del array.values[rng.randrange(len(array.values) + 1) :]
    elif kind == 1:
        array.values += [rng.choice(array.values or [0]) for _ in range(rng.choice([1, 3, 50, 1000]))]
    elif kind == 2 and array.values:
        del array.values[rng.randrange(len(array.values))]
    elif array.values:
        at = rng.randrange(len(array.values))
        array.values.insert(at, array.values[at])


def damage_topology(file, rng):
    array = file.array(rng.choice(["connectivity", "connectivity", "offsets", "types"]))
    if not array:
        return
    if rng.random() < 0.25:
        change_length(array, rng)
    elif array.attributes["Name"] == "types":
        change_values(array, rng, CELL_TYPES)
    elif array.attributes["Name"] == "offsets" and rng.random() < 0.3:
        rng.shuffle(array.values)
    else:
        highest = max(array.values, default=0)
        change_values(array, rng, NUMBERS + list(range(-1, min(highest, 1000) + 3)))


def damage_all_types(file, rng):
    array = file.array("types")
    if array:
        array.values = [rng.choice(CELL_TYPES)] * len(array.values)


def damage_faces(file, rng):
    array = file.array(rng.choice(["faces", "faceoffsets"]))
    if not array:
        return damage_topology(file, rng)
    if rng.random() < 0.25:
        change_length(array, rng)
    else:
        change_values(array, rng, NUMBERS + list(range(-2, 30)))


def damage_coordinates(file, rng):
    arrays = [a for a in (file.array(n) for n in ("Points", "x_coordinates", "y_coordinates", "z_coordinates")) if a]
    if not arrays:
        return damage_geometry(file, rng)
    array = rng.choice(arrays)
    if rng.random() < 0.3:  # all of it: a mesh of another size, or far away
        factor, shift = rng.choice(REALS), rng.choice([0.0, 0.0, 1e6, 1e12, 1e300])
        array.values = [float(v) * factor + shift for v in array.values]
    else:
        change_values(array, rng, REALS)


def damage_field(file, rng):
    array = file.array(rng.choice(["f", "v", "material", "vtkGhostType"]))
    if not array:
        return
    kind = rng.randrange(4)
    if kind == 0:
        change_length(array, rng)
    elif kind == 1:
        array.values = [rng.choice(REALS)] * len(array.values)
    else:
        change_values(array, rng, REALS if array.stored_type.startswith("Float") else NUMBERS)


def add_array(file, rng):
    sections = [s for s in file.sections if s.tag in ("PointData", "CellData")]
    if not sections:
        return
    section = rng.choice(sections)
    items = len(section.arrays[0].values) if section.arrays else 8
    name, type_name = rng.choice(["f", "extra", "vtkGhostType", "vtkGhostLevels", "vtkOriginalCellIds", ""]), rng.choice(list(PACK))
    components = rng.choice([1, 2, 6, 9, 10, 100, 0, 4])
    numbers = REALS if type_name.startswith("Float") else [0, 1, 2, 8, 32, 255]
    section.arrays.append(Array(name, type_name, components, [rng.choice(numbers) for _ in range(items * min(components, 12))]))


def damage_order(file, rng):
    """Elements that are missing, double, or in another order."""
    lists = [file.sections] + [s.arrays for s in file.sections]
    chosen = rng.choice([items for items in lists if items] or [[]])
    if not chosen:
        return
    kind = rng.randrange(3)
    if kind == 0:
        del chosen[rng.randrange(len(chosen))]
    elif kind == 1:
        chosen.insert(rng.randrange(len(chosen) + 1), copy.deepcopy(rng.choice(chosen)))
    else:
        rng.shuffle(chosen)


def damage_pieces(file, rng):
    file.pieces = rng.choice([0, 2, 3])


def damage_section_name(file, rng):
    if file.sections:
        section = rng.choice(file.sections)
        section.tag = rng.choice(["PointData", "CellData", "Points", "Cells", "Coordinates", "Verts", "FieldData", "Piece", "AppendedData"])


XML_DAMAGE = [damage_counts, damage_counts, damage_attribute, damage_attribute, damage_type, damage_offset, damage_root, damage_header, damage_header,
              damage_block_size, damage_payload, damage_topology, damage_topology, damage_topology, damage_all_types, damage_faces, damage_faces,
              damage_coordinates, damage_coordinates, damage_field, add_array, damage_order, damage_pieces, damage_section_name, damage_extent]  # fmt: skip

# Damage to a legacy file.

KEYWORDS = ["DATASET", "POINTS", "CELLS", "CELL_TYPES", "POINT_DATA", "CELL_DATA", "SCALARS", "VECTORS", "NORMALS", "TENSORS", "TENSORS6", "FIELD",
            "LOOKUP_TABLE", "METADATA", "COLOR_SCALARS", "TEXTURE_COORDINATES", "GLOBAL_IDS", "PEDIGREE_IDS", "EDGE_FLAGS", "OFFSETS", "CONNECTIVITY",
            "UNSTRUCTURED_GRID", "STRUCTURED_GRID", "STRUCTURED_POINTS", "RECTILINEAR_GRID", "POLYDATA", "DIMENSIONS", "ORIGIN", "SPACING", "BLANKING",
            "X_COORDINATES", "VERTICES", "POLYGONS", "nonsense", ""]  # fmt: skip
LEGACY_TYPES = ["double", "float", "int", "long", "short", "char", "unsigned_char", "vtkIdType", "vtktypeint64", "bit", "string", "variant", "nonsense"]


def damage_legacy(file, rng):
    lines = [p for p in file.parts if isinstance(p, list) and p]
    lists = [p for p in file.parts if not isinstance(p, list)]
    kind = rng.randrange(6)
    if kind <= 1 and lines:  # a word of a line of text
        line = rng.choice(lines)
        at = rng.randrange(len(line))
        if isinstance(line[at], int):
            line[at] = near(rng, line[at])
        elif at > 0 and line[at] in LEGACY_TYPES:
            line[at] = rng.choice(LEGACY_TYPES)
        else:
            line[at] = rng.choice(KEYWORDS + [str(line[at]).lower(), str(line[at]) * 50, "%s%n"])
    elif kind == 2 and lists:
        _, values = rng.choice(lists)
        change_values_of(values, rng)
    elif kind == 3 and lists:
        _, values = rng.choice(lists)
        if values:
            del values[rng.randrange(len(values)) :]
        else:
            values += [1] * 20
    elif kind == 4 and file.parts:
        at = rng.randrange(len(file.parts))
        choice = rng.randrange(3)
        if choice == 0:
            del file.parts[at]
        elif choice == 1:
            file.parts.insert(at, copy.deepcopy(rng.choice(file.parts)))
        else:
            other = rng.randrange(len(file.parts))
            file.parts[at], file.parts[other] = file.parts[other], file.parts[at]
    else:
        choice = rng.randrange(3)
        if choice == 0:
            file.version = rng.choice(["1.0", "2.0", "3.0", "4.2", "5.0", "5.1", "6.0", "99", "-1", ""])
        elif choice == 1:
            file.binary = not file.binary
        elif lines:
            rng.choice(lines).append(rng.choice(NUMBERS))


def change_values_of(values, rng):
    if not values:
        return
    numbers = REALS if any(isinstance(v, float) for v in values) else NUMBERS + CELL_TYPES
    for _ in range(rng.choice([1, 1, 2, 6])):
        values[rng.randrange(len(values))] = rng.choice(numbers)


# Damage to finished bytes.


def damage_bytes(data, rng):
    data = bytearray(data)
    for _ in range(rng.choice([1, 1, 1, 2, 8])):
        size = len(data)
        if size == 0:
            break
        at, length = rng.randrange(size), rng.randrange(1, 40)
        kind = rng.randrange(8)
        if kind == 0:
            del data[at:]
        elif kind <= 2:
            data[at] ^= 1 << rng.randrange(8)
        elif kind == 3:
            data[at] = rng.choice([0, 0xFF, 0x7F, 0x80, ord("<"), ord('"'), ord(" "), ord("9")])
        elif kind == 4:
            data[at:at] = data[at : at + length]
        elif kind == 5:
            del data[at : at + length]
        elif kind == 6:
            data[at:at] = bytes(rng.getrandbits(8) for _ in range(length))
        else:
            number = replaceable_number(data, rng)
            if number:
                data[number.start() : number.end()] = str(rng.choice(NUMBERS)).encode()
    return bytes(data)


def replaceable_number(data, rng):
    """A decimal number in the text, looked for from a place on."""
    return re.compile(rb"-?\d+").search(data, rng.randrange(len(data)))


# Mutants.


def parallel_file(piece_name, rng):
    """A .pvtu that names a piece twice or more."""
    names = [piece_name] * rng.choice([1, 2, 3])
    if rng.random() < 0.3:
        names[rng.randrange(len(names))] = rng.choice(["missing.vtu", "", ".", "mesh.pvtu", "/dev/null", "../" * 40 + "etc/passwd", piece_name + "\x00"])
    level = rng.choice([0, 0, 1, -1, 10**9])
    arrays = '<PPointData><PDataArray type="Float64" Name="f"/></PPointData>'
    if rng.random() < 0.4:
        arrays = f'<PPointData><PDataArray type="{rng.choice(list(PACK))}" Name="f" NumberOfComponents="{rng.choice(NUMBERS)}"/></PPointData>'
    points = '<PPoints><PDataArray type="Float64" NumberOfComponents="3"/></PPoints>' if rng.random() < 0.9 else ""
    pieces = "".join(f'<Piece Source="{name}"/>' for name in names)
    return f"""<?xml version="1.0"?>
<VTKFile type="PUnstructuredGrid" version="0.1" byte_order="LittleEndian">
<PUnstructuredGrid GhostLevel="{level}">{arrays}{points}{pieces}</PUnstructuredGrid></VTKFile>
""".encode()


def make_mutant(seed, index):
    """Returns ({file name: bytes}, name of the mesh, what it was made of)."""
    rng = random.Random(f"{seed}:{index}")
    files = sound_files()
    origin = rng.choice(list(files))
    file = copy.deepcopy(files[origin]())
    steps = []
    finished = rng.random() < 0.25  # only the finished bytes are damaged
    if not finished:
        for _ in range(rng.choice([1, 1, 1, 2, 3])):
            damage = damage_legacy if isinstance(file, LegacyFile) else rng.choice(XML_DAMAGE)
            damage(file, rng)
            steps.append(damage.__name__)
    data = file.serialise()
    if finished or rng.random() < 0.1:
        data = damage_bytes(data, rng)
        steps.append("damage_bytes")
    name = "mesh" + file.extension
    result = {name: data}
    if file.extension == ".vtu" and rng.random() < 0.1:
        parallel = parallel_file(name, rng)
        steps.append("parallel_file")
        if rng.random() < 0.3:
            parallel = damage_bytes(parallel, rng)
            steps.append("damage_bytes")
        result["mesh.pvtu"] = parallel
        name = "mesh.pvtu"
    return result, name, f"{origin}: {', '.join(steps)}"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", default="1")
    parser.add_argument("--index", type=int, default=0)
    parser.add_argument("--sound", action="store_true")
    parser.add_argument("--output", type=pathlib.Path, required=True)
    arguments = parser.parse_args()
    arguments.output.mkdir(parents=True, exist_ok=True)
    if arguments.sound:
        for name, make in sound_files().items():
            file = make()
            (arguments.output / (name + file.extension)).write_bytes(file.serialise())
        return 0
    files, mesh, origin = make_mutant(arguments.seed, arguments.index)
    for name, data in files.items():
        (arguments.output / name).write_bytes(data)
    print(f"seed {arguments.seed} index {arguments.index}: {mesh} from {origin}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
