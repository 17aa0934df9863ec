#!/usr/bin/env python3
"""Files that try to reach one outside their folder: what is out there may appear nowhere, nothing may hang or crash, and reading ends with exit code 0 or 2.

usage: escape_test.py --tessera PROGRAM --box-writer PROGRAM --link-writer PROGRAM [--jobs J] [--keep FOLDER] [NAME...]

Each case is a folder beside the folder `outside`, which has marked files: their values are 1234.5 and their texts MARKED. Every case is read in the separate
process, in this one, where nothing but the code's own checks holds, and with --follow-links, which must show the mark for the cases that say so: those
reach outside unless they are kept from it.
"""

import argparse
import concurrent.futures
import dataclasses
import gzip
import json
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "fuzz"))
import mutate_files  # noqa: E402
import mutate_mesh  # noqa: E402
import pyopenvdb as vdb  # noqa: E402
from forked_tessera import ForkedTessera  # noqa: E402
from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridReader  # noqa: E402

MARKED = 1234.5
SIGNS = (b"1234.5", b"MARKED")
ASCII = mutate_mesh.STYLES["ascii"]


def marked_mesh(file, renames=True):
    for array in file.arrays():
        if array.attributes["Name"] == "f":
            array.values = [MARKED] * len(array.values)
        if renames and array.attributes["Name"] == "material":
            array.attributes["Name"] = "MARKED"
    return file.serialise()


SOUND_VTU, MARKED_VTU = mutate_mesh.tets(ASCII).serialise(), marked_mesh(mutate_mesh.tets(ASCII))
GRIDS = {kind: (mutate_mesh.structured(ASCII, kind).serialise(), marked_mesh(mutate_mesh.structured(ASCII, kind), renames=False))
         for kind in ("StructuredGrid", "RectilinearGrid", "ImageData")}  # fmt: skip


def parallel(*names, head=b'<?xml version="1.0"?>\n', inside=b"", piece=None):
    """A .pvtu; `piece` is its text of pieces in place of one for each name."""
    text = piece if piece is not None else b"".join(b'<Piece Source="' + name + b'"/>\n' for name in names)
    return (head + b'<VTKFile type="PUnstructuredGrid" version="0.1" byte_order="LittleEndian">\n<PUnstructuredGrid GhostLevel="0">\n' + inside
            + b'<PPointData><PDataArray type="Float64" Name="f"/></PPointData>\n<PPoints><PDataArray type="Float64" NumberOfComponents="3"/></PPoints>\n'
            + text + b"</PUnstructuredGrid>\n</VTKFile>\n")  # fmt: skip


def multiblock(*names, entry=b"<DataSet index='0' file='%s'/>"):
    return (b'<?xml version="1.0"?>\n<VTKFile type="vtkMultiBlockDataSet" version="1.0" byte_order="LittleEndian">\n<vtkMultiBlockDataSet>\n'
            + b"".join(entry % name for name in names) + b"\n</vtkMultiBlockDataSet>\n</VTKFile>\n")  # fmt: skip


def series(*names):
    entries = b"".join(b'<DataSet timestep="%d" file="%s"/>\n' % (i, name) for i, name in enumerate(names))
    return b'<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1">\n<Collection>\n' + entries + b"</Collection>\n</VTKFile>\n"


class Place:
    """A case's folder while it is filled."""

    def __init__(self, folder, outside, boxes):
        self.folder, self.outside, self.boxes = folder, outside, boxes
        self.absolute = str(outside).encode()

    def write(self, name, data):
        path = pathlib.Path(os.fsdecode(os.fsencode(self.folder) + b"/" + (name if isinstance(name, bytes) else name.encode())))
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)

    def link(self, name, target):
        path = os.fsencode(self.folder) + b"/" + (name if isinstance(name, bytes) else name.encode())
        os.makedirs(os.path.dirname(path), exist_ok=True)
        if os.path.isdir(path) and not os.path.islink(path):
            shutil.rmtree(path)
        elif os.path.lexists(path):
            os.unlink(path)
        os.symlink(os.fsencode(target), path)

    def box(self, kind, case, skip=()):
        for name, data in self.boxes[kind][case].items():
            if name not in skip:
                self.write(name, data)


