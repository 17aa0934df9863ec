"""`tessera verify` accepts the file, and refuses it after one voxel was changed."""

import numpy
import pyopenvdb


def check_verify(rng, tessera, mesh_path, vdb_path, file, samples, counts):
    problems = []
    result = tessera("verify", mesh_path, vdb_path, "--quiet", "--samples", 1000000000)
    if result.returncode != 0:
        problems.append(f"verify: exit code {result.returncode} for an untouched file: {result.stderr.strip()}")
        return problems
    changed_path = vdb_path.with_name("changed.vdb")
    what = change_coverage(rng, file, samples) if rng.random() < 0.4 else change_value(rng, file, samples)
    if not what:
        return problems
    pyopenvdb.write(str(changed_path), grids=[g.vdb for g in file.grids.values()], metadata=file.metadata)
    counts["changed voxels"] = counts.get("changed voxels", 0) + 1
    result = tessera("verify", mesh_path, changed_path, "--quiet", "--samples", 1000000000)
    if result.returncode != 2:
        problems.append(f"verify: exit code {result.returncode}, not 2, after {what}: {result.stderr.strip()}")
    return problems


def change_value(rng, file, samples):
    """Changes a random active voxel of a value grid by a tenth of the field's range or more."""
    grids = [
        (file.grid(name, level), i) for level in file.levels() for i, field in enumerate(file.fields) for name in field["grids"]
        if file.grid(name, level) is not None and len(file.grid(name, level).points)
    ]  # fmt: skip
    if not grids:
        return None
    grid, position = grids[int(rng.integers(len(grids)))]
    row = int(rng.integers(len(grid.points)))
    point, component = tuple(int(x) for x in grid.points[row]), int(rng.integers(grid.components))
    span = file.report["fields"][position]["range"] or 1.0
    accessor = grid.vdb.getAccessor()
    value = numpy.atleast_1d(numpy.array(accessor.getValue(point), float))
    step = max(span * 0.3, 0.1 * abs(value[component]))
    changed = value.copy()
    # Towards zero where that is possible, so that half floats don't overflow.
    changed[component] += -step if value[component] > 0 else step
    accessor.setValueOn(point, tuple(changed) if grid.components == 3 else float(changed[0]))
    covered = file.grid("coverage", grid.level).find(numpy.array([point]))[0] >= 0
    return f"{grid.name} at {point} ({'a sample' if covered else 'an extension'}) was set from {value} to {changed}"


def change_coverage(rng, file, samples):
    """Switches off the coverage of a point well inside the mesh."""
    grids = [file.grid("coverage", level) for level in file.levels()]
    grids = [g for g in grids if g is not None and len(g.points)]
    if not grids:
        return None
    grid = grids[int(rng.integers(len(grids)))]
    rows = rng.permutation(len(grid.points))[:20]
    distance, _ = samples.level(grid.level).nearest(grid.points[rows])
    deep = rows[distance > 0.01]
    if not len(deep):
        return None
    point = tuple(int(x) for x in grid.points[deep[0]])
    grid.vdb.getAccessor().setValueOff(point, False)
    return f"{grid.name} was switched off at {point}"
