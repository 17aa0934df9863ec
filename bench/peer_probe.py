#!/usr/bin/env python3
"""VTK's probe filter as a peer of `tessera bench`, and a pattern for peers of your own.

tessera bench mesh.vtu --peer "probe=/usr/bin/python3 bench/peer_probe.py" -o report/

Reads the mesh that it is started with, says its name, and then answers requests, a line of JSON each, until
its input ends: docs/benchmark_peers.md. Needs VTK's Python modules and NumPy (Debian: python3-vtk9).
"""

import json
import sys
import time

import numpy
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkSMPTools, vtkVersion
from vtkmodules.vtkCommonDataModel import vtkImageData, vtkUnstructuredGrid
from vtkmodules.vtkFiltersCore import vtkProbeFilter
from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridReader


def say(**line):
    print(json.dumps(line), flush=True)


def sample(mesh, request):
    """Writes the samples of all fields; returns the milliseconds that VTK took."""
    vtkSMPTools.Initialize(request["threads"])
    image = vtkImageData()
    image.SetOrigin(request["origin"])
    image.SetSpacing(request["spacing"])
    image.SetDimensions(request["points"])
    # A copy, so that nothing that VTK builds on the mesh is left over for the next request.
    fresh = vtkUnstructuredGrid()
    fresh.DeepCopy(mesh)
    probe = vtkProbeFilter()
    probe.SetInputData(image)
    probe.SetSourceData(fresh)
    start = time.perf_counter()
    probe.Update()
    milliseconds = (time.perf_counter() - start) * 1000

    results = probe.GetOutput().GetPointData()
    outside = vtk_to_numpy(results.GetArray(probe.GetValidPointMaskArrayName())) == 0
    with open(request["samples"], "wb") as file:
        for field in request["fields"]:
            array = results.GetArray(field["name"])
            if array is None:
                raise LookupError(f"the mesh has no field {field['name']}")
            values = vtk_to_numpy(array).astype("<f4")
            values[outside] = numpy.nan
            file.write(values.tobytes())
    return milliseconds


def main():
    reader = vtkXMLUnstructuredGridReader()
    reader.SetFileName(sys.argv[1])
    reader.Update()
    say(peer=f"VTK {vtkVersion.GetVTKVersion()} vtkProbeFilter")
    for line in sys.stdin:
        try:
            say(ms=sample(reader.GetOutput(), json.loads(line)))
        except Exception as error:  # a peer answers whatever happens
            say(error=str(error) or type(error).__name__)


if __name__ == "__main__":
    main()