@dataclasses.dataclass
class Case:
    name: str
    build: object  # fills a Place and returns the name of the file that is read
    reaches: bool  # with --follow-links the mark appears
    command: tuple = ()  # in place of info


CASES = []


def case(name, reaches=True, command=()):
    def add(build):
        CASES.append(Case(name, build, reaches, command))
        return build

    return add


def simple(name, build, reaches=True):
    CASES.append(Case(name, build, reaches))


# Parallel VTK XML.


def pvtu(name, source, reaches=True, prepare=None, **options):
    def build(place):
        place.write("own.vtu", SOUND_VTU)
        if prepare:
            prepare(place)
        text = source(place) if callable(source) else source
        place.write("mesh.pvtu", parallel(*(text if isinstance(text, list) else [text]), **options))
        return "mesh.pvtu"

    simple("pvtu " + name, build, reaches)


def link_file(name):
    return lambda place: place.link(name, place.outside / "marked.vtu")


OUT = b"../../outside/marked.vtu"
pvtu("absolute", lambda place: place.absolute + b"/marked.vtu")
pvtu("above", OUT)
pvtu("second piece", [b"own.vtu", OUT])
pvtu("dots", b"./.././../cases/../outside/./marked.vtu")
pvtu("slashes", lambda place: b"/" + place.absolute.replace(b"/", b"//") + b"//marked.vtu")
pvtu("through own folder", b"sub/../../../outside/marked.vtu", prepare=lambda place: place.write("sub/own.vtu", SOUND_VTU))
pvtu("link", b"link.vtu", prepare=link_file("link.vtu"))
pvtu("link of link", b"one.vtu", prepare=lambda place: (place.link("one.vtu", "two.vtu"), link_file("two.vtu")(place)))
pvtu("link of folder", b"sub/marked.vtu", prepare=lambda place: place.link("sub", place.outside))
pvtu("above a link of folder", b"sub/../marked.vtu", prepare=lambda place: (place.link("sub", place.outside / "deep"), place.write("marked.vtu", SOUND_VTU)))
pvtu("link with a blank", b"own.vtu ", prepare=link_file("own.vtu "))
pvtu("characters by number", b"&#46;&#x2e;/&#46;.&#x2F;outside/marked.vtu")
pvtu("characters by long number", b"&#0000000000000046;./../outside/marked.vtu")
pvtu("percent", b"%2e%2e/%2e%2e/outside/marked.vtu", reaches=False)
pvtu("url", lambda place: b"file://" + place.absolute + b"/marked.vtu", reaches=False)
pvtu("apostrophes", b"", piece=b"<Piece Source = '" + OUT + b"' />")
pvtu("tab", reaches=False, source=b"own\tpiece.vtu", prepare=lambda place: (place.write("own\tpiece.vtu", SOUND_VTU), link_file("own piece.vtu")(place)))
pvtu("end of line", reaches=False, source=b"own\npiece.vtu", prepare=lambda place: (place.write("own\npiece.vtu", SOUND_VTU), link_file("own piece.vtu")(place)))
pvtu("encoding", reaches=False, source=b"\xe9.vtu", head=b'<?xml version="1.0" encoding="ISO-8859-1"?>\n',
     prepare=lambda place: (place.write(b"\xe9.vtu", SOUND_VTU), link_file(b"\xc3\xa9.vtu")(place)))  # fmt: skip
pvtu("attribute in attribute", b"", piece=b"<Piece Name=\" Source='own.vtu' \" Source=\"" + OUT + b'"/>')
pvtu("attribute twice", b"", piece=b'<Piece Source="own.vtu" Source="' + OUT + b'"/>', reaches=False)
pvtu("character data", b"", piece=b'<![CDATA[ > <!-- ]]><Piece Source="' + OUT + b'"/><!-- -->')
pvtu("instruction", b"", piece=b'<?x > <!-- ?><Piece Source="' + OUT + b'"/><!-- -->')
pvtu("comment with data", b"", piece=b'<!-- <AppendedData --><Piece Source="' + OUT + b'"/>', reaches=False)
pvtu("entity", reaches=False, source=b"&x;", head=b'<?xml version="1.0"?>\n<!DOCTYPE VTKFile [<!ENTITY x "../../outside/marked.vtu"><!ENTITY y "><!-- ">]>\n<!-- -->\n',
     prepare=lambda place: place.write("&x;", SOUND_VTU))  # fmt: skip
pvtu("outside definition", b"own.vtu", head=b'<?xml version="1.0"?>\n<!DOCTYPE VTKFile SYSTEM "../../outside/text">\n', reaches=False)
pvtu("drive", b"x:piece.vtu", prepare=lambda place: place.write("x:piece.vtu", SOUND_VTU), reaches=False)
pvtu("text", lambda place: place.absolute + b"/text", reaches=False)
pvtu("device", b"/dev/zero", reaches=False)
pvtu("own process", b"/proc/self/environ", reaches=False)


@case("pvtu names pvtu that names outside", reaches=False)
def _(place):
    place.write("inner.pvtu", parallel(OUT))
    place.write("mesh.pvtu", parallel(b"inner.pvtu"))
    return "mesh.pvtu"


@case("vtu entity", reaches=False)
def _(place):
    text = SOUND_VTU.replace(b'<?xml version="1.0"?>\n', b'<?xml version="1.0"?>\n<!DOCTYPE VTKFile [<!ENTITY x SYSTEM "file://' + place.absolute + b'/numbers">]>\n')
    place.write("mesh.vtu", re.sub(rb'(Name="f"[^>]*>)[^<]*', rb"\1&x;", text))
    return "mesh.vtu"


@case("vtu entity behind a comment", reaches=False)
def _(place):
    head = b'<?xml version="1.0"?>\n<!DOCTYPE VTKFile [<!ENTITY x SYSTEM "file://' + place.absolute + b'/numbers"><!ENTITY y "><!-- ">]>\n<!-- -->\n'
    place.write("mesh.vtu", re.sub(rb'(Name="f"[^>]*>)[^<]*', rb"\1&x;", SOUND_VTU.replace(b'<?xml version="1.0"?>\n', head)))
    return "mesh.vtu"


def grid(kind, how):
    def build(place):
        suffix = {"StructuredGrid": "vts", "RectilinearGrid": "vtr", "ImageData": "vti"}[kind]
        name = {"absolute": place.absolute + b"/marked." + suffix.encode(), "above": b"../../outside/marked." + suffix.encode(), "link": b"piece"}[how]
        if how == "link":
            place.link("piece", place.outside / f"marked.{suffix}")
        pieces = f'<Piece Extent="0 2 0 3 0 1" Source="{name.decode()}"/>'
        place.write("mesh.p" + suffix, mutate_files.parallel_text("P" + kind, "0 2 0 3 0 1", pieces))
        return "mesh.p" + suffix

    simple(f"p{kind} {how}", build)


grid("StructuredGrid", "absolute")
grid("StructuredGrid", "link")
grid("RectilinearGrid", "above")
grid("ImageData", "link")


# Multi-block files and series.


def vtm(name, source, reaches=True, prepare=None, extension=".vtm", **options):
    def build(place):
        place.write("own.vtu", SOUND_VTU)
        if prepare:
            prepare(place)
        place.write("mesh" + extension, multiblock(*(source(place) if callable(source) else [b"own.vtu", source]), **options))
        return "mesh" + extension

    simple("vtm " + name, build, reaches)


vtm("absolute", lambda place: [place.absolute + b"/marked.vtu"])
vtm("above", OUT, extension=".vtmb")
vtm("link", b"link.vtu", prepare=link_file("link.vtu"))
vtm("block", OUT, entry=b"<Block index='0'><Block index='0'><DataSet index='0' file='%s'/></Block></Block>")
vtm("pieces", OUT, entry=b"<Piece index='0'><DataSet index='0' file='%s'/></Piece>")
vtm("drive", b"x:piece.vtu", prepare=lambda place: place.write("x:piece.vtu", SOUND_VTU), reaches=False)
vtm("attribute in attribute", b"", reaches=True, entry=b"<DataSet index='0' name=' file=\"own.vtu\" ' file='" + OUT + b"'/>%.0s")
vtm("pvtu that names outside", b"inner.pvtu", prepare=lambda place: place.write("inner.pvtu", parallel(OUT)), reaches=False)
vtm("vtm that names outside", b"inner.vtm", prepare=lambda place: place.write("inner.vtm", multiblock(OUT)), reaches=False)


def pvd(name, source, reaches=True, prepare=None):
    def build(place):
        place.write("own.vtu", SOUND_VTU)
        if prepare:
            prepare(place)
        place.write("run.pvd", series(b"own.vtu", source(place) if callable(source) else source))
        return "run.pvd"

    simple("pvd " + name, build, reaches)


pvd("absolute", lambda place: place.absolute + b"/marked.vtu")
pvd("above", OUT)
pvd("link", b"link.vtu", prepare=link_file("link.vtu"))
pvd("link of folder", b"sub/marked.vtu", prepare=lambda place: place.link("sub", place.outside))
pvd("pvtu that names outside", b"inner.pvtu", prepare=lambda place: place.write("inner.pvtu", parallel(OUT)))
pvd("pvtu of a folder that names its own", lambda place: place.absolute + b"/own.pvtu")
pvd("case that names outside", b"box.case", prepare=lambda place: ensight_files(place, model=b"../../outside/ensight/box.geo", temp=b"../../outside/ensight/box.0001.temp"))
pvd("foam outside", lambda place: place.absolute + b"/foam/box.foam")


@case("pvsm", reaches=False)
def _(place):
    place.write("state.pvsm", b'<ParaView><ServerManagerState><Property name="FileName"><Element index="0" value="' + place.absolute + b'/marked.vtu"/>')
    return "state.pvsm"


# TetGen: the other file.


@case("tetgen nodes by link")
def _(place):
    place.write("mesh.ele", mutate_files.tetgen_sets()["from-0"]["mesh.ele"])
    place.link("mesh.node", place.outside / "marked.node")
    return "mesh.ele"


@case("tetgen elements by link")  # a message quotes them
def _(place):
    place.write("mesh.node", mutate_files.tetgen_sets()["from-0"]["mesh.node"])
    place.link("mesh.ele", place.outside / "text")
    return "mesh.node"


# EnSight.


def ensight_files(place, model=b"box.geo", temp=b"box.0000.temp", extra=b"", version="gold-text", kind=b"ensight gold", more=b""):
    place.box("ensight", version, skip=("box.case",))
    place.write("box.case", b"FORMAT\ntype: " + kind + b"\n\nGEOMETRY\nmodel: " + model + b"\n" + extra + b"\nVARIABLE\nscalar per node: temp " + temp + b"\n" + more)
    return "box.case"


TIMES = b"\nTIME\ntime set: 1\nnumber of steps: 1\nfilename start number: %d\nfilename increment: 1\ntime values: 0.0\n"


def ensight(name, reaches=True, prepare=None, **options):
    def build(place):
        if prepare:
            prepare(place)
        return ensight_files(place, **{key: value(place) if callable(value) else value for key, value in options.items()})

    simple("ensight " + name, build, reaches)


OUT_TEMP, OUT_GEO = b"../../outside/ensight/box.0001.temp", b"../../outside/ensight/box.geo"


def link_temp(name):
    return lambda place: place.link(name, place.outside / "ensight" / "box.0001.temp")


ensight("absolute", temp=lambda place: place.absolute + b"/ensight/box.0001.temp", reaches=False)
ensight("slash before a link", temp=b"/link.temp", prepare=link_temp("link.temp"))
ensight("own process", temp=b"../" * 20 + b"proc/self/environ", reaches=False)
ensight("above", temp=OUT_TEMP)
ensight("model above", model=OUT_GEO)
ensight("model of binary", model=b"../../outside/ensight-binary/box.geo", temp=b"../../outside/ensight-binary/box.0001.temp", version="gold-binary")
ensight("six", model=b"../../outside/ensight-six/box.geo", kind=b"ensight", version="six-text")
ensight("words behind", temp=OUT_TEMP + b" freeze")
ensight("model with words behind", model=OUT_GEO + b" change_coords_only")
ensight("own name behind", temp=OUT_TEMP + b" box.0000.temp")
ensight("tabs", temp=b"\t" + OUT_TEMP + b"\t ")
ensight("quotes", temp=b'"' + OUT_TEMP + b'"', reaches=False)
ensight("link", temp=b"link.temp", prepare=link_temp("link.temp"))
ensight("link of folder", temp=b"sub/box.0001.temp", prepare=lambda place: place.link("sub", place.outside / "ensight"))
ensight("zero byte", reaches=False, temp=b"link.temp\0other", prepare=link_temp("link.temp"))
ensight("pattern", temp=b"link.*.temp", prepare=link_temp("link.7.temp"), more=TIMES % 7)
ensight("pattern of more digits", temp=b"link.*.temp", prepare=link_temp("link.12.temp"), more=TIMES % 12)
ensight("pattern and zero byte", reaches=False, temp=b"link.*.temp\0other", prepare=link_temp("link.7.temp"), more=TIMES % 7)
ensight("pattern of folders", temp=b"sub*/box.0001.temp", prepare=lambda place: place.link("sub7", place.outside / "ensight"), more=TIMES % 7)
ensight("pattern outside", temp=b"../../outside/ensight/box.****.temp", more=TIMES % 1)
ensight("pattern of folders outside", temp=b"../../out*/box.0001.temp", more=TIMES % 7, reaches=False)
ensight("long line", temp=b"./" * 120 + b"link.temp", prepare=link_temp("link.temp"), reaches=False)
ensight("cut line", temp=(b"./" * 115)[: 255 - len(b"scalar per node: temp ") - len(b"link.temp")] + b"link.tempX", prepare=link_temp("link.temp"), reaches=False)
ensight("device", temp=b"/dev/zero", reaches=False)
ensight("text", temp=b"../../outside/text", reaches=False)
ensight("model is text", model=b"../../outside/text", reaches=False)


@case("ensight server", reaches=False)
def _(place):
    place.write("box.case", b"FORMAT\ntype: master_server gold\n\nSERVERS\nnumber of servers: 1\n\n#Server 1\nmachine id: here\nexecutable: ensight\ndata_path: "
                + place.absolute + b"/ensight\ncasefile: box.case\n")  # fmt: skip
    return "box.case"


# OpenFOAM.


def foam(name, change, reaches=True, variant="text"):
    def build(place):
        place.box("openfoam", variant)
        change(place)
        return "box.foam"

    simple("foam " + name, build, reaches)


def include(directive, where="1/p", old=b"nonuniform List<scalar>\n3\n(\n20\n40\n80\n)\n"):
    """In place of the values of a field."""

    def change(place):
        path = place.folder / where
        data = path.read_bytes()
        text = directive(place) if callable(directive) else directive
        assert old in data, data
        path.write_bytes(data.replace(old, text))

    return change


def foam_link(name, target):
    return lambda place: place.link(name, place.outside / "foam" / target)


foam("include above", include(b'#include "../../../outside/foam/values"\n'))
foam("include absolute", include(lambda place: b'#include "' + place.absolute + b'/foam/values"\n'))
foam("include of a link", lambda place: (foam_link("1/values", "values")(place), include(b'#include "values"\n')(place)))
foam("include in own folder", lambda place: (place.write("1/values", b'#include "../../../outside/foam/values"\n'), include(b'#include "values"\n')(place)))
foam("include of home", include(b'#include "~/foam/values"\n'))
foam("include of environment", include(b'#include "$OUTSIDE/foam/values"\n'))
foam("include if present", include(b'#includeIfPresent "../../../outside/foam/values"\n'))
foam("include with blanks", include(b'# include\n"../../../outside/foam/values"\n'), reaches=False)
foam("include behind a remark", include(b'#include /* "values" */ "../../../outside/foam/values"\n'), reaches=False)
foam("include without quotes", include(b"#include ../../../outside/foam/values\n"), reaches=False)
foam("silent include", include(b'#sinclude "../../../outside/foam/values"\n'), reaches=False)
foam("include of etc", include(b'#includeEtc "../../../outside/foam/values"\n'), reaches=False)
foam("calc", include(b'uniform #calc "system(\\"cat ../../outside/text\\")";\n'), reaches=False)
foam("code stream", include(b'#codeStream { code #{ system("cat ../../outside/text > /tmp/x"); #}; };\n'), reaches=False)
foam("include in the dictionary", lambda place: place.write("system/controlDict", b'FoamFile { version 2.0; format ascii; class dictionary; object controlDict; }\n'
     b'#include "../../../outside/foam/system/controlDict"\n'), reaches=False)  # fmt: skip
foam("include in points", include(b'#include "../../../../outside/foam/constant/polyMesh/points"\n', "constant/polyMesh/owner", b"14\n(\n"), reaches=False)
foam("field by link", foam_link("1/p", "1/p"))
foam("field by packed link", lambda place: (os.unlink(place.folder / "1/p"), foam_link("1/p.gz", "p.gz")(place)))
foam("points by link", foam_link("constant/polyMesh/points", "constant/polyMesh/points"))
foam("time by link", foam_link("1", "1"))
foam("later time by link", foam_link("2", "1"))
foam("mesh by link", foam_link("constant/polyMesh", "constant/polyMesh"))
foam("constant by link", foam_link("constant", "constant"))
foam("region by link", lambda place: (foam_link("constant/solid", "constant")(place), foam_link("1/solid", "1")(place)), variant="regions")
foam("dictionary by link", foam_link("system/controlDict", "system/controlDict"), reaches=False)
foam("parts by link", foam_link("processor0", "."), reaches=False)
foam("uniform by link", foam_link("1/uniform", "1"), reaches=False)
foam("lagrangian by link", foam_link("1/lagrangian", "1"), reaches=False)
foam("field is text", lambda place: place.link("1/p", place.outside / "text"), reaches=False)
foam("points are a device", lambda place: place.link("constant/polyMesh/points", "/dev/zero"), reaches=False)
foam("field is a pipe", lambda place: (os.unlink(place.folder / "1/p"), os.mkfifo(place.folder / "1/p")), reaches=False)
foam("folder in itself", lambda place: place.link("constant/again", place.folder), reaches=False)


# Scenes.


def scene(name, mesh, reaches=True, prepare=None):
    def build(place):
        place.write("own.vtu", SOUND_VTU)
        if prepare:
            prepare(place)
        text = mesh(place) if callable(mesh) else mesh
        place.write("scene.json", json.dumps({"version": 1, "field": "f", "size": [32, 24], "effects": {"outline": {"mesh": text}}}).encode())
        return "own.vtu"

    CASES.append(Case("scene " + name, build, reaches, ("render", "{mesh}", "--scene", "{folder}/scene.json", "-o", "out.png")))


# Pictures can't be searched for marks: what is outside has no 3D cells, and a message says so.
FLAT = "marked_flat.vtu"
scene("absolute", lambda place: str(place.outside / FLAT))
scene("above", "../../outside/" + FLAT)
scene("link", "link.vtu", prepare=lambda place: place.link("link.vtu", place.outside / FLAT))
scene("pvtu that names outside", "inner.pvtu", prepare=lambda place: place.write("inner.pvtu", parallel(b"../../outside/marked_flat.vtu")), reaches=False)


def fill_outside(outside, boxes):
    (outside / "deep").mkdir(parents=True)
    (outside / "marked.vtu").write_bytes(MARKED_VTU)
    (outside / "own.pvtu").write_bytes(parallel(b"marked.vtu"))
    flat = mutate_mesh.unstructured(ASCII, mutate_mesh.CORNERS, [(5, (0, 1, 2), None)])
    (outside / FLAT).write_bytes(flat.serialise())
    for kind, extension in (("StructuredGrid", "vts"), ("RectilinearGrid", "vtr"), ("ImageData", "vti")):
        (outside / f"marked.{extension}").write_bytes(GRIDS[kind][1])
    (outside / "text").write_bytes(b"MARKED MARKED MARKED\n" * 20)
    (outside / "numbers").write_bytes(b"1234.5 " * 8)
    (outside / "marked.node").write_bytes(re.sub(rb"(?m)^(\d+ \S+ \S+ \S+) \S+", rb"\1 1234.5", mutate_files.tetgen_sets()["from-0"]["mesh.node"]))
    for name, case_name in (("ensight", "gold-text"), ("ensight-six", "six-text"), ("ensight-binary", "gold-binary"), ("foam", "text")):
        for file_name, data in boxes["openfoam" if name == "foam" else "ensight"][case_name].items():
            path = outside / name / file_name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(marked_box(file_name, data))
    values = b"nonuniform List<scalar>\n3\n(\n1234.5\n1234.5\n1234.5\n)\n"
    (outside / "foam" / "values").write_bytes(values)
    (outside / "foam" / "p.gz").write_bytes(gzip.compress((outside / "foam/1/p").read_bytes()))


def marked_box(name, data):
    """With 1234.5 for one coordinate, and for each value."""
    if name.endswith((".temp", ".mat")):
        return re.sub(rb"(?m)^( *\S+e\S+)+$", lambda found: b" 1.23450e+03" * len(found.group().split()), data) if b"\0" not in data[80:] else data
    if name == "box.geo":
        return data.replace(b" 2.00000e+00", b" 1.23450e+03").replace(b"\0\0\x00\x40", b"\0\x50\x9a\x44")
    if name == "constant/polyMesh/points":
        return data.replace(b"(2 ", b"(1234.5 ")
    if name in ("0.5/p", "1/p"):
        return re.sub(rb"(?m)^\d0$", b"1234.5", data)
    return data


def shows_mark(case_, output, folder):
    if case_.command:
        return b"no 3D" in output
    return any(sign in output.replace(str(folder.parent).encode(), b"").replace(b"marked", b"") for sign in SIGNS)


def output_shows_mark(path):
    """Of what tets and resample wrote."""
    if path.suffix == ".vdb":
        values = (value for grid in vdb.readAllGridMetadata(str(path)) for value in grid_values(path, grid.name))
        return any(abs(value - MARKED) < 1 for value in values)
    reader = vtkXMLUnstructuredGridReader()
    reader.SetFileName(str(path))
    reader.Update()
    sets = [reader.GetOutput().GetPointData(), reader.GetOutput().GetCellData()]
    arrays = [data.GetArray(i) for data in sets for i in range(data.GetNumberOfArrays())] + [reader.GetOutput().GetPoints().GetData()]
    return any("MARKED" in array.GetName() or MARKED in array.GetRange(0) for array in arrays)


def grid_values(path, name):
    for item in vdb.read(str(path), name).citerOnValues():
        yield from item["value"] if isinstance(item["value"], tuple) else [item["value"]]


WRITING = {"tets": (["-o", "{output}", "--quiet"], "out.vtu"), "resample": (["-o", "{output}", "--quiet", "--refine", "uniform", "--resolution", "6"], "out.vdb")}


def run_case(case_, place_of, tessera):
    """Returns what is wrong with it."""
    folder, mesh = place_of(case_)
    wrong = []

    def check(words, way, reaches):
        label = " ".join([words[0], *way])
        done = tessera.run(words + way, cwd=folder.parent.parent / "run")
        output = (done.stdout + done.stderr).encode(errors="replace")
        if done.returncode not in (0, 2):
            wrong.append(f"{label}: exit code {done.returncode}: {output[-300:]!r}")
        shown = shows_mark(case_, output, folder)
        if "-o" in words and (path := pathlib.Path(words[words.index("-o") + 1])).suffix in (".vtu", ".vdb"):
            if path.exists():
                shown |= output_shows_mark(path)
                path.unlink()
        if shown != reaches:
            wrong.append(f"{label}: {'should' if reaches else 'should not'} show what is outside: {output[-300:]!r}")

    commands = [[word.format(mesh=mesh, folder=folder) for word in case_.command] or ["info", mesh]]
    if not case_.command and case_.reaches and not case_.name.startswith(("pvd", "tetgen elements")):
        by_place = any(word in case_.name for word in ("model", "points", "constant", "mesh"))
        name = "tets" if by_place else ("tets", "resample", "")[len(case_.name) % 3]
        if name:
            words, output = WRITING[name]
            commands.append([name, mesh, *(word.format(output=folder / output) for word in words)])
    for words in commands:
        check(words, [], False)
        check(words, ["--reader", "in-process"], False)
        if case_.reaches:
            check(words, ["--follow-links"], True)
    return wrong


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tessera", required=True)
    parser.add_argument("--box-writer", required=True)
    parser.add_argument("--link-writer", required=True)
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    parser.add_argument("--keep", type=pathlib.Path, help="where the files go, to look at")
    parser.add_argument("names", nargs="*", help="cases whose names begin so (default: all)")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="tessera-escape-") as temporary:
        root = (arguments.keep or pathlib.Path(temporary)).resolve()
        boxes = mutate_files.written_sets(arguments.box_writer)
        (root / "run").mkdir(parents=True)
        (root / "run" / "x:piece.vtu").write_bytes(MARKED_VTU)
        fill_outside(root / "outside", boxes)
        (root / "linked").mkdir()
        subprocess.run([arguments.link_writer, root / "outside", root / "linked"], check=True)
        for folder in sorted((root / "linked").iterdir()):
            mesh = next(folder.glob("box.*"))
            CASES.append(Case("library " + folder.name, mesh, True))

        def place_of(case_):
            if isinstance(case_.build, pathlib.Path):
                return case_.build.parent, str(case_.build)
            folder = root / "cases" / re.sub(r"\W", "_", case_.name)
            folder.mkdir(parents=True)
            return folder, str(folder / case_.build(Place(folder, root / "outside", boxes)))

        os.environ.update({"OUTSIDE": str(root / "outside"), "HOME": str(root / "outside"), "MARKED": "MARKED"})
        tessera = ForkedTessera(arguments.tessera)
        chosen = [case_ for case_ in CASES if not arguments.names or case_.name.startswith(tuple(arguments.names))]
        with concurrent.futures.ThreadPoolExecutor(arguments.jobs) as pool:
            found = list(pool.map(lambda case_: run_case(case_, place_of, tessera), chosen))
    bad = 0
    for case_, wrong in zip(chosen, found):
        bad += bool(wrong)
        for line in wrong:
            print(f"FAILED {case_.name}: {line}")
    print(f"{len(chosen)} files that try to reach another, {sum(case_.reaches for case_ in chosen)} of which do with --follow-links; {bad} are wrong")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
